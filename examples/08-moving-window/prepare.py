"""Packings, mesh and decks of the bar in a bed that wakes before it.

Usage: prepare.py cloud, then prepare.py bed WAY once the tile is at rest; in the folder of the run.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.mesh import box, write_mesh
from talus.packing import FIXED, Packing, read_packing, write_h5

RADIUS, COUNT, LENGTH, WIDTH = 2.0e-3, 400, 0.04, 0.0133  # of grains, of a tile [m]
BAR, DEPTH, SPEED, PLACE = 5.0e-3, 0.022, 0.4, 0.15  # [m], below the surface, [m/s], [m]
AHEAD, HELD = 0.08, 8.0e-3  # opened ahead of the bar, depth of held ends [m]
LEAVE, DAMPING = "keep_behind = 0.045, hold_behind = 8.0e-3", 200.0  # damping [1/s]
CLOSE = "close_behind = 0.12, quiet_strain = 1.0e-3"
HEAD = "&run title = 'Bar in a bed', t_end = {:.9g}, gravity = 0.0, 0.0, -9.81 /\n"
SOFT = "&dynamics dt_factor = 0.3, damping = 2.0 /\n"
REST = """&relaxation damping = 'adaptive', dt_factor = 0.2 /
&equilibrium unbalanced = 1.0e-7, energy_ratio = 1.0e-12, check_every = 200 /
"""


def text(name: str, **values: object) -> str:
    """Return the text of a deck of the example with its values."""
    found = (Path(__file__).parent / f"{name}.nml").read_text()
    for key, value in values.items():
        found = found.replace(f"@{key}@", value if isinstance(value, str) else f"{value:.9g}")
    return found


def write(name: str, *parts: str) -> None:
    """Write a deck."""
    Path(f"{name}.nml").write_text("".join(parts))


def prepare_cloud() -> None:
    """Write the cloud of a tile and the decks that let it settle and come to rest."""
    sizes = uniform_sizes(COUNT, 0.1, np.random.default_rng(2))
    write_h5(Path("cloud.h5"), cloud(sizes, np.array([LENGTH, WIDTH, 0.12]), np.full(3, RADIUS),
                                     seed=2))  # fmt: skip
    write("settle", HEAD.format(0.6), text("laws", packing="cloud.h5"),
          text("cell", end="soft.h5"), SOFT)  # fmt: skip
    write("rest", HEAD.format(3.0), text("laws", packing="soft.h5"), text("cell", end="tile.h5"),
          REST)  # fmt: skip


def laid(tile: Packing, tiles: int, place: float, height: float) -> Packing:
    """Return tiles side by side without the grains where the bar stands."""
    bed = tile.repeated((tiles, 1, 1))
    bed.cell = bed.corner = bed.shift = None
    away = np.hypot(bed.x[:, 0] - place, bed.x[:, 2] - height)
    return bed.take(np.flatnonzero(away > BAR + bed.axes[:, 0]))


def prepare_bed(way: float) -> None:
    """Write the beds and their decks."""
    tile = read_packing(Path("tile.h5"))
    top = float(np.quantile(tile.x[:, 2], 0.97)) + RADIUS
    height, tiles = top - DEPTH, int(np.ceil((PLACE + way + 0.15) / LENGTH))
    bar = {"place": PLACE, "height": height, "frame": 0.1}
    end = way / SPEED
    whole = laid(tile, tiles, PLACE, height)
    whole.kind[(whole.x[:, 0] < HELD) | (whole.x[:, 0] > tiles * LENGTH - HELD)] = FIXED
    write_h5(Path("whole_bed.h5"), whole)
    write("whole", HEAD.format(end), text("laws", packing="whole_bed.h5"), text("bar", **bar),
          "&dynamics dt_factor = 0.3 /\n")  # fmt: skip
    middle = 1.5 * LENGTH
    write_h5(Path("held_bed.h5"), laid(tile, 3, middle, height))
    write("held", HEAD.format(end), text("laws", packing="held_bed.h5"),
          text("bar", **bar | {"place": middle}), "&dynamics dt_factor = 0.3 /\n",
          f"&window surface = 'bar', tile = 'tile.h5', behind = 0.04, ahead = 0.04, hold = {HELD}, "
          "moved = 9.0, every_time = 2.5e-3 /\n")  # fmt: skip
    awake = laid(tile, tiles, PLACE, height)
    near = np.abs(awake.x[:, 0] - PLACE) < AHEAD + LENGTH
    write_h5(Path("awake.h5"), awake.take(np.flatnonzero(near)))
    size = np.array([tiles * LENGTH, WIDTH, top])
    write_mesh(Path("bed_mesh.h5"), box(np.zeros(3), size, (4 * tiles, 1, 4)))
    write("grains", "&run title = 'Grains before a bar', gravity = 0.0, 0.0, -9.81 /\n",
          text("laws", packing="awake.h5"), text("bar", **bar), "&dynamics dt = 1.25e-5 /\n",
          f"&tile file = 'tile.h5', copies = {tiles}, 1, 1 /\n")  # fmt: skip
    grains = Path("grains.nml").read_text()
    coupled = text("coupled", t_end=end, place=PLACE, height=height)
    write("solid", text("solid"))
    write("coupled", coupled)
    write("grains_closed", grains)
    write("solid_closed", text("solid").replace("'explicit'", f"'explicit', rayleigh_mass = {DAMPING}"))
    for old, new in (("grains.nml", "grains_closed.nml"), ("solid.nml", "solid_closed.nml"),
                     (LEAVE, CLOSE)):  # fmt: skip
        coupled = coupled.replace(old, new)
    write("closed", coupled)


if __name__ == "__main__":
    if sys.argv[1] == "cloud":
        prepare_cloud()
    else:
        prepare_bed(float(sys.argv[2]))
