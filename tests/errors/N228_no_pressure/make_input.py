"""Two spheres whose motion is prescribed: nothing gives way to the liquid."""

from pathlib import Path

import numpy as np

from talus.packing import FIXED, make_packing, write_h5

x = np.array([[0.5e-3, 0.5e-3, 0.5e-3], [2.5e-3, 2.5e-3, 4.5e-3]])
packing = make_packing(x, np.full((2, 3), 0.5e-3), kind=np.array([0, FIXED]))
write_h5(Path("packing.h5"), packing)
