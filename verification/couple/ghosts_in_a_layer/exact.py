"""Rotation of ghosts on a micropolar layer: sheared, and turned as a whole."""

import numpy as np
from coupled import write_deck

from talus.mesh import structured
from talus.verification import Case, field_steps, write_hex_mesh, write_packing

MU, KAPPA, GAMMA, H, U = 1.0, 1.0, 0.02, 1.0, 0.01
ANGLE, ELEMENTS, SIDE, GHOSTS = 1.0e-3, 44, 0.1, 60
C = np.sqrt(GAMMA * (MU + KAPPA) / (KAPPA * (2 * MU + KAPPA)))
PART = 1.0 - KAPPA / (MU + KAPPA) * C / H * np.tanh(H / (2 * C))
TAU = (MU + KAPPA / 2) * U / H / PART


def micro_rotation(y: np.ndarray) -> np.ndarray:
    """Micro-rotation about z of the sheared layer."""
    return -TAU / (2 * MU + KAPPA) * (1.0 - np.cosh(y / C) / np.cosh(H / (2 * C)))


def half_curl(y: np.ndarray) -> np.ndarray:
    """Half the curl of its displacement about z."""
    slope = KAPPA / (2 * MU + KAPPA) * (1.0 - np.cosh(y / C) / np.cosh(H / (2 * C)))
    return -0.5 * TAU / (MU + KAPPA) * (1.0 + slope)


def write_input(case: Case) -> np.ndarray:
    """Write layer and ghosts on its upper side in z; return the ghosts' places."""
    line = np.array([0.0, SIDE])
    x, hex8 = structured((line, np.linspace(-H / 2, H / 2, ELEMENTS + 1), line))
    nodes = {"faces": np.flatnonzero(np.isclose(abs(x[:, 1]), H / 2))}
    for j, sign in enumerate((-1.0, 1.0)):
        for i, at in enumerate(line):
            here = np.isclose(x[:, 1], sign * H / 2) & np.isclose(x[:, 0], at)
            nodes[f"edge{i}{j}"] = np.flatnonzero(here)
    side = hex8[:, 4:]
    write_hex_mesh(case.folder / "layer.h5", x, hex8, facets={"side": side}, nodes=nodes)
    rng = np.random.default_rng(3)
    y = (np.arange(GHOSTS) + 0.5) / GHOSTS * H - H / 2
    across = rng.uniform(0.1, 0.9, GHOSTS) * SIDE
    ghosts = np.stack([across, y, np.full(GHOSTS, SIDE)], 1)
    points = np.vstack([ghosts, [5.0, 5.0, 5.0]])
    kind = np.append(np.ones(GHOSTS, int), 0)
    axes = np.full(points.shape, 0.2 * H / GHOSTS)
    ids = np.arange(1, GHOSTS + 2)
    groups = {"ghosts": ids[:-1]}
    write_packing(case.folder / "pack.h5", points, axes, kind=kind, ids=ids, groups=groups)
    return ghosts


def motion(name: str) -> tuple[str, str]:
    """Return what is held everywhere, and the motion of the faces."""
    lines = []
    for j, sign in enumerate((-1.0, 1.0)):
        for i in range(2):
            ux = sign * U / 2 if name == "sheared" else -ANGLE * sign * H / 2
            moves = [("x", ux)]
            if name == "turned":
                moves += [("y", ANGLE * i * SIDE), ("rz", ANGLE)]
            lines += [
                f"&motion group = 'edge{i}{j}', component = '{c}', curve = 'on', scale = {v:.17g} /"
                for c, v in moves
            ]
    if name == "sheared":
        return "'y', 'z', 'rx', 'ry'", "\n".join(["&support group = 'faces', fix = 'rz' /", *lines])
    return "'z', 'rx', 'ry'", "\n".join(lines)


def solve(case: Case, name: str, rotation: str) -> tuple[np.ndarray, np.ndarray, dict]:
    """Run; return turn about z and displacement of the ghosts, and fields of the layer."""
    for path in (*case.folder.glob("grains.h5"), *case.folder.glob("run_solid.h5")):
        path.unlink()
    held, moves = motion(name)
    text = (case.folder / "solid.nml").read_text()
    write_deck(case, "solid.nml", "solid.nml", held=held, motion=moves)
    case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml", rotation=rotation))
    (case.folder / "solid.nml").write_text(text)
    first, last = (field_steps(case.folder / "grains.h5")[k].grains for k in (0, -1))
    quat = last["quat"][:GHOSTS]
    turn = 2 * np.arcsin(quat[:, 3]) * np.sign(quat[:, 0])
    return turn, (last["x"] - first["x"])[:GHOSTS], field_steps(case.folder / "solid.h5")[-1].solid


def run(case: Case) -> None:
    """Judge rotations in shear and in a rigid turn."""
    ghosts = write_input(case)
    y = ghosts[:, 1]
    scale = abs(micro_rotation(np.zeros(1)))[0]
    fig, ax = case.figure()
    grid = np.linspace(-H / 2, H / 2, 401)
    for rotation, exact, name in (
        ("micro", micro_rotation, "micro-rotation"), ("curl", half_curl, "half the curl")
    ):  # fmt: skip
        turn, _, _ = solve(case, "sheared", rotation)
        error = np.abs(turn - exact(y)).max() / scale
        limit, why = 0.05, "one value an element, ghosts anywhere in it"
        if rotation == "micro":
            limit, why = (H / ELEMENTS / C) ** 2 / 8, "(h/c)^2/8: linear between nodes"
        case.below(f"sheared: ghosts off the {name}", error, limit, why)
        ax.plot(1e3 * exact(grid), grid, label=name)
        ax.plot(1e3 * turn, y, ".", ms=5, label=f"ghosts, rotation = '{rotation}'")
    apart = np.abs(micro_rotation(y) - half_curl(y)).max() / scale
    case.above("sheared: micro-rotation off half the curl", apart, 0.3, "so that they differ")
    turn, moved, solid = solve(case, "turned", "micro")
    case.below("turned: ghosts off the turn", np.abs(turn / ANGLE - 1).max(), 1e-9, "round-off")
    wanted = ANGLE * np.stack([-ghosts[:, 1], ghosts[:, 0], 0 * y], 1)
    case.below("turned: places", np.abs(moved - wanted).max() / (ANGLE * H), 1e-9, "linear solid")
    couple = np.abs(solid["couple_stress"]).max() / (GAMMA * ANGLE / C)
    case.below("turned: couple stress / (gamma angle/c)", couple, 1e-9, "no curvature")
    stress = np.abs(solid["stress"]).max() / (KAPPA * ANGLE)
    case.below("turned: stress / (kappa angle)", stress, 1e-9, "no strain")
    ax.set(xlabel="rotation [mrad]", ylabel="y [m]")
    ax.legend(fontsize=7)
    case.save(fig)
