"""Critical states of spheres and dumbbells, as clumps, under simple shear at constant pressure."""

import argparse

import numpy as np
from sheared_bodies import Shear, judge_kind

from talus.clumps import Template, mass_of
from talus.commands.pack_clump import cloud_of_clumps
from talus.packing import Packing
from talus.verification import Case

COUNT, BOX, RADIUS, SEED = 200, 16.5e-3, 1.0e-3, 7
SHEAR = Shear(rate=2.0, end=2.0, plateau=1.0)
RATIO = 0.382  # published for spheres with a friction of 0.5, see periodic_shear
APART = 1.2  # of the spheres of a dumbbell, in their radii


def templates() -> dict[str, Template]:
    """Return a sphere and a dumbbell of the same volume."""
    unit = mass_of(np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * APART, np.ones(2))[0]
    small = RADIUS * (4.0 / 3.0 * np.pi / unit) ** (1.0 / 3.0)
    return {
        "spheres": Template(np.zeros((1, 3)), np.array([RADIUS])),
        "dumbbells": Template(small * APART * np.array([[-0.5, 0, 0], [0.5, 0, 0]]),
                              np.full(2, small)),
    }  # fmt: skip


def cloud(case: Case, name: str, template: Template) -> Packing:
    """Return a cloud of clumps in a periodic cell."""
    rows = [*zip(*template.centre.T, template.radius, strict=True)]
    table = case.folder / f"{name}.txt"
    table.write_text("\n".join(" ".join(repr(float(v)) for v in row) for row in rows) + "\n")
    none = dict.fromkeys(("axes", "shapes", "gradation", "sieves", "distribution"))
    options = argparse.Namespace(clumps=table, count=COUNT, spread=0.0, seed=SEED, periodic=True,
                                 box=[1.15 * BOX] * 3, **none)  # fmt: skip
    return cloud_of_clumps(options)


def run(case: Case) -> None:
    """Judge strength, work, symmetry and momentum of both; plot."""
    fig, axis = case.figure()
    found = {
        name: judge_kind(case, name, cloud(case, name, template), SHEAR, axis)
        for name, template in templates().items()
    }
    case.metric("stress ratio of spheres", found["spheres"], RATIO, 0.03, "plateau")
    case.above("stress ratio, dumbbells - spheres", found["dumbbells"] - found["spheres"], 0.05)
    axis.axhline(RATIO, color="0.5", lw=0.8, ls="--")
    axis.set(xlabel="shear [-]", ylabel="shear stress over pressure [-]")
    axis.legend()
    case.save(fig)
