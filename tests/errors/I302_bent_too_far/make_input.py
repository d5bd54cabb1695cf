"""Make a tet10 with a middle node far off its edge, past the checks of `talus mesh`."""

import h5py
import numpy as np

from talus.elements import reference_nodes

x = reference_nodes("tet10").copy()
x[4] += [0.1, 0.9, 0.9]
with h5py.File("box.h5", "w") as file:
    file.attrs["format"] = np.bytes_("talus-mesh")
    file.attrs["version"] = np.int32(2)
    file["nodes/x"] = x
    file["cells/tet10"] = np.arange(10, dtype=np.int32)[None]
    file["volume_groups/all"] = np.zeros(1, dtype=np.int32)
    file["node_groups/z0"] = np.array([0, 1, 2], dtype=np.int32)
