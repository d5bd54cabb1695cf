"""`talus view`: one HTML page with a run in three dimensions."""

import argparse
from pathlib import Path

from talus import view
from talus.arguments import counting


def register(commands: argparse._SubParsersAction) -> None:
    """Add `view`."""
    new = commands.add_parser("view", help="one HTML page with a run in 3-D, for any browser")
    new.add_argument(
        "folder",
        metavar="RUN",
        type=Path,
        help="folder of a run, or a field file of grains or solid",
    )
    new.add_argument("--solid", type=Path, help="field file of the solid")
    new.add_argument("--frames", type=counting, default=20, help="most steps in the page")
    new.add_argument("--title", default="")
    new.add_argument("-o", "--output", type=Path, default=Path("view.html"))
    new.set_defaults(run=work)


def work(options: argparse.Namespace) -> int:
    """Write the page and print its name."""
    view.write(options.folder, options.solid, options.output, options.frames, options.title)
    print(options.output)
    return 0
