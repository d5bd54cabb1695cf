"""Reactions of a block against the contact forces of ghosts on its distorted upper face."""

import numpy as np
from coupled import write_deck

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

RADIUS, OVERLAP = 0.8e-3, 2.0e-6


def run(case: Case) -> None:
    """Put grains on ghosts at random, couple once each way, balance forces and moments."""
    rng = np.random.default_rng(7)
    mesh = box(np.array([-0.02, -0.02, -0.02]), np.array([0.02, 0.02, 0.0]), (4, 4, 2))
    top = mesh.nodes["z1"]
    mesh.x[top] += 1.2e-3 * rng.uniform(-1.0, 1.0, (len(top), 3))
    write_mesh(case.folder / "block.h5", mesh)
    ghosts = []
    for quad in mesh.facets["z1"]:
        for xi in rng.uniform(-0.85, 0.85, (2, 2)):
            signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
            ghosts.append(np.prod(1 + signs * xi, axis=1) / 4 @ mesh.x[quad])
    ghosts = spread(np.array(ghosts), 4.2 * RADIUS)
    lean = rng.uniform(-0.5, 0.5, (len(ghosts), 3))
    lean[:, 2] = 1.0
    lean /= np.linalg.norm(lean, axis=1)[:, None]
    x = np.vstack([ghosts, ghosts + (2 * RADIUS - OVERLAP) * lean])
    n = len(ghosts)
    ids = np.arange(1, 2 * n + 1)
    kind = np.repeat([1, 0], n)
    v = np.vstack([np.zeros((n, 3)), rng.uniform(-1e-2, 1e-2, (n, 3))])
    write_packing(
        case.folder / "pack.h5",
        x,
        np.full((2 * n, 3), RADIUS),
        kind=kind,
        ids=ids,
        v=v,
        omega=np.vstack([np.zeros((n, 3)), rng.uniform(-50.0, 50.0, (n, 3))]),
        groups={"ghosts": ids[:n]},
    )
    case.above("ghosts", n, 20, "enough of them")
    ways = (
        ("point", "fixed", ""),
        ("point", "curl", ""),
        ("kernel", "fixed", ", spread = 4.0e-3"),
        ("kernel", "curl", ", spread = 4.0e-3"),
    )
    for name, rotation, more in ways:
        for path in case.folder.glob("grains.h5"):
            path.unlink()
        deck = write_deck(
            case, f"{name}_{rotation}.nml", "coupled.nml", rotation=rotation, more=more
        )
        case.run("talus-couple", deck)
        balance(case, f"{name}, {rotation}", mesh.x, ghosts, rotation == "curl")


def balance(case: Case, label: str, x: np.ndarray, ghosts: np.ndarray, turns: bool) -> None:
    """Judge total force and moment about the origin against the reactions of the solid."""
    n = len(ghosts)
    grains = field_steps(case.folder / "grains.h5")[0].grains
    force, own = grains["force"][:n], grains["moment"][:n]
    reaction = field_steps(case.folder / "solid.h5")[-1].solid["reaction"]
    scale = np.abs(force).sum()
    case.above(
        f"{label}: mean force on a ghost [N]", np.linalg.norm(force, axis=1).mean(), 0.1, "loaded"
    )
    off = np.linalg.norm(force.sum(axis=0) + reaction.sum(axis=0)) / scale
    case.below(f"{label}: force balance", off, 1e-13, "round-off of a factorisation")
    moment = np.cross(ghosts, force).sum(axis=0) + turns * own.sum(axis=0)
    turned = np.linalg.norm(moment + np.cross(x, reaction).sum(axis=0)) / (scale * 0.02)
    if turns:
        twist = np.linalg.norm(own, axis=1).mean() / (scale / n * RADIUS)
        case.above(f"{label}: moment of a ghost over its force x radius", twist, 3e-3, "they turn")
    if turns or label.startswith("point"):
        case.below(f"{label}: moment balance", turned, 1e-13, "over sum |F| x half-width")
    else:
        case.below(f"{label}: moment balance", turned, 1e-4, "arms along the warped facets' normal")


def spread(points: np.ndarray, least: float) -> np.ndarray:
    """Drop points that are closer than `least` to one before them."""
    kept: list[np.ndarray] = []
    for point in points:
        if all(np.linalg.norm(point - other) > least for other in kept):
            kept.append(point)
    return np.array(kept)
