"""Strength of spheres and rounded cubes under simple shear at constant pressure."""

import argparse

import numpy as np
from sheared_bodies import Shear, judge_kind

from talus.clumps import Template, weighed
from talus.commands.pack_clump import cloud_of_templates
from talus.polyhedra import named_points, rounded
from talus.verification import Case

COUNT, BOX, EDGE, ROUNDING, SEED = 48, 12.0e-3, 2.0e-3, 0.3, 7
SHEAR = Shear(rate=6.0, end=0.9, plateau=0.45)


def run(case: Case) -> None:
    """Judge strength, work, symmetry and momentum of both; plot."""
    cube = rounded(named_points(f"cube:{EDGE}"), ROUNDING)
    radius = float(np.cbrt(0.75 * weighed(cube)[0] / np.pi))
    kinds = {"spheres": Template(np.zeros((1, 3)), np.array([radius])), "cubes": cube}
    none = dict.fromkeys(("axes", "shapes", "gradation", "sieves", "distribution"))
    options = argparse.Namespace(
        count=COUNT, spread=0.0, seed=SEED, periodic=True, box=[1.15 * BOX] * 3, **none
    )
    fig, axis = case.figure()
    found = {
        name: judge_kind(case, name, cloud_of_templates(options, [body], name), SHEAR, axis)
        for name, body in kinds.items()
    }
    case.above("stress ratio, cubes - spheres", found["cubes"] - found["spheres"], 0.05)
    axis.set(xlabel="shear [-]", ylabel="shear stress over pressure [-]")
    axis.legend()
    case.save(fig)
