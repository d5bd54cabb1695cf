"""Cloud, block and deck of a bed that goes quick.

Usage: prepare.py cloud, or prepare.py deck after the bed has settled; in the folder of the run.
"""

import sys
from pathlib import Path

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.packing import read_h5, write_h5

RADIUS, SPREAD, COUNT = 0.48e-3, 0.04, 1500
BOX = np.array([0.015, 0.009, 0.021])  # [m]
BLOCK = np.array([5.0e-3, 4.0e-3, 4.0e-3])  # [m]
GRAVITY, SOLID, LIQUID = 9.81, 2650.0, 1000.0


def write_block(low: np.ndarray) -> None:
    """Write the triangles of a block, normals outwards."""
    x = [low + BLOCK * [i >> k & 1 for k in range(3)] for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    lines = ["solid block"]
    for face in faces:
        for k in (1, 2):
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {:.9g} {:.9g} {:.9g}".format(*x[face[c]]) for c in (0, k, k + 1)]
            lines += ["endloop", "endfacet"]
    Path("block.stl").write_text("\n".join([*lines, "endsolid block"]) + "\n")


def buoyant_weight() -> float:
    """Return the buoyant weight of the bed over the area of the floor [Pa]."""
    volume = 4.0 / 3.0 * np.pi * read_h5(Path("bed.h5")).axes.prod(1).sum()
    return float(volume * (SOLID - LIQUID) * GRAVITY / BOX[:2].prod())


def write_deck() -> None:
    """Put the block on the bed."""
    bed = read_h5(Path("bed.h5"))
    centre = 0.5 * BOX[:2]
    below = (np.abs(bed.x[:, :2] - centre) < 0.5 * BLOCK[:2] + RADIUS).all(1)
    top = float((bed.x[below, 2] + bed.axes[below, 2]).max())
    write_block(np.array([*(centre - 0.5 * BLOCK[:2]), top + 2.0e-5]))
    text = (Path(__file__).parent / "quick.nml").read_text()
    Path("quick.nml").write_text(text.replace("@critical@", f"{buoyant_weight():.6g}"))


def write_cloud() -> None:
    """Write spheres that do not touch, in a tall box."""
    sizes = uniform_sizes(COUNT, SPREAD, np.random.default_rng(1))
    tall = np.array([*BOX[:2], 2.0 * BOX[2]])
    write_h5(Path("cloud.h5"), cloud(sizes, tall, np.full(3, RADIUS), 1))


if __name__ == "__main__":
    {"cloud": write_cloud, "deck": write_deck}[sys.argv[1]]()
