"""Find the solvers, and which one a deck is for."""

import os
import re
import shutil
from pathlib import Path

from talus.faults import FaultError

OF_COUPLE, OF_GRAINS, OF_SOLID = (
    {"program", "facets", "clock"},
    {"particles", "contact"},
    {"mesh", "section"},
)


def find_program(name: str) -> Path:
    """Path of a solver: in TALUS_BIN if set, else in build/bin of the checkout or on PATH."""
    if folder := os.environ.get("TALUS_BIN"):
        if (Path(folder) / name).is_file():
            return Path(folder) / name
        text = f"{name} is not in {folder}, which TALUS_BIN names"
        raise FaultError("E530", text, "build it (make) or set TALUS_BIN", exit_code=4)
    places = [folder / "build/bin" for folder in Path(__file__).resolve().parents]
    for place in places:
        if (place / name).is_file():
            return place / name
    if found := shutil.which(name):
        return Path(found)
    raise FaultError(
        "E530", f"{name} was not found", "build it (make) or set TALUS_BIN", exit_code=4
    )


def program_of(deck: Path) -> str:
    """Name of the solver that a deck is for, by its groups."""
    try:
        text = deck.read_text(errors="replace")
    except OSError as fault:
        raise FaultError("E531", f"cannot read {deck}: {fault.strerror}") from fault
    groups = {name.lower() for name in re.findall(r"^\s*&(\w+)", text, flags=re.M)}
    for name, own in (
        ("talus-couple", OF_COUPLE),
        ("talus-dem", OF_GRAINS),
        ("talus-fem", OF_SOLID),
    ):
        if groups & own:
            return name
    raise FaultError("E532", f"{deck} is no known deck of Talus", "name the program with --program")
