"""A lattice of spheres that fly apart, with fast ones on both sides."""

from pathlib import Path

import numpy as np

from talus.verification import write_packing

x = 2.5e-3 * np.column_stack([a.ravel() for a in np.meshgrid(*3 * [np.arange(5.0)])])
v = np.random.default_rng(2).normal(size=x.shape)
write_packing(Path("packing.h5"), x, np.full(x.shape, 1.0e-3), v=v)
