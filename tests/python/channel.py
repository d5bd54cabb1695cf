"""A channel of grains between smooth sides: decks, and a tile of it that is periodic along x."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.packing import write_h5

LENGTH, WIDTH, COUNT = 0.032, 0.012, 120  # of the tile [m]
HEAD = f"""&run       title = 'Channel', t_end = T_END, gravity = 0.0, 0.0, -9.81 /
&material  id = 'grain', density = 2500.0, young = 1.0e8, poisson = 0.25 /
&material  id = 'smooth', density = 2500.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'grain', 'grain', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.3 /
&contact   between = 'grain', 'smooth', law = 'hertz_mindlin', friction = 0.0 /
&particles file = 'PACKING.h5', material = 'grain' /
&wall      id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'smooth' /
&wall      id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'smooth' /
&wall      id = 'y1', point = 0.0, {WIDTH}, 0.0, normal = 0.0, -1.0, 0.0, material = 'smooth' /
"""
CELL = (
    f"&cell size = {LENGTH}, {WIDTH + 2e-3}, 0.3, origin = 0.0, -1.0e-3, -0.1, periodic = 'a' /\n"
)
REST = """&relaxation damping = 'adaptive', dt_factor = 0.2 /
&equilibrium unbalanced = 1.0e-8, energy_ratio = 1.0e-14, check_every = 200 /
"""


def make_tile(folder: Path, run: Callable[..., object]) -> None:
    """Write tile.h5, at rest; `run` takes folder, name, packing, end and further groups."""
    sizes = uniform_sizes(COUNT, 0.1, np.random.default_rng(1))
    box = np.array([LENGTH, WIDTH, 0.06])
    write_h5(folder / "cloud.h5", cloud(sizes, box, np.full(3, 2.0e-3), seed=1))
    soft = "&dynamics dt_factor = 0.3, damping = 2.0 /\n"
    soft += "&output every_time = 9.0, packing = 'soft.h5' /\n"
    run(folder, "settle", "cloud", 0.4, CELL, soft)
    end = "&output every_time = 9.0, packing = 'tile.h5' /\n"
    run(folder, "rest", "soft", 3.0, CELL, REST, end)
