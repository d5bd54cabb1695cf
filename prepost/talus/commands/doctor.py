"""`talus doctor`: whether this machine has what Talus needs, and what to do where it has not."""

import argparse
from pathlib import Path

from talus import machine


def register(commands: argparse._SubParsersAction) -> None:
    """Add `doctor`."""
    new = commands.add_parser("doctor", help="check compiler, MPI, BLAS, memory, disk, versions")
    new.add_argument("folder", type=Path, nargs="?", default=Path("."), help="folder of results")
    new.set_defaults(run=doctor)


def doctor(options: argparse.Namespace) -> int:
    """Print each thing and what to do; return 1 if one of them is wrong."""
    findings = machine.look_at(options.folder)
    for name, seen, cure in findings:
        print(f"{'wrong' if cure else 'ok':6s} {name:14s} {seen}")
        if cure:
            print(f"{'':21s} do: {cure}")
    wrong = sum(bool(finding.cure) for finding in findings)
    print(f"{wrong} of {len(findings)} are wrong" if wrong else "all is well")
    return int(wrong > 0)
