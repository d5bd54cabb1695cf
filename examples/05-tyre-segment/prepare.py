"""Level the settled bed, make the tread and put it over the bed.

Usage: prepare.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

from talus.mesh import Mesh, boundary_faces, structured, write_mesh
from talus.packing import read_h5, write_h5

INNER, OUTER, WIDTH = 0.040, 0.060, 0.05  # [m]
FIRST, LAST = np.radians([-45.0, 95.0])  # of the segment, from straight down, ahead positive
CELLS = (2, 20, 4)  # through, around, across
START, MIDDLE = 0.065, 0.05  # of the hub along and across the trough [m]
GAP = 1.0e-4  # between the highest grain and the tread [m]


def tyre(centre: np.ndarray) -> Mesh:
    """Return the segment about a centre [m]."""
    lines = [np.linspace(0.0, 1.0, n + 1) for n in CELLS]
    s, hex8 = structured((lines[0], lines[1], lines[2]))
    radius = INNER + (OUTER - INNER) * s[:, 0]
    angle = FIRST + (LAST - FIRST) * s[:, 1]
    # angles grow with the turn about y, radii outwards: the third axis is -y for a right hand
    x = np.column_stack([radius * np.sin(angle), WIDTH * (0.5 - s[:, 2]), -radius * np.cos(angle)])
    mesh = Mesh(centre + x, hex8, {"all": np.arange(len(hex8))})
    mesh.nodes["hub"] = np.flatnonzero(np.isclose(s[:, 0], 0.0))
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    mesh.facets["tread"] = np.array([q for q in faces if not np.isclose(s[q][:, 0], 0.0).all()])
    return mesh


def main() -> int:
    """Write levelled.h5, tyre.h5 and the centre into solid.nml."""
    folder = Path(sys.argv[1])
    bed = read_h5(folder / "bed.h5")
    top = bed.x[:, 2] + bed.axes[:, 2]
    level = np.sort(top)[-(len(top) // 15)]  # a fifteenth is levelled off
    bed = bed.take(top <= level)
    bed.v[:] = bed.omega[:] = 0.0
    write_h5(folder / "levelled.h5", bed)
    centre = np.array([START, MIDDLE, level + GAP + OUTER])
    write_mesh(folder / "tyre.h5", tyre(centre))
    deck = folder / "solid.nml"
    deck.write_text(deck.read_text().replace("CENTRE", ", ".join(f"{v:.9f}" for v in centre)))
    print(f"{len(bed.x)} grains up to {1e3 * level:.1f} mm")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
