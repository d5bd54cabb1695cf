"""Make the mesh: a box of 2 x 1 x 1 cubes, as hex20."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.orders import converted

box = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
meshes.write_mesh(Path("box.h5"), converted(box, "hex20"))
