"""Level the settled bed and put the block over it.

Usage: prepare.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.packing import read_h5, write_h5

SIZE, CELLS = np.array([0.06, 0.06, 0.04]), (5, 5, 4)
GAP = 1.0e-4  # between the highest grain and the block [m]


def main() -> int:
    """Write levelled.h5 and block.h5."""
    folder = Path(sys.argv[1])
    bed = read_h5(folder / "bed.h5")
    top = bed.x[:, 2] + bed.axes[:, 2]
    level = np.sort(top)[-(len(top) // 20)]  # a twentieth is levelled off
    bed = bed.take(top <= level)
    bed.v[:] = bed.omega[:] = 0.0
    write_h5(folder / "levelled.h5", bed)
    lower = np.array([0.04, 0.04, level + GAP])
    mesh = box(lower, lower + SIZE, CELLS)
    mesh.facets["skin"] = np.vstack([mesh.facets[k] for k in ("z0", "x0", "x1", "y0", "y1")])
    write_mesh(folder / "block.h5", mesh)
    print(f"{len(bed.x)} grains up to {1e3 * level:.1f} mm")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
