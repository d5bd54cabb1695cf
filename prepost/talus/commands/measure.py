"""`talus measure`: a packing, regions of a deck by talus-dem, strength and secants of tests."""

import argparse
import json
import subprocess
from dataclasses import asdict
from pathlib import Path

from talus import measure as measures
from talus import secant, strength
from talus.arguments import counting
from talus.faults import FaultError
from talus.fields import read_grains
from talus.programs import find_program
from talus.progress import watch
from talus.specimens import read_test

LAYERS = 5  # of the solid fraction
PER_CENT = 100.0


def register(commands: argparse._SubParsersAction) -> None:
    """Add `measure`."""
    new = commands.add_parser("measure", help="solid fraction, coordination, fabric of a packing")
    new.add_argument(
        "source", type=Path, nargs="+", help="packing, or field file of grains; histories of tests"
    )
    new.add_argument("--step", type=int, default=-1, help="of a field file, negative from the end")
    new.add_argument("--layers", type=counting, default=LAYERS, help="layers of the solid fraction")
    new.add_argument("--deck", type=Path, help="grains' deck: its &measure and &grid by talus-dem")
    new.add_argument("-o", "--output", type=Path, help="with --deck, --strength: folder of results")
    new.add_argument(
        "--strength", action="store_true",
        help="fit a cone of Drucker and Prager to tests: *_walls.csv, *_cell.csv",
    )  # fmt: skip
    new.add_argument("--cone", choices=list(strength.CONES), default="compression",
                     help="where the cone meets Mohr and Coulomb's, as in talus-fem")  # fmt: skip
    new.add_argument("--secant", type=float, nargs="+", metavar="STRAIN",
                     help="secant modulus and Poisson's ratio to strains [-] of one *_walls.csv, "
                     "*_cell.csv or *_point.csv, and to half the strength")  # fmt: skip
    new.add_argument("--beside", type=float, nargs=3, metavar=("VOLUME", "AREA", "RADIUS"),
                     help="the same to the strain that a displaced volume [m3] makes at a radius "
                     "[m] if it leaves through an area [m2]")  # fmt: skip
    new.add_argument("--axis", choices="xyz", default="z", help="that is shortened, for --secant")
    new.add_argument("--json", action="store_true")
    new.set_defaults(run=measure)


def measure(options: argparse.Namespace) -> int:
    """Print the measures of the bulk, three mean radii away from walls and surface.

    With a deck, talus-dem measures every step of the field file in the regions of the deck.
    """
    if options.strength:
        return measure_strength(options)
    if options.secant or options.beside:
        return measure_secant(options)
    if len(options.source) > 1:
        raise FaultError("E557", "one file is measured at a time", "several only with --strength")
    options.source = options.source[0]
    if options.deck:
        return measure_by_deck(options)
    packing, force = read_grains(options.source, options.step)
    facts = measures.describe(packing, options.layers, watch, force)
    if options.json:
        print(json.dumps(facts))
        return 0
    for name, value in facts.items():
        print(f"{name:28s} {value:12.6g}")
    return 0


def measure_strength(options: argparse.Namespace) -> int:
    """Fit friction, dilation and cohesion to tests; write strength.json and strength.png."""
    from talus.look import save_figure

    if options.deck or options.layers != LAYERS or options.step != -1:
        raise FaultError("E557", "--strength reads histories of tests", "only --cone, -o, --json")
    tests = [strength.read_loading(path) for path in options.source]
    found = strength.fit_states(tests, options.cone)
    folder = options.output or Path()
    strength.write_json(folder / "strength.json", found)
    if options.json:
        print((folder / "strength.json").read_text(), end="")
    else:
        print(f"{'':10s}{'friction':>10s}{'dilation':>10s}{'cohesion':>12s}{'scatter':>10s}")
        for state, (cone, _) in found.items():
            print(f"{state:10s}{cone.friction_deg:6.1f} deg{cone.dilation_deg:6.1f} deg"
                  f"{cone.cohesion_Pa:9.4g} Pa{PER_CENT * cone.scatter:8.1f} %")  # fmt: skip
    save_figure(strength.figure(tests, found), folder / "strength.png")
    if not options.json:
        print(folder / "strength.json", folder / "strength.png", sep="\n")
    return 0


def measure_secant(options: argparse.Namespace) -> int:
    """Print secants of a test: to given strains, to that beside a body, to half the strength."""
    if options.deck or len(options.source) > 1:
        raise FaultError("E557", "--secant and --beside read one test",
                         "only --axis and --json go with them")  # fmt: skip
    test = read_test(options.source[0], options.axis)
    strains = list(options.secant or [])
    if options.beside:
        strains.append(secant.strain_beside(*options.beside))
    strains.append(secant.strain_to(test, 0.5))
    found = [secant.secant_at(test, strain) for strain in strains]
    if options.json:
        print(json.dumps([asdict(one) for one in found]))
        return 0
    print(f"{'strain [%]':>10s} {'young [Pa]':>12s} {'poisson':>8s} {'of strength':>12s}")
    for one in found:
        print(f"{PER_CENT * one.strain:10.4g} {one.young_Pa:12.6g} {one.poisson:8.4f} "
              f"{one.of_strength:12.4f}")  # fmt: skip
    return 0


def measure_by_deck(options: argparse.Namespace) -> int:
    """Have talus-dem measure; it prints the names of the files and its own faults."""
    if options.json or options.layers != LAYERS or options.step != -1:
        raise FaultError("E557", "--deck measures every step, in the regions of the deck",
                         "leave --json, --layers and --step out")  # fmt: skip
    words = [str(find_program("talus-dem")), str(options.deck), f"--measure={options.source}"]
    words += [f"--output={options.output}"] if options.output else []
    return subprocess.run(words, check=False).returncode
