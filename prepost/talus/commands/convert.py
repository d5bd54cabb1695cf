"""`talus convert`: a field file to a VTU series with a .pvd."""

import argparse
from pathlib import Path

from talus.fields import convert_to_vtu
from talus.progress import watch


def register(commands: argparse._SubParsersAction) -> None:
    """Add `convert`."""
    new = commands.add_parser("convert", help="field file to VTU series")
    new.add_argument("source", type=Path, help="field file (grains.h5, solid.h5)")
    new.add_argument(
        "-o", "--output", type=Path, required=True, help="folder, or name ending in .vtu"
    )
    new.set_defaults(run=convert)


def convert(options: argparse.Namespace) -> int:
    """Write the series and say its collection."""
    written = convert_to_vtu(options.source, options.output, watch)
    print(f"{written[-1]}: {len(written) - 1} steps")
    return 0
