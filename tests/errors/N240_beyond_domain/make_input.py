"""Nine spheres in a row, one a centimetre, of which the fifth moves two centimetres a step."""

from pathlib import Path

import numpy as np

from talus.verification import write_packing

x = np.outer(np.arange(9), [0.01, 0.0, 0.0])
v = np.zeros((9, 3))
v[4, 0] = 2.0e4
write_packing(Path("packing.h5"), x, np.full((9, 3), 1.0e-3), v=v)
