"""`talus measure`: a packing looked at quickly, or regions and grids of a deck by talus-dem."""

import argparse
import json
import subprocess
from pathlib import Path

from talus import measure as measures
from talus.arguments import counting
from talus.faults import FaultError
from talus.fields import read_grains
from talus.programs import find_program
from talus.progress import watch

LAYERS = 5  # of the solid fraction


def register(commands: argparse._SubParsersAction) -> None:
    """Add `measure`."""
    new = commands.add_parser("measure", help="solid fraction, coordination, fabric of a packing")
    new.add_argument("source", type=Path, help="packing, or field file of grains")
    new.add_argument("--step", type=int, default=-1, help="of a field file, negative from the end")
    new.add_argument("--layers", type=counting, default=LAYERS, help="layers of the solid fraction")
    new.add_argument("--deck", type=Path, help="grains' deck: its &measure and &grid by talus-dem")
    new.add_argument("-o", "--output", type=Path, help="with --deck: folder of the results")
    new.add_argument("--json", action="store_true")
    new.set_defaults(run=measure)


def measure(options: argparse.Namespace) -> int:
    """Print the measures of the bulk, three mean radii away from walls and surface.

    With a deck, talus-dem measures every step of the field file in the regions of the deck.
    """
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


def measure_by_deck(options: argparse.Namespace) -> int:
    """Have talus-dem measure; it prints the names of the files and its own faults."""
    if options.json or options.layers != LAYERS or options.step != -1:
        raise FaultError("E557", "--deck measures every step, in the regions of the deck",
                         "leave --json, --layers and --step out")  # fmt: skip
    words = [str(find_program("talus-dem")), str(options.deck), f"--measure={options.source}"]
    words += [f"--output={options.output}"] if options.output else []
    return subprocess.run(words, check=False).returncode
