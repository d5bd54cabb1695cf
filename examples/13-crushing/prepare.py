"""Write a loose bed of spheres in a box that is periodic to the sides.

Usage: prepare.py, in the folder of the run; loose.h5 and the decks with their words filled in.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.packing import write_h5
from talus.verification import read_history

COUNT, RADIUS, SPREAD, SIDE, LOOSE = 400, 1.0e-3, 0.1, 14.0e-3, 0.28


def fill(name: str, height: float) -> None:
    """Give a deck the height of its upper plate."""
    path = Path(f"{name}.nml")
    path.write_text(path.read_text().replace("HEIGHT", f"{height:.9e}"))


def main(stage: str) -> None:
    """Write what a stage needs."""
    if stage == "loose":
        sizes = RADIUS * uniform_sizes(COUNT, SPREAD, np.random.default_rng(1))
        height = 4.0 / 3.0 * np.pi * (sizes**3).sum() / (LOOSE * SIDE**2)
        write_h5(Path("loose.h5"), cloud(sizes, np.array([SIDE, SIDE, height]), np.ones(3), seed=1))
        fill("settle", height)
    else:
        walls = read_history(Path("settle_walls.csv"))
        fill("crush", walls["z"][walls["wall"] == 2][-1])


main(sys.argv[1])
