"""Write beds of 5000 grains, periodic to the sides, and fill in decks.

Usage: beds.py loose SHAPE SEED, beds.py DECK NAME WORD=VALUE..., in the folder of the run.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import random_quaternions, uniform_sizes
from talus.packing import make_packing, write_h5
from talus.verification import read_history

HERE = Path(__file__).parent
COUNT, ACROSS, RADIUS, SPREAD, SIDE = 5000, 20, 1.0e-3, 0.1, 50.0e-3  # [m]
AXES = {"spheres": np.ones(3), "ellipsoids": np.array([1.25, 1.0, 0.8])}  # of volume 1
DEPOSITED = {"spheres": "10.2e-3", "ellipsoids": "12.9e-3"}  # [s]
PLATE = 2.5  # speed of compression [m/s]
SPEED = 0.5  # of grains of the loose bed, so that they forget their lattice [m/s]


def loose(shape: str, seed: int) -> float:
    """Write grains on a lattice, shaken off it; return the height of the bed [m]."""
    rng = np.random.default_rng(seed)
    sizes = RADIUS * rng.permutation(uniform_sizes(COUNT, SPREAD, rng))
    reach = RADIUS * (1.0 + SPREAD) * AXES[shape].max()
    pitch = np.array([SIDE / ACROSS, SIDE / ACROSS, 2.05 * reach])
    if shape == "ellipsoids":
        pitch[:2] = SIDE / 18
    across = int(round(SIDE / pitch[0]))
    place = np.array(list(np.ndindex(-(-COUNT // across**2), across, across)))[:COUNT, ::-1]
    free = pitch - 2.0 * reach
    x = (place + 0.5) * pitch + np.maximum(free, 0.0) * rng.uniform(-0.5, 0.5, (COUNT, 3))
    packing = make_packing(x, sizes[:, None] * AXES[shape], random_quaternions(rng, COUNT))
    packing.v = SPEED * rng.normal(size=(COUNT, 3))
    write_h5(Path("loose.h5"), packing)
    return float(x[:, 2].max() + reach)


def fill(deck: str, name: str, words: dict[str, str], more: str = "") -> None:
    """Write a deck of the example with its words filled in, and more behind it."""
    text = (HERE / f"{deck}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    Path(f"{name}.nml").write_text(text + more)


def main(what: str, *rest: str) -> None:
    """Write what a stage needs."""
    if what == "loose":
        height = loose(rest[0], int(rest[1]))
        fill("deposit", "deposit", {"HEIGHT": f"{height:.9e}", "@T_END@": DEPOSITED[rest[0]]})
    else:
        words = dict(word.split("=", 1) for word in rest[1:])
        walls = read_history(Path("deposit_walls.csv"))
        height = walls["z"][walls["wall"] == 2][-1]
        words |= {"HEIGHT": f"{height:.9e}", "@TIP@": f"{height + 5.0e-5:.5e}",
                  "@T_END@": f"{0.5 * height / PLATE:.6e}", "@SPEED@": f"{PLATE}"}  # fmt: skip
        fill(what, rest[0], words, words.pop("BREAKAGE", ""))


main(*sys.argv[1:])
