"""`talus report`: one HTML page on the runs of a folder."""

import argparse
from pathlib import Path

from talus import report_compare, reports
from talus.files import make_folder, write_text_file


def register(commands: argparse._SubParsersAction) -> None:
    """Add `report`."""
    new = commands.add_parser("report", help="one HTML page on the runs of a folder, or on several")
    new.add_argument("folder", type=Path, nargs="+", help="a folder, or several to compare")
    new.add_argument("--title", default="")
    new.add_argument("-o", "--output", type=Path, default=Path("report.html"))
    new.set_defaults(run=report)


def report(options: argparse.Namespace) -> int:
    """Write the page and say its name."""
    if len(options.folder) > 1:
        page = report_compare.build(options.folder, options.title)
    else:
        page = reports.build(options.folder[0], options.title)
    make_folder(options.output.parent)
    write_text_file(options.output, page)
    print(options.output)
    return 0
