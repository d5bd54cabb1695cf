"""Two spheres whose ids leave room for one more."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.1e-3]])
ids = np.array([2147483645, 2147483646])
write_h5(Path("packing.h5"), make_packing(x, np.full((2, 3), 1.0e-3), ids=ids))
