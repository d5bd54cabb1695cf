"""Turn the deck.toml files into Fortran key tables and the deck reference of the manual.

Usage: keys.py            write the tables that have changed
       keys.py --check    say whether the tables are up to date (exit 1 if not)
       keys.py --docs DIR write deck-dem.md, deck-fem.md, deck-couple.md
The format of deck.toml is described at the top of common/deck.toml. Standard library only.
"""

import argparse
import sys
from pathlib import Path

from deck_definitions import PROGRAMS, ROOT, Faults, Program, load, read_group, read_program
from deck_reference import page
from deck_tables import fortran

TABLES = {  # the Fortran table of a program
    "dem": "setup/dem_deck_keys.f90",
    "fem": "setup/fem_deck_keys.f90",
    "couple": "run/cpl_deck_keys.f90",
}


def main() -> int:
    """Write or check the tables, or write the reference; return 1 for any fault."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", action="store_true", help="only say whether the tables are up to date"
    )
    parser.add_argument("--docs", type=Path, metavar="DIR", help="write the deck reference there")
    options = parser.parse_args()
    faults = Faults()
    common = load(ROOT / "common/deck.toml", faults)
    for name, entry in common.items():
        read_group(name, entry, True, f"common/deck.toml: {name}", faults)
    programs = []
    for folder in PROGRAMS if not faults.lines else []:
        own = Faults()  # a fault in one folder does not hold up the others
        program = read_program(folder, common, own)
        if program and not own.lines:
            programs.append(program)
        faults.lines += own.lines
    if faults.lines:
        print("\n".join(f"keys: {line}" for line in faults.lines), file=sys.stderr)
    stale = 0
    if options.docs:
        write_pages(programs, options.docs)
    else:
        stale = write_tables(programs, options.check)
    return 1 if faults.lines or stale else 0


def write_pages(programs: list[Program], folder: Path) -> None:
    """Write the deck reference, one page a program."""
    folder.mkdir(parents=True, exist_ok=True)
    for program in programs:
        path = folder / f"deck-{program.folder}.md"
        path.write_text(page(program), encoding="utf-8")


def write_tables(programs: list[Program], only_check: bool) -> int:
    """Write the tables that have changed; with only_check return how many would be."""
    stale = 0
    for program in programs:
        path = ROOT / program.folder / TABLES[program.folder]
        text = fortran(program)
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        stale += 1
        outcome = "is out of date: run make keys" if only_check else "written"
        print(f"keys: {path.relative_to(ROOT)} {outcome}")
        if not only_check:
            path.write_text(text, encoding="utf-8")
    if only_check:
        print(f"{len(programs) - stale} passed, {stale} failed")
    return stale if only_check else 0


if __name__ == "__main__":
    sys.exit(main())
