"""`talus check`: run the program's own check of a deck and show its faults."""

import argparse
import json
import subprocess
from pathlib import Path

from talus.faults import FaultError
from talus.programs import find_program, program_of


def register(commands: argparse._SubParsersAction) -> None:
    """Add `check`."""
    new = commands.add_parser("check", help="check a deck, run nothing")
    new.add_argument("deck", type=Path)
    new.add_argument("--program", choices=["talus-dem", "talus-fem", "talus-couple"])
    new.set_defaults(run=check)


def check(options: argparse.Namespace) -> int:
    """Show every fault of the deck; return the program's exit code."""
    program = options.program or program_of(options.deck)
    done = subprocess.run(
        [str(find_program(program)), str(options.deck), "--check", "--json"],
        capture_output=True,
        text=True,
    )
    try:
        result = json.loads(done.stdout)
    except json.JSONDecodeError as fault:
        raise FaultError(
            "E533", f"{program} gave no readable answer", done.stderr.strip()[-300:], exit_code=4
        ) from fault
    for error in result["errors"]:
        print(
            FaultError(
                error["code"], error["message"], error.get("hint", ""), error.get("place", "")
            )
        )
    if result["errors"]:
        print(f"{options.deck}: {len(result['errors'])} faults")
    else:
        print(f"{options.deck}: in order ({program})")
    return done.returncode
