"""Eight ellipsoids, all of them given twice."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

corners = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)
x = 5.0e-3 * np.vstack([corners, corners])
axes = np.tile([1.0e-3, 0.9e-3, 0.8e-3], (16, 1))
write_h5(Path("packing.h5"), make_packing(x, axes))
