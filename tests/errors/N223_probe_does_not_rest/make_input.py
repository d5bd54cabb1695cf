"""Spheres on a lattice that overlap, one of them out of its place."""

from pathlib import Path

import numpy as np

from talus.generate import lattice
from talus.packing import write_h5

packing = lattice("fcc", (3, 3, 3), 2.8e-3, np.full(3, 1.0e-3), periodic=True)
packing.x[50] += 3.0e-6
write_h5(Path("packing.h5"), packing)
