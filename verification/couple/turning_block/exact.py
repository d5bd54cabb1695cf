"""Momentum, angular momentum and rotation of a free block that is hit by spinning grains."""

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.mesh import read_mesh
from talus.verification import Case, field_steps, write_packing

RADIUS, PITCH, ACROSS = 2.0e-3, 4.5e-3, 4


def run(case: Case) -> None:
    """Compare fixed ghosts with ghosts that turn, at points and smeared."""
    write_input(case)
    fig, ax = case.figure()
    for rotation, more in (("fixed", ""), ("curl", ""), ("curl", ", spread = 4.0e-3")):
        label = rotation + (" spread" if more else "")
        values = {"rotation": rotation, "more": more}
        for side in ("grains", "solid"):
            for old in case.folder.glob(f"{rotation}_{side}.h5"):
                old.unlink()
            write_deck(case, f"{rotation}_{side}.nml", f"{side}.nml")
        case.run("talus-couple", write_deck(case, f"{rotation}.nml", "coupled.nml", **values))
        audit = audit_of(case, rotation)
        p = np.column_stack([audit[f"momentum_{k}"] for k in "xyz"])
        angular = np.column_stack([audit[f"angular_momentum_{k}"] for k in "xyz"])
        push = np.abs(audit["force_on_solid_z"])
        case.above(f"{label}: largest force on the block [N]", push.max(), 1.0, "it is hit")
        impulse = push.sum() * 2.0e-6
        drift = np.linalg.norm(p - p[0], axis=1) / impulse
        case.below(f"{label}: momentum", drift.max(), 1e-6, "over the impulse on the block")
        turned = np.linalg.norm(angular - angular[0], axis=1) / (impulse * RADIUS)
        if rotation == "curl":
            case.below(f"{label}: angular momentum", turned.max(), 1e-3, "small displacements")
            compare_rotation(case, label)
        else:
            case.above(f"{label}: angular momentum lost", turned.max(), 2e-2, "moments of ghosts")
        works = audit["interface_work_on_grains"] + audit["interface_work_on_solid"]
        turnover = np.abs(np.diff(audit["interface_work_on_grains"])).sum()
        case.below(f"{label}: works at the interface", np.abs(works).max() / turnover, 1e-7)
        ax.semilogy(1e3 * audit["time"][1:], np.maximum(turned[1:], 1e-12), label=label)
    ax.set(xlabel="time [ms]", ylabel="angular momentum / (impulse x radius) [-]")
    ax.legend()
    case.save(fig)


def write_input(case: Case) -> None:
    """A block with a floor of ghosts; four grains with spin above, on one side."""
    half = 0.5 * PITCH * ACROSS
    write_box(case.folder / "block.h5", [-half, -half, -0.01], [half, half, 0.0], (4, 4, 2))
    line = PITCH * (np.arange(ACROSS) - 0.5 * (ACROSS - 1))
    ghosts = np.array([[x, y, 0.0] for x in line for y in line])
    free = ghosts[[0, 1, 4, 6]] + np.array([0.3, 0.2, 2.02]) * RADIUS
    x = np.vstack([ghosts, free])
    n, g = len(x), len(ghosts)
    kind = np.where(np.arange(n) < g, 1, 0)
    v, omega = np.zeros((n, 3)), np.zeros((n, 3))
    v[g:] = [0.0, 0.0, -0.3]
    omega[g:] = [[150.0, 0.0, 80.0], [0.0, -150.0, 80.0], [100.0, 100.0, 0.0], [0.0, 150.0, 90.0]]
    write_packing(
        case.folder / "pack.h5",
        x,
        np.full((n, 3), RADIUS),
        kind=kind,
        v=v,
        omega=omega,
        groups={"ghosts": np.arange(1, g + 1)},
    )


def compare_rotation(case: Case, label: str) -> None:
    """Judge the mean rotation of the ghosts against that of the block's nodes."""
    quat = field_steps(case.folder / "curl_grains.h5")[-1].grains["quat"][: ACROSS**2]
    ghosts = 2.0 * quat[:, 1:].mean(axis=0)
    solid = field_steps(case.folder / "curl_solid.h5")
    u, x = solid[-1].solid["u"], read_mesh(case.folder / "block.h5").x
    arm = x - x.mean(axis=0)
    inertia = (np.sum(arm**2) * np.eye(3)) - arm.T @ arm
    block = np.linalg.solve(inertia, np.cross(arm, u - u.mean(axis=0)).sum(axis=0))
    case.above(f"{label}: rotation of the block [rad]", np.linalg.norm(block), 1e-5, "it turns")
    off = np.linalg.norm(ghosts - block) / np.linalg.norm(block)
    case.below(f"{label}: rotation of the ghosts off the block's", off, 5e-2, "it vibrates, too")
