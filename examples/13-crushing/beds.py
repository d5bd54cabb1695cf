"""Write beds of 5000 or 1000 grains, periodic to the sides, and fill in decks.

Usage: beds.py loose SHAPE SEED [BED WORD=VALUE...], beds.py DECK NAME WORD=VALUE..., in the folder
of the run. A word is any text of the deck.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import random_quaternions, uniform_sizes
from talus.packing import make_packing, write_h5
from talus.verification import read_history

HERE = Path(__file__).parent
RADIUS, SPREAD = 1.0e-3, 0.1  # [m]
BEDS = {"wide": (5000, 20, 50.0e-3), "narrow": (1000, 9, 22.36e-3)}  # grains, of a row, side [m]
AXES = {"spheres": np.ones(3), "ellipsoids": np.array([1.25, 1.0, 0.8])}  # of volume 1
DEPOSITED = {"spheres": "10.2e-3", "ellipsoids": "12.9e-3"}  # [s]
PLATE, CLOSING = 2.5, 0.5  # speed of compression [m/s], part of the height
SPEED = 0.5  # of grains of the loose bed, so that they forget their lattice [m/s]


def loose(shape: str, seed: int, bed: str) -> float:
    """Write grains on a lattice, shaken off it; return the height of the bed [m]."""
    rng = np.random.default_rng(seed)
    count, of_a_row, side = BEDS[bed]
    sizes = RADIUS * rng.permutation(uniform_sizes(count, SPREAD, rng))
    reach = RADIUS * (1.0 + SPREAD) * AXES[shape].max()
    pitch = np.array([side / of_a_row, side / of_a_row, 2.05 * reach])
    if shape == "ellipsoids":
        pitch[:2] = side / 18
    across = int(round(side / pitch[0]))
    place = np.array(list(np.ndindex(-(-count // across**2), across, across)))[:count, ::-1]
    free = pitch - 2.0 * reach
    x = (place + 0.5) * pitch + np.maximum(free, 0.0) * rng.uniform(-0.5, 0.5, (count, 3))
    packing = make_packing(x, sizes[:, None] * AXES[shape], random_quaternions(rng, count))
    packing.v = SPEED * rng.normal(size=(count, 3))
    write_h5(Path("loose.h5"), packing)
    return float(x[:, 2].max() + reach)


def fill(deck: str, name: str, words: dict[str, str], more: str = "") -> None:
    """Write a deck of the example with its words filled in, and more behind it."""
    text = (HERE / f"{deck}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    Path(f"{name}.nml").write_text(text + more)


def pairs_of(words: tuple[str, ...]) -> dict[str, str]:
    """Return words and their values."""
    return dict(word.split("=", 1) for word in words)


def main(what: str, *rest: str) -> None:
    """Write what a stage needs."""
    if what == "loose":
        height = loose(rest[0], int(rest[1]), rest[2] if len(rest) > 2 else "wide")
        words = {"HEIGHT": f"{height:.9e}", "@T_END@": DEPOSITED[rest[0]]}
        fill("deposit", "deposit", words | pairs_of(rest[3:]))
    else:
        words = {"@SPEED@": f"{PLATE}", "CLOSING": f"{CLOSING}"} | pairs_of(rest[1:])
        walls = read_history(Path("deposit_walls.csv"))
        height = walls["z"][walls["wall"] == 2][-1]
        t_end = float(words.pop("CLOSING")) * height / float(words["@SPEED@"])
        words |= {"HEIGHT": f"{height:.9e}", "@TIP@": f"{height + 5.0e-5:.5e}",
                  "@T_END@": f"{t_end:.6e}"}  # fmt: skip
        fill(what, rest[0], words, words.pop("BREAKAGE", ""))


main(*sys.argv[1:])
