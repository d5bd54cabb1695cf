"""Write the block and what falls on it: prepare.py FOLDER makes ball/, bed/ and friction/."""

import sys
from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.verification import write_packing

RADIUS, ACROSS, LAYERS, SPEED = 2.5e-3, 5, 4, 0.5  # m, ghosts along a side, layers, m/s
CELLS = (5, 5, 4)


def write(folder: Path, x: np.ndarray, radius: np.ndarray, ghosts: int) -> None:
    """Write pack.h5: ghosts first, what follows falls; block.h5 under them."""
    folder.mkdir(parents=True, exist_ok=True)
    half = RADIUS * ACROSS
    write_mesh(folder / "block.h5", box(np.array([-half, -half, -0.02]),
                                        np.array([half, half, 0.0]), CELLS))  # fmt: skip
    kind = np.where(np.arange(len(x)) < ghosts, 1, 0)
    ids = np.arange(1, len(x) + 1)
    write_packing(folder / "pack.h5", x, np.repeat(radius[:, None], 3, axis=1), None, kind, ids,
                  {"ghosts": ids[:ghosts]}, v=np.outer(kind == 0, [0.0, 0.0, -SPEED]))  # fmt: skip


def main() -> int:
    """Put a ball, and layers of spheres turned a little aside, above a floor of ghosts."""
    folder = Path(sys.argv[1])
    line = RADIUS * (2 * np.arange(ACROSS) + 1 - ACROSS)
    plane = np.array([[x, y] for x in line for y in line])
    ghosts = np.column_stack([plane, np.zeros(len(plane))])
    ball = [[0.2e-3, 0.1e-3, 3.05 * RADIUS]]
    radius = np.full(len(ghosts) + 1, RADIUS)
    radius[-1] = 2 * RADIUS
    write(folder / "ball", np.vstack([ghosts, ball]), radius, len(ghosts))
    rng = np.random.default_rng(1)
    inner = plane[np.abs(plane).max(axis=1) < RADIUS * (ACROSS - 2)]
    layers = [np.column_stack([inner * 1.1 + rng.uniform(-2e-4, 2e-4, inner.shape),
                               np.full(len(inner), 2.05 * RADIUS * (k + 1))])
              for k in range(LAYERS)]  # fmt: skip
    x = np.vstack([ghosts, *layers])
    for run in ("bed", "friction"):
        write(folder / run, x, np.full(len(x), RADIUS), len(ghosts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
