"""The command `talus`: one sub-command a job, each in its own module."""

import os
import sys
from importlib import import_module

from talus import version
from talus.arguments import Parser
from talus.faults import FaultError

COMMANDS = (
    "pack", "mesh", "check", "plot", "render", "convert", "report", "measure", "compare",
    "checksum", "fit", "port-test", "explain", "doctor", "study", "view", "new", "completion",
    "schema", "watch",
)  # fmt: skip


def build_parser(wanted: tuple[str, ...] = COMMANDS) -> Parser:
    """Return the parser with the sub-commands wanted, all of them if not said.

    Modules of the others are not loaded: some need half a second for their plots.
    """
    parser = Parser(prog="talus", description="Prepare and evaluate Talus runs.")
    parser.add_argument("--version", action="version", version=f"talus {version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    for name in wanted:
        import_module(f"talus.commands.{name.replace('-', '_')}").register(commands)
    return parser


def needed(words: list[str]) -> tuple[str, ...]:
    """Return the sub-commands that a command line needs: its own, none for --version, or all."""
    first = words[0] if words else ""
    if first == "--version":
        return ()
    return (first,) if first in COMMANDS else COMMANDS


def main(arguments: list[str] | None = None) -> int:
    """Run one sub-command; return the exit code."""
    try:
        words = sys.argv[1:] if arguments is None else arguments
        options = build_parser(needed(words)).parse_args(words)
        return int(options.run(options) or 0)
    except FaultError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    except BrokenPipeError:  # the reader of a pipe left (talus ... | head)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as fault:
        where = f"{fault.filename}: " if fault.filename else ""
        print(FaultError("E501", f"{where}{fault.strerror or fault}"), file=sys.stderr)
        return 4
    except KeyboardInterrupt:
        print("talus: stopped", file=sys.stderr)
        return 3
