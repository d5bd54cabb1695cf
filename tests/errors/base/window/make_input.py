"""A bed of three copies of a tile of two spheres in a cell, and a bar above it."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

R = 1.0e-3
tile = make_packing(np.array([[R, R, R], [2.99 * R, R, R]]), np.full((2, 3), R))
tile.cell = np.diag([3.98 * R, 4.0 * R, 4.0 * R])
tile.pairs = np.array([[1, 2], [1, 2]])
tile.tangential = np.zeros((2, 3))
tile.shift = np.array([[0, 0, 0], [-1, 0, 0]], dtype=np.int32)
write_h5(Path("tile.h5"), tile)
bed = tile.repeated((3, 1, 1))
bed.cell = None
bed.shift = None
write_h5(Path("packing.h5"), bed)
