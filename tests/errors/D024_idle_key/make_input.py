"""Write the mesh of this case: a box of two elements, each a group of its own."""

from pathlib import Path

import numpy as np

from talus.mesh import structured
from talus.verification import write_hex_mesh

line = np.array([0.0, 1.0])
x, hex8 = structured((line, line, np.array([0.0, 1.0, 2.0])))
low = np.flatnonzero(np.isclose(x[:, 2], 0.0))
groups = {"lower": np.array([0]), "upper": np.array([1])}
write_hex_mesh(Path("box.h5"), x, hex8, nodes={"z0": low}, volumes=groups)
