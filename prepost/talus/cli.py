"""The command `talus`: one sub-command a job, each in its own module."""

import os
import sys

from talus import version
from talus.arguments import Parser
from talus.commands import (
    check,
    checksum,
    compare,
    completion,
    convert,
    doctor,
    explain,
    fit,
    measure,
    mesh,
    new,
    pack,
    plot,
    port_test,
    render,
    report,
    schema,
    study,
    view,
    watch,
)
from talus.faults import FaultError

MODULES = (
    pack, mesh, check, plot, render, convert, report, measure, compare, checksum, fit, port_test,
    explain, doctor, study, view, new, completion, schema, watch,
)  # fmt: skip


def build_parser() -> Parser:
    """Return the parser with all sub-commands."""
    parser = Parser(prog="talus", description="Prepare and evaluate Talus runs.")
    parser.add_argument("--version", action="version", version=f"talus {version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    for module in MODULES:
        module.register(commands)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run one sub-command; return the exit code."""
    try:
        options = build_parser().parse_args(arguments)
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
