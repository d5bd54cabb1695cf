"""`talus pack tile`: grains at rest in a periodic cell, at a stress, a density and an edge."""

import argparse
from pathlib import Path

import numpy as np

from talus import generate
from talus.arguments import counting, number, positive, share
from talus.commands.pack_cloud import axes_option, cloud_of, cloud_options, grains_of, report
from talus.faults import FaultError
from talus.forms import Forms, bounding_radii
from talus.tile import Wanted, box_of, make_tile
from talus.tile_stamp import write_tile

BOUNDS = {"poisson": (-1.0, 0.5), "friction": (0.0, 10.0), "making_friction": (0.0, 10.0)}


def register(new: argparse.ArgumentParser) -> None:
    """Add the options of a tile."""
    cloud_options(new)
    axes_option(new, "--aspect", "ratio of the three edges", default=(1.0, 1.0, 1.0))
    stress = new.add_mutually_exclusive_group(required=True)
    stress.add_argument(
        "--stress", type=positive, help="normal stress [Pa], in all directions the same"
    )
    stress.add_argument(
        "--stresses", type=positive, nargs=3, metavar="P",
        help="normal stresses xx, yy, zz [Pa]; the edges then have a ratio of their own",
    )  # fmt: skip
    new.add_argument(
        "--mean-only", action="store_true", help="hold the mean of the normal stresses, not each"
    )
    dense = new.add_mutually_exclusive_group(required=True)
    dense.add_argument(
        "--solid-fraction", type=share, help="of the tile; the friction of making is searched"
    )
    dense.add_argument(
        "--making-friction", type=number, help="friction while the cloud is pressed, as it is"
    )
    new.add_argument("--tolerance", type=positive, default=3.0e-3, help="of the solid fraction")
    new.add_argument("--trials", type=counting, default=12, help="frictions to try at most")
    new.add_argument("--friction", type=number, default=0.5, help="of the grains")
    new.add_argument("--density", type=positive, default=2650.0, help="of the solid [kg/m3]")
    new.add_argument("--young", type=positive, default=29.0e9, help="of the solid [Pa]")
    new.add_argument("--poisson", type=number, default=0.25)
    new.add_argument(
        "--edge", type=positive, help="first edge [m]: grains and edges are scaled alike to it"
    )
    new.add_argument(
        "--least-edges", type=positive, default=9.0, metavar="D",
        help="least width of the tile in mean diameters (9)",
    )  # fmt: skip
    new.add_argument(
        "--work", type=Path, metavar="FOLDER",
        help="folder of the stages, beside the tile by default; what has finished there is kept",
    )  # fmt: skip


def tile(options: argparse.Namespace) -> int:
    """Make a tile and say what it is."""
    for name, (low, high) in BOUNDS.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            word = "--" + name.replace("_", "-")
            raise FaultError("E500", f"{word} {value:g} is not from {low:g} to {high:g}")
    if options.output.suffix != ".h5":
        raise FaultError("E516", f"{options.output}: a tile holds contacts", "name it NAME.h5")
    forms, sizes, curve = grains_of(options)
    box = box_of(spheres_of(forms, sizes), np.array(options.aspect))
    cloud = cloud_of(options, forms, sizes, box, periodic=True)
    if curve is not None:
        generate.check_gradation(cloud, *curve)
    if options.mean_only and options.stresses is not None:
        raise FaultError("E500", "--mean-only and --stresses exclude each other")
    mean = options.stress or float(np.mean(options.stresses))
    wanted = Wanted(
        mean, options.friction, options.density, options.young, options.poisson,
        options.solid_fraction, options.making_friction, options.tolerance, options.trials,
        options.edge, options.least_edges, options.stresses, not options.mean_only,
    )  # fmt: skip
    work = options.work or options.output.with_name(f"{options.output.stem}_stages")
    say = (lambda text: None) if options.json else (lambda text: print(text, flush=True))
    made, stamp = make_tile(cloud, wanted, work, say)
    facts = {
        "solid fraction": stamp.solid_fraction,
        "coordination number": stamp.coordination,
        "friction of making": stamp.making_friction,
        "mean stress [Pa]": float(np.trace(stamp.stress) / 3.0),
        "normal stresses over the mean": normal_parts(stamp.stress),
        "anisotropy of the stress": stamp.anisotropy,
        "edge [m]": float(made.cell[0, 0]),
        "ratio of the edges": [float(e) for e in made.cell.diagonal() / made.cell[0, 0]],
        "edges in mean diameters": float(made.cell.diagonal().min() / stamp.mean_diameter),
    }
    write_tile(options.output, made, stamp)
    return report(options, made, facts)


def normal_parts(stress: np.ndarray) -> list[float]:
    """Return the normal stresses of a stress (3, 3) over their mean."""
    return [float(part) for part in np.diag(stress) / (np.trace(stress) / 3.0)]


def spheres_of(forms: Forms, sizes: np.ndarray) -> float:
    """Volume of the bounding spheres of grains of these forms and sizes, about [m3]."""
    radius = bounding_radii(forms)
    weight = forms.weight if forms.weight is not None else np.ones(len(radius))
    return float(4.0 / 3.0 * np.pi * np.average(radius**3, weights=weight) * (sizes**3).sum())
