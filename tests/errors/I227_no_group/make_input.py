"""A mesh with one facet group, beside the grains."""

from pathlib import Path

import h5py
import numpy as np

from talus.verification import write_packing

x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.1e-3]])
kind = np.array([1, 0], dtype=np.int32)
groups = {"upper": np.array([2]), "lower": np.array([1])}
write_packing(Path("packing.h5"), x, np.full((2, 3), 1.0e-3), kind=kind, groups=groups)
with h5py.File("mesh.h5", "w") as file:
    file["nodes/x"] = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]])
    file["facet_groups/top/quad4"] = np.array([[0, 1, 2, 3]], dtype=np.int32)
