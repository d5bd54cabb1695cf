"""A cube of eight elements."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

meshes.write_mesh(Path("block.h5"), meshes.box(np.zeros(3), np.full(3, 0.01), (2, 2, 2)))
