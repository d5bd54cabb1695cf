"""`talus report`: one HTML page on the runs of a folder."""

import argparse
from pathlib import Path

from talus import reports
from talus.faults import FaultError


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
    try:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(page)
    except OSError as fault:
        raise FaultError("E501", f"cannot write {options.output}: {fault}", exit_code=4) from fault
    print(options.output)
    return 0
