"""A superquadric above a surface."""

from pathlib import Path

import h5py
import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 2.0e-3], [5.0e-3, 0.0, 2.0e-3]])
packing = make_packing(x, np.full((2, 3), 1.0e-3))
write_h5(Path("packing.h5"), packing)

with h5py.File("packing.h5", "r+") as file:
    file.attrs["version"] = np.int32(2)
    file["grains/exponent"] = np.array([2.0, 4.0])
