"""A superquadric a hundred times longer than thick."""

from pathlib import Path

import numpy as np

from talus.checksum import edited
from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 2.0e-3], [5.0e-3, 0.0, 2.0e-3]])
packing = make_packing(x, np.full((2, 3), 1.0e-3))
write_h5(Path("packing.h5"), packing)

with edited("packing.h5") as file:
    file.attrs["version"] = np.int32(2)
    file["grains/exponent"] = np.array([2.0, 4.0])
    file["grains/axes"][1] = [1.0e-1, 1.0e-3, 1.0e-3]
