"""A cubic lattice of 4 x 4 x 8 touching spheres of 1 mm, the top layer ghosts under a block."""

from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.packing import make_packing, write_h5

x = 1.0e-3 * (np.stack(np.meshgrid(*(np.arange(n) for n in (4, 4, 8)), indexing="ij"), -1) + 0.5)
x = x.reshape(-1, 3)
top = np.flatnonzero(x[:, 2] > 7.0e-3) + 1
write_h5(Path("packing.h5"), make_packing(x, np.full((128, 3), 0.5e-3), groups={"ghosts": top}))
block = box(np.array([0.0, 0.0, 7.5e-3]), np.array([4e-3, 4e-3, 11.5e-3]), (1, 1, 2))
block.volumes.update(lower=np.array([0]), upper=np.array([1]))
write_mesh(Path("block.h5"), block)
