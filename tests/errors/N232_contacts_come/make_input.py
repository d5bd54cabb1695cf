"""A lattice of spheres of 1 mm that goes down and has not yet touched the floor."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = 1.0e-3 * (np.stack(np.meshgrid(*(np.arange(n) for n in (4, 4, 7)), indexing="ij"), -1) + 0.5)
x = x.reshape(-1, 3) * np.array([1.0, 1.0, 1.01]) + np.array([0.0, 0.0, 2.0e-4])
v = np.tile([0.0, 0.0, -0.3], (112, 1))
write_h5(Path("packing.h5"), make_packing(x, np.full((112, 3), 0.495e-3), v=v))
