"""The command `talus`: one sub-command a job, each in its own module."""

import argparse
import sys

from talus import version
from talus.commands import check, compare, convert, mesh, pack, plot, render, report
from talus.faults import FaultError


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with all sub-commands."""
    parser = argparse.ArgumentParser(prog="talus", description="Prepare and evaluate Talus runs.")
    parser.add_argument("--version", action="version", version=f"talus {version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    for module in (pack, mesh, check, plot, render, convert, report, compare):
        module.register(commands)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run one sub-command; return the exit code."""
    options = build_parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except FaultError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    except KeyboardInterrupt:
        print("talus: stopped", file=sys.stderr)
        return 3
