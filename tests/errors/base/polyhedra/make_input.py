"""Two cubes, one above the other, and a small sphere beside them."""

from pathlib import Path

import numpy as np

from talus.clumps import Template
from talus.commands.pack_clump import packing_of_clumps
from talus.packing import write_h5
from talus.polyhedra import named_points, rounded

cube = rounded(named_points("cube:2e-3"), 0.1)
ball = Template(np.zeros((1, 3)), np.full(1, 5.0e-4))
x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.1e-3], [2.0e-3, 0.0, 0.0]])
quat = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
made = packing_of_clumps([cube, ball], np.array([0, 0, 1]), np.ones(3), x, quat)
write_h5(Path("packing.h5"), made)
