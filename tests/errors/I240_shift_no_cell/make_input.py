"""A contact over a face of a packing without cell."""

from pathlib import Path

import numpy as np

from talus.packing import make_packing, write_h5

x = np.array([[0.5e-3, 1.0e-3, 2.0e-3], [8.6e-3, 1.0e-3, 2.0e-3]])
packing = make_packing(x, np.full((2, 3), 1.0e-3))
packing.pairs, packing.tangential = np.array([[1, 2]]), np.zeros((1, 3))
packing.shift = np.array([[-1, 0, 0]])
write_h5(Path("packing.h5"), packing)
