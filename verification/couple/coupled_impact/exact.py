"""Momentum, angular momentum and energy of a sphere that hits a free block through a ghost."""

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.verification import Case, write_packing

RADIUS, SPEED = 5.0e-3, 1.0
MASS = 2650.0 * 4 / 3 * np.pi * RADIUS**3


def vectors(audit: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Columns name_x, name_y, name_z as rows of vectors."""
    return np.column_stack([audit[f"{name}_{c}"] for c in "xyz"])


def run(case: Case) -> None:
    """Judge what the audit says of two schemes."""
    write_box(case.folder / "block.h5", [-0.02, -0.02, -0.03], [0.02, 0.02, 0.0], (4, 4, 3))
    ghost = np.array([3.0e-3, -2.0e-3, 0.0])
    lean = np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0])
    sphere = ghost + (2 * RADIUS + 1.0e-6) * lean
    v = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]])
    write_packing(
        case.folder / "pack.h5",
        np.array([ghost, sphere]),
        np.full((2, 3), RADIUS),
        kind=np.array([1, 0]),
        v=v,
        groups={"ghosts": np.array([1])},
    )
    start, spin = MASS * v[1], MASS * np.cross(sphere, v[1])
    energy = 0.5 * MASS * SPEED**2
    fig, ax = case.figure()
    for scheme, limit, work_limit in (("average", 1e-5, 1e-5), ("iterated", 1e-6, 1e-9)):
        case.run("talus-couple", write_deck(case, f"{scheme}.nml", "coupled.nml", scheme=scheme))
        audit = audit_of(case, scheme)
        push = np.abs(audit["force_on_solid_z"]).max()
        case.above(f"{scheme}: largest force [N]", push, 10.0, "they do meet")
        off = np.linalg.norm(vectors(audit, "momentum") - start, axis=1).max() / (MASS * SPEED)
        case.below(f"{scheme}: momentum", off, 1e-11, "round-off of 500 exchanges")
        turned = vectors(audit, "angular_momentum") - spin
        off = np.linalg.norm(turned, axis=1).max() / np.linalg.norm(spin)
        case.below(f"{scheme}: angular momentum", off, 5e-4, "small displacements, u/x")
        grains = audit["grains_kinetic"] + audit["grains_elastic"]
        solid = audit["solid_kinetic"] + audit["solid_elastic"]
        case.below(f"{scheme}: energy", np.abs(grains + solid - energy).max() / energy, limit)
        work = np.abs(audit["interface_work_difference"]).max() / energy
        case.below(f"{scheme}: works of both sides", work, work_limit)
    ax.plot(1e6 * audit["time"], grains / energy, label="grain")
    ax.plot(1e6 * audit["time"], solid / energy, label="solid")
    ax.plot(1e6 * audit["time"], (grains + solid) / energy, label="both")
    ax.set(xlabel="time [µs]", ylabel="energy / energy at the start [-]")
    ax.legend()
    case.save(fig)
