"""Make the mesh: two cubes that share one edge, a hinge about y."""

from pathlib import Path

import numpy as np

from talus.mesh import Mesh, write_mesh

x = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)], float)
order = [0, 1, 3, 2, 4, 5, 7, 6]
second = np.array([(2, 0, 1), (2, 1, 1), (1, 0, 2), (2, 0, 2), (2, 1, 2), (1, 1, 2)], float)
cells = np.array([order, [5, 8, 9, 7, 10, 11, 12, 13]])
mesh = Mesh(np.vstack([x, second]), cells, {"all": np.arange(2)})
mesh.nodes["base"] = np.arange(4)
write_mesh(Path("box.h5"), mesh)
