"""Make the mesh: a box of 2 x 1 x 1 cubes, facets without their elements."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.checksum import edited

meshes.write_mesh(Path("box.h5"), meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1)))
with edited("box.h5") as file:
    del file["facet_groups/z1/cell"]
