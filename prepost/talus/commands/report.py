"""`talus report`: one HTML page on the runs of a folder."""

import argparse
from pathlib import Path

from talus import reports
from talus.files import make_folder, write_text_file


def register(commands: argparse._SubParsersAction) -> None:
    """Add `report`."""
    new = commands.add_parser("report", help="one HTML page on the runs of a folder")
    new.add_argument("folder", type=Path)
    new.add_argument("--title", default="")
    new.add_argument("-o", "--output", type=Path, default=Path("report.html"))
    new.set_defaults(run=report)


def report(options: argparse.Namespace) -> int:
    """Write the page and say its name."""
    page = reports.build(options.folder, options.title)
    make_folder(options.output.parent)
    write_text_file(options.output, page)
    print(options.output)
    return 0
