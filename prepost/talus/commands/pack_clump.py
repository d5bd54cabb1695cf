"""`talus pack clump`, and clouds of clumps."""

import argparse
import json
from pathlib import Path

import numpy as np

from talus import generate
from talus.arguments import counting
from talus.clumps import Clumps, Template, reach_of, read_templates, rotation, weighed
from talus.commands.pack_cloud import plain, print_facts
from talus.faults import FaultError
from talus.files import write_text_file
from talus.packing import Packing, make_packing
from talus.polyhedra import named_points, rounded
from talus.progress import watch
from talus.sphere_fill import fidelity, fill, mass_of_body, read_body


def register(parser: argparse.ArgumentParser) -> None:
    """Add the options of `talus pack clump`."""
    parser.add_argument("body", type=Path, help="closed body of triangles, STL or OBJ [m]")
    parser.add_argument("--spheres", type=counting, default=10, help="at most so many")
    parser.add_argument(
        "--grid", type=counting, default=30, help="points along the longest side of the body"
    )
    parser.add_argument(
        "--grow", action="store_true", help="larger spheres, until their union has its volume"
    )
    parser.add_argument(
        "--body-mass", action="store_true", help="the clump has volume and inertia of the body"
    )


def clump(options: argparse.Namespace) -> int:
    """Fill a body with spheres and write them as a template."""
    triangles = read_body(options.body)
    template = fill(triangles, options.spheres, options.grid, options.grow)
    true = fidelity(template, triangles)
    lines = [f"# {true.spheres} spheres in {options.body.name}: x y z radius [m]", "template 1"]
    if options.body_mass:
        volume, middle, inertia = mass_of_body(triangles)
        rows = inertia[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
        lines.append("mass " + " ".join(repr(float(v)) for v in (volume, *middle, *rows)))
    for centre, radius in zip(template.centre, template.radius, strict=True):
        lines.append(" ".join(repr(float(value)) for value in (*centre, radius)))
    write_text_file(options.output, "\n".join(lines) + "\n")
    facts = {
        "spheres": true.spheres,
        "error of the volume": true.volume,
        "error of the centre, in radii of gyration": true.centre,
        "errors of the principal moments": true.inertia,
    }
    if options.json:
        print(json.dumps(plain({"file": str(options.output), **facts})))
    else:
        print(f"{options.output}:")
        print_facts(facts)
    return 0


def cloud_of_polyhedra(options: argparse.Namespace) -> Packing:
    """Return a random cloud of rounded polyhedra whose bounding spheres do not overlap."""
    bodies = [rounded(named_points(word), options.rounding) for word in options.polyhedra]
    return cloud_of_templates(options, bodies, "polyhedra")


def cloud_of_clumps(options: argparse.Namespace) -> Packing:
    """Return a random cloud of clumps whose bounding spheres do not overlap."""
    return cloud_of_templates(options, read_templates(options.clumps), "clumps")


def cloud_of_templates(
    options: argparse.Namespace, templates: list[Template], word: str
) -> Packing:
    """Return a cloud of bodies of some templates, drawn by weight; `word`: the option."""
    for name in ("axes", "shapes", "gradation", "sieves", "distribution"):
        if getattr(options, name) is not None:
            text = f"--{word} has sizes of its own, no --{name}"
            raise FaultError("E507", text, "--spread varies them")
    rng = np.random.default_rng(options.seed + 2)
    weight = np.array([t.weight for t in templates])
    kind = rng.choice(len(templates), size=options.count, p=weight / weight.sum())
    scale = generate.uniform_sizes(options.count, options.spread, rng)
    reach = scale * np.array([reach_of(t) for t in templates])[kind]
    spheres = generate.cloud(
        reach, np.array(options.box), np.ones(3), options.seed, watch=watch,
        periodic=options.periodic,
    )  # fmt: skip
    order = np.empty(options.count, int)
    order[np.argsort(spheres.axes[:, 0], kind="stable")] = np.argsort(reach, kind="stable")
    made = packing_of_clumps(templates, kind[order], scale[order], spheres.x, spheres.quat)
    made.cell, made.corner = spheres.cell, spheres.corner
    return made


def packing_of_clumps(
    templates: list[Template], kind: np.ndarray, scale: np.ndarray, x: np.ndarray, quat: np.ndarray
) -> Packing:
    """Return clumps with their centres of mass at x (n, 3) [m] as a packing, at rest."""
    middle = np.array([weighed(t)[1] for t in templates])
    count = np.array([len(t.radius) for t in templates])[kind]
    origin = [
        place - size * rotation(turn) @ middle[k]
        for place, size, turn, k in zip(x, scale, quat, kind, strict=True)
    ]
    first = 1 + np.concatenate([[0], np.cumsum(count)[:-1]])
    clumps = Clumps(templates, first, kind, scale, np.array(origin), quat)
    places, radii, rows = clumps.members()
    made = make_packing(places, np.tile(radii[:, None], 3), quat[rows])
    made.clumps = clumps
    return made
