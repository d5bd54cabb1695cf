"""A cube of a centimetre."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes

cube = meshes.box(np.zeros(3), np.full(3, 0.01), (2, 2, 2))
meshes.write_mesh(Path("mesh.h5"), cube)
