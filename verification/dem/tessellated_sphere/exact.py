"""Overlap of grains with a ball of triangles against the exact ball."""

from pathlib import Path

import numpy as np

from talus.verification import Case, field_steps, write_packing

BALL, GRAIN, DEPTH, STIFFNESS = 10.0e-3, 2.0e-3, 0.2e-3, 1.0e6
LEVELS = [3, 4, 5, 6]


def ball(level: int) -> np.ndarray:
    """Return the triangles (n, 3, 3) of an octahedron refined `level` times, corners on it."""
    tips = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    sides = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    triangles = tips[sides]
    for _ in range(level):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (p + q for p, q in ((a, b), (b, c), (c, a)))
        ab, bc, ca = (p / np.linalg.norm(p, axis=1, keepdims=True) for p in (ab, bc, ca))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, 1) for part in parts])
    return BALL * triangles


def write_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles as binary STL (single precision)."""
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corner"] = triangles
    path.write_bytes(b"ball".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def run(case: Case) -> None:
    """Judge the order of the overlap's error; plot it against the triangles' size."""
    golden = np.arange(40) + 0.5
    height, turn = 1.0 - golden / 20.0, np.pi * (1.0 + np.sqrt(5.0)) * golden
    wide = np.sqrt(1.0 - height**2)
    normal = np.stack([wide * np.cos(turn), wide * np.sin(turn), height], -1)
    x = (BALL + GRAIN - DEPTH) * normal
    write_packing(case.folder / "pack.h5", x, np.full((len(x), 3), GRAIN))
    size, error, tilt = [], [], []
    for level in LEVELS:
        triangles = ball(level)
        write_stl(case.folder / "ball.stl", triangles)
        case.run("talus-dem", "deck.nml")
        force = field_steps(case.folder / "deck.h5")[0].grains["force"]
        size.append(np.linalg.norm(triangles[:, 0] - triangles[:, 1], axis=1).max())
        depth = np.linalg.norm(force, axis=1) / STIFFNESS
        error.append(np.sqrt(np.mean((depth - DEPTH) ** 2)) / BALL)
        along = np.einsum("ij,ij->i", force, normal) / np.maximum(depth * STIFFNESS, 1e-300)
        tilt.append(np.sqrt(np.mean(2.0 - 2.0 * along)))
        case.metric(f"grains that touch, level {level}", float((depth > 0).sum()), 40.0, 0.0)
    orders = np.log(np.divide(error[:-1], error[1:])) / np.log(np.divide(size[:-1], size[1:]))
    case.metric("order of the overlap", orders[-1], 2.0, 0.2, "last two sizes")
    orders = np.log(np.divide(tilt[:-1], tilt[1:])) / np.log(np.divide(size[:-1], size[1:]))
    case.metric("order of the normal", orders[-1], 1.0, 0.3, "last two sizes")
    fig, ax = case.figure()
    scale = np.array(size) / BALL
    ax.loglog(scale, error, "o", label="overlap, Talus")
    ax.loglog(scale, error[-1] * (scale / scale[-1]) ** 2, "-", label="second order")
    ax.loglog(scale, tilt, "s", label="normal, Talus")
    ax.loglog(scale, tilt[-1] * (scale / scale[-1]), "--", label="first order")
    ax.set(xlabel="longest side / radius of the ball [-]", ylabel="error [-]")
    ax.legend()
    case.save(fig)
