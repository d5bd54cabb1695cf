"""`talus measure`: solid fraction, coordination, height, fabric and screening of a packing."""

import argparse
import json
from pathlib import Path

from talus import measure as measures
from talus.arguments import counting
from talus.fields import read_grains
from talus.progress import watch


def register(commands: argparse._SubParsersAction) -> None:
    """Add `measure`."""
    new = commands.add_parser("measure", help="solid fraction, coordination, fabric of a packing")
    new.add_argument("source", type=Path, help="packing, or field file of grains")
    new.add_argument("--step", type=int, default=-1, help="of a field file, negative from the end")
    new.add_argument("--layers", type=counting, default=5, help="layers of the solid fraction")
    new.add_argument("--json", action="store_true")
    new.set_defaults(run=measure)


def measure(options: argparse.Namespace) -> int:
    """Print the measures of the bulk, three mean radii away from walls and surface."""
    packing, force = read_grains(options.source, options.step)
    facts = measures.describe(packing, options.layers, watch, force)
    if options.json:
        print(json.dumps(facts))
        return 0
    for name, value in facts.items():
        print(f"{name:28s} {value:12.6g}")
    return 0
