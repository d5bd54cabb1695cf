"""A thousand grains: the position of all is no number, the orientation of eight is no rotation."""

from pathlib import Path

import numpy as np

from talus.checksum import edited
from talus.packing import make_packing, write_h5

x = np.array([[5.0e-3 * k, 0.0, 2.0e-3] for k in range(1000)])
packing = make_packing(x, np.full((1000, 3), 1.0e-3))
write_h5(Path("packing.h5"), packing)

with edited("packing.h5") as file:
    file["grains/x"][:, 0] = np.nan
    file["grains/quat"][200:208, 0] = 0.5
