"""Two spheres of 1 mm radius, and a field file of three."""

from pathlib import Path

import h5py
import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.0, 0.0, 2.0e-3], [5.0e-3, 0.0, 2.0e-3]])
packing = make_packing(x, np.full((2, 3), 1.0e-3))
write_h5(Path("packing.h5"), packing)
with h5py.File("run.h5", "w") as file:
    file.attrs["format"] = np.bytes_("talus-grains")
    step = file.create_group("steps/000000")
    step.attrs["time"] = 0.0
    step["grains/id"] = np.array([1, 2, 3])
    step["contacts/stiffness"] = np.zeros((0, 2))
