"""Make a mesh of a hex8 beside a hex20, past the checks of `talus mesh`."""

import h5py
import numpy as np

from talus import mesh as meshes
from talus.orders import converted

low = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
high = converted(low, "hex20")
used = np.unique(np.concatenate([low.hex8[0], high.cells["hex20"][1]]))
new = np.full(len(high.x), -1)
new[used] = np.arange(len(used))
x = high.x[used]
with h5py.File("box.h5", "w") as file:
    file.attrs["format"] = np.bytes_("talus-mesh")
    file.attrs["version"] = np.int32(2)
    file["nodes/x"] = x
    file["cells/hex8"] = new[low.hex8[:1]].astype(np.int32)
    file["cells/hex20"] = new[high.cells["hex20"][1:]].astype(np.int32)
    file["volume_groups/all"] = np.arange(2, dtype=np.int32)
    file["node_groups/z0"] = np.flatnonzero(x[:, 2] == 0.0).astype(np.int32)
