"""Two tiles of two spheres in a cell, of one material, and a bed of three copies of the first."""

from pathlib import Path

import numpy as np

from talus.checksum import edited
from talus.packing import make_packing, write_h5

R = 1.0e-3
STAMP = {
    "young": 1.0e8, "poisson": 0.25, "density": 2650.0, "friction": 0.5, "making_friction": 0.2,
    "mean_wanted": 1.0e4, "solid_fraction": 0.13,
}  # fmt: skip


def write_tile(name: str, radius: float, **changes: float) -> None:
    """Write a tile of two spheres that touch in a row, with the stamp of its material."""
    tile = make_packing(np.array([[R, R, R], [2.99 * R, R, R]]), np.full((2, 3), radius))
    tile.cell = np.diag([3.98 * R, 4.0 * R, 4.0 * R])
    tile.pairs = np.array([[1, 2], [1, 2]])
    tile.tangential = np.zeros((2, 3))
    tile.shift = np.array([[0, 0, 0], [-1, 0, 0]], dtype=np.int32)
    write_h5(Path(name), tile)
    with edited(Path(name)) as file:
        attributes = file.create_group("tile").attrs
        for key, value in (STAMP | changes).items():
            attributes[key] = value
    bed = tile.repeated((3, 1, 1))
    bed.cell = None
    bed.shift = None
    write_h5(Path("packing.h5"), bed)


write_tile("loose.h5", 0.999 * R)
write_tile("tile.h5", R)
