"""A column of spheres of which a zone is opened as a box passes: decks, tile, packing and mesh."""

from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.packing import make_packing, read_packing, write_h5

D = 1.0e-3  # diameter [m]
WIDE = 2.02e-3  # of the column: spheres touch above one another, not side by side [m]
OVERLAP = 1.0e-3  # of the spheres, over their radius
COUPLED = """&run     title = 'Opened column', t_end = 1.2e-4, gravity = 0.0, 0.0, 0.0 /
&program side = 'grains', deck = 'grains.nml', threads = 1 /
&program side = 'solid', deck = 'solid.nml', threads = 1 /
&clock   exchange = 1.0e-6 /
&overlap free_elements = 'adapt', ghost_elements = 'adapt', partition = 'share', initial = 'dead_load' /
&adapt   centre = 1.0e-3, 1.0e-3, 6.0e-3, half = 1.0e-3, 1.0e-3, 1.0e-3, velocity = 0.0, 0.0, 100.0, free_within = 3.0e-3,
         every_time = 1.0e-5 MORE /
&checkpoint every_time = 2.5e-5, keep = 9 /
"""  # noqa: E501
GRAINS = """&run       title = 'Column of spheres', gravity = 0.0, 0.0, 0.0 /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.05 /
&particles file = 'packing.h5', material = 'quartz' /
&tile      file = 'tile.h5', copies = 1, 1, COPIES /
&wall      id = 'x0', point = 0.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0, material = 'quartz' /
&wall      id = 'x1', point = 2.02e-3, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'quartz' /
&wall      id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'quartz' /
&wall      id = 'y1', point = 0.0, 2.02e-3, 0.0, normal = 0.0, -1.0, 0.0, material = 'quartz' /
&dynamics  dt = 2.0e-7 /
&history   every_time = 4.0e-6 /
&output    every_time = 4.0e-5 /
"""  # noqa: E501
SOLID = """&run      title = 'Bar', gravity = 0.0, 0.0, 0.0 /
&mesh     file = 'bar.h5' /
&material id = 'soil', density = 1388.0, young = 1.0e8, poisson = 0.0 /
&section  group = 'all', material = 'soil' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&support  group = 'z1', fix = 'x', 'y', 'z' /
&analysis kind = 'explicit' /
"""


def spheres(layers: range) -> np.ndarray:
    """Return the centres of layers of a square column of spheres."""
    line = 0.5 * WIDE * (np.arange(2) + 0.5)
    return np.array([(a, b, D * (k + 0.5)) for k in layers for b in line for a in line])


def write(folder: Path, more: str = "", high: int = 16) -> None:
    """Write a column of so many tiles of two layers, some awake; a mesh of an element a tile."""
    radius = 0.5 * D * (1.0 + OVERLAP)
    tile = make_packing(spheres(range(2)), np.full((8, 3), radius))
    tile.cell, tile.corner = np.diag([WIDE, WIDE, 2.0 * D]), np.zeros(3)
    tile.pairs = np.array([[i, i + 4] for i in range(1, 5)] * 2)
    tile.shift = np.repeat(np.array([[0, 0, 0], [0, 0, -1]], dtype=np.int32), 4, axis=0)
    tile.tangential = np.zeros((8, 3))
    write_h5(folder / "tile.h5", tile)
    bed = tile.repeated((1, 1, high))
    bed.cell = bed.corner = bed.shift = None
    write_h5(folder / "packing.h5", bed.take(np.arange(8, 56)))
    size = np.array([WIDE, WIDE, 2 * D * high])
    write_mesh(folder / "bar.h5", box(np.zeros(3), size, (1, 1, high)))
    (folder / "coupled.nml").write_text(COUPLED.replace("MORE", more))
    (folder / "grains.nml").write_text(GRAINS.replace("COPIES", str(high)))
    (folder / "solid.nml").write_text(SOLID)


def fly(folder: Path) -> float:
    """Let a written column fly at 1 m/s, a solid of the grains' mass too; return a grain's mass."""
    packing = read_packing(folder / "packing.h5")
    packing.v = np.tile([0.0, 0.0, 1.0], (len(packing.x), 1))
    write_h5(folder / "packing.h5", packing)
    mass = 2650.0 * np.pi / 6.0 * (2.0 * packing.axes[:, 0]).mean() ** 3
    text = (folder / "solid.nml").read_text()
    text = text.replace("1388.0", repr(float(8 * mass / (WIDE**2 * 2.0 * D))))
    lines = [line for line in text.splitlines() if not line.startswith("&support")]
    text = "\n".join(lines) + "\n&initial group = 'all', component = 'z', value = 1.0 /\n"
    (folder / "solid.nml").write_text(text)
    return float(mass)
