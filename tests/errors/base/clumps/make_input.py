"""Two dumbbells of two spheres each, one above the other."""

from pathlib import Path

import numpy as np

from talus.clumps import Template
from talus.commands.pack_clump import packing_of_clumps
from talus.packing import write_h5

template = Template(np.array([[0.0, 0.0, 0.0], [1.0e-3, 0.0, 0.0]]), np.full(2, 1.0e-3))
x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.1e-3]])
quat = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
write_h5(Path("packing.h5"), packing_of_clumps([template], np.zeros(2, int), np.ones(2), x, quat))
