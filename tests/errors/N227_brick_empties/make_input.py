"""Touching spheres in the lower half of the box, one above."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.5e-3, 0.5e-3, 0.5e-3], [2.5e-3, 2.5e-3, 0.5e-3], [2.5e-3, 0.5e-3, 4.5e-3]])
write_h5(Path("packing.h5"), make_packing(x, np.full((3, 3), 0.5e-3)))
