"""A grain at 2000 m/s that is in front of another in one step and behind it in the next."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 0.0], [5.0e-2, 0.5e-3, 0.0]])
v = np.array([[2000.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
write_h5(Path("packing.h5"), make_packing(x, np.tile([1.0e-3, 0.9e-3, 0.8e-3], (2, 1)), v=v))
