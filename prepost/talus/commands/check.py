"""`talus check`: run the program's own check of a deck and show its faults."""

import argparse
import json
import subprocess
from pathlib import Path

from talus.faults import FaultError
from talus.programs import find_program, program_of


def register(commands: argparse._SubParsersAction) -> None:
    """Add `check`."""
    new = commands.add_parser("check", help="check decks, run nothing")
    new.add_argument("deck", type=Path, nargs="+")
    new.add_argument("--program", choices=["talus-dem", "talus-fem", "talus-couple"])
    new.set_defaults(run=check)


def text_of(error: dict) -> str:
    """Return a fault with its place, the line underlined, and the hint."""
    lines = [f"error {error['code']}: {error['message']}"]
    if error.get("place"):
        lines.append(f"  at {error['place']}")
    lines += error.get("source", "").splitlines()
    if error.get("hint"):
        lines.append(f"  hint: {error['hint']}")
    return "\n".join(lines)


def check(options: argparse.Namespace) -> int:
    """Show every fault of the decks; return the worst exit code of their programs."""
    return max([check_one(deck, options.program) for deck in options.deck])


def check_one(deck: Path, program: str | None) -> int:
    """Show every fault of a deck; return the program's exit code."""
    program = program or program_of(deck)
    done = subprocess.run(
        [str(find_program(program)), str(deck), "--check", "--json"],
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
        print(text_of(error))
    if result["errors"]:
        print(f"{deck}: {len(result['errors'])} fault{'s' * (len(result['errors']) > 1)}")
    else:
        print(f"{deck}: in order ({program})")
    return done.returncode
