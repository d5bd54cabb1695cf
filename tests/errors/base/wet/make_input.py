"""A cubic lattice of 4 x 4 x 8 touching spheres of 1 mm."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = 1.0e-3 * (np.stack(np.meshgrid(*(np.arange(n) for n in (4, 4, 8)), indexing="ij"), -1) + 0.5)
write_h5(Path("packing.h5"), make_packing(x.reshape(-1, 3), np.full((128, 3), 0.5e-3)))
