"""Make a faulty mesh, past the checks of `talus mesh`."""

import h5py
import numpy as np

from talus import mesh as meshes

mesh = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
x, hex8 = mesh.x, mesh.hex8
with h5py.File("box.h5", "w") as file:
    file.attrs["format"] = np.bytes_("talus-mesh")
    file.attrs["version"] = np.int32(1)
    file["nodes/x"] = x
    file["cells/hex8"] = hex8.astype(np.int32)
    file["volume_groups/all"] = np.arange(len(hex8), dtype=np.int32)
    file["node_groups/z0"] = np.flatnonzero(x[:, 2] == 0.0).astype(np.int32)
    file["facet_groups/top/quad4"] = np.zeros((0, 4), dtype=np.int32)
