"""An impact at 400 m/s, which is over before all contacts are looked at again."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 0.0]])
v = np.array([[400.0, 0.0, 0.0]])
write_h5(Path("packing.h5"), make_packing(x, np.full((1, 3), 1.0e-3), v=v))
