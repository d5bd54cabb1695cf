"""Make four ghosts on the top of a cube, and a grain above them."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.verification import write_packing

p = 5.0e-3
flat = [(x, y, 0.0) for x in (p / 2, 1.5 * p) for y in (p / 2, 1.5 * p)]
x = np.array([*flat, (p, p, 0.705 * p)])
axes = np.full((5, 3), 0.49 * p)
kind = np.array([1, 1, 1, 1, 0], dtype=np.int32)
write_packing(Path("packing.h5"), x, axes, kind=kind, groups={"floor": np.arange(1, 5)})
cube = meshes.box(np.array([0.0, 0.0, -2 * p]), np.array([2 * p, 2 * p, 0.0]), (2, 2, 2))
meshes.write_mesh(Path("block.h5"), cube)
