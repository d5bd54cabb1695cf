"""Write the bed that falls on a soft block: prepare.py FOLDER makes bed_block.h5, bed_pack.h5."""

import sys
from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.verification import write_packing

RADIUS, ACROSS, LAYERS, SPEED = 2.5e-3, 5, 4, 0.5  # m, ghosts along a side, of grains, m/s
CELLS = (5, 5, 4)


def main() -> int:
    """Put layers of spheres, turned a little aside, above a floor of ghosts on the block's face."""
    folder, half = Path(sys.argv[1]), RADIUS * ACROSS
    block = box(np.array([-half, -half, -0.02]), np.array([half, half, 0.0]), CELLS)
    write_mesh(folder / "bed_block.h5", block)
    line = RADIUS * (2 * np.arange(ACROSS) + 1 - ACROSS)
    plane = np.array([[x, y] for x in line for y in line])
    ghosts = np.column_stack([plane, np.zeros(len(plane))])
    rng = np.random.default_rng(1)
    inner = plane[np.abs(plane).max(axis=1) < half - 2 * RADIUS]
    layers = [np.column_stack([inner * 1.1 + rng.uniform(-2e-4, 2e-4, inner.shape),
                               np.full(len(inner), 2.05 * RADIUS * (k + 1))])
              for k in range(LAYERS)]  # fmt: skip
    x = np.vstack([ghosts, *layers])
    kind = np.where(np.arange(len(x)) < len(ghosts), 1, 0)
    v = np.outer(kind == 0, [0.0, 0.0, -SPEED])
    ids = np.arange(1, len(x) + 1)
    write_packing(folder / "bed_pack.h5", x, np.full((len(x), 3), RADIUS), None, kind, ids,
                  {"ghosts": ids[: len(ghosts)]}, v=v)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
