"""A small bed of grains that falls on ghosts on a block: input of several coupled cases."""

from pathlib import Path

import numpy as np
from coupled import write_box

from talus.verification import write_packing

RADIUS, PITCH, ACROSS, LAYERS = 2.0e-3, 4.4e-3, 4, 3


def write_bed(folder: Path) -> None:
    """Write block.h5 and pack.h5: a floor of ghosts, layers of spheres and ellipsoids above."""
    half = 0.5 * PITCH * ACROSS + RADIUS
    write_box(folder / "block.h5", [-half, -half, -0.02], [half, half, 0.0], (4, 4, 3))
    rng = np.random.default_rng(3)
    line = PITCH * (np.arange(ACROSS) - 0.5 * (ACROSS - 1))
    plane = np.array([[x, y] for x in line for y in line])
    ghosts = np.column_stack([plane, np.zeros(len(plane))])
    layers = []
    for k in range(LAYERS):
        at = plane + rng.uniform(-2e-4, 2e-4, plane.shape) + 0.5e-3 * (k % 2)
        layers.append(np.column_stack([at, np.full(len(at), 1.02 * 2 * RADIUS * (k + 1))]))
    x = np.vstack([ghosts, *layers])
    n, g = len(x), len(ghosts)
    axes = np.full((n, 3), RADIUS)
    axes[g::2] = RADIUS * np.array([1.0, 0.9, 0.8])
    quat = rng.normal(size=(n, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    kind = np.where(np.arange(n) < g, 1, 0)
    v = np.where(kind[:, None] == 0, np.array([0.0, 0.0, -0.2]), 0.0)
    ids = np.arange(1, n + 1)
    write_packing(folder / "pack.h5", x, axes, quat, kind, ids, {"ghosts": ids[:g]}, v=v)
