"""Two spheres of 1 mm radius, apart from each other."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 2.0e-3], [5.0e-3, 0.0, 2.0e-3]])
packing = make_packing(x, np.full((2, 3), 1.0e-3))
write_h5(Path("packing.h5"), packing)
