"""Make the mesh: a box of 2 x 1 x 1 cubes."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

meshes.write_mesh(Path("box.h5"), meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1)))
