"""Make the mesh: a box of two cubes."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

box = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
meshes.write_mesh(Path("box.h5"), box)
