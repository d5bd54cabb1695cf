"""Two spheres with a gap that the bonds are to fill, wider than the margin of the list."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 2.0e-3], [2.15e-3, 0.0, 2.0e-3]])
write_h5(Path("packing.h5"), make_packing(x, np.full((2, 3), 1.0e-3)))
