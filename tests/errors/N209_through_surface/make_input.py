"""A grain at 200 m/s whose centre is beyond a plate after the step in which it meets it."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 0.0]])
v = np.array([[200.0, 0.0, 0.0]])
write_h5(Path("packing.h5"), make_packing(x, np.full((1, 3), 1.0e-3), v=v))
