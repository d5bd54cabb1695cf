"""Make the mesh: a slice of 3 x 1 x 3 cubes, coarse for the steep law of its pores."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

box = meshes.box(np.zeros(3), np.array([1.0, 1.0 / 3.0, 1.0]), (3, 1, 3))
meshes.write_mesh(Path("box.h5"), box)
