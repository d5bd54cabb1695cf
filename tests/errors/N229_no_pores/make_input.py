"""Fixed spheres that overlap until the box is full."""

from pathlib import Path

import numpy as np

from talus.packing import FIXED, make_packing, write_h5

x = np.stack(np.meshgrid(*[0.5e-3 + np.linspace(0.0, 3.0e-3, 6)] * 3, indexing="ij"), -1)
x = x.reshape(-1, 3)
packing = make_packing(x, np.full((216, 3), 0.5e-3), kind=np.full(216, FIXED))
write_h5(Path("packing.h5"), packing)
