"""Make a column of touching spheres, and hexahedra of eight of them each around it."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.verification import write_packing

d = 1.0e-3
line = d * (np.arange(2) + 0.5)
x = np.array([(a, b, d * (k + 0.5)) for k in range(-4, 10) for a in line for b in line])
write_packing(Path("packing.h5"), x, np.full((len(x), 3), 0.5005 * d))
bar = meshes.box(np.zeros(3), np.array([2 * d, 2 * d, 14 * d]), (1, 1, 7))
bar.volumes.update(inner=np.arange(3), layer=np.arange(3, 5), rest=np.arange(5, 7))
meshes.write_mesh(Path("bar.h5"), bar)
