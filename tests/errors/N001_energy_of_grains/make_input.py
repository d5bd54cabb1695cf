"""Two elastic spheres that meet in steps too long for their impact: they gain energy."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 0.0], [2.5e-3, 0.0, 0.0]])
v = np.array([[10.0, 0.0, 0.0], [-10.0, 0.0, 0.0]])
write_h5(Path("packing.h5"), make_packing(x, np.full((2, 3), 1.0e-3), v=v))
