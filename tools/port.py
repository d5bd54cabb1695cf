"""Turn common/port/port.toml into Fortran, C and Python names and the tables of manual/port.md.

Usage: port.py            write what has changed
       port.py --check    say whether all is up to date, and which Fortran file types a name of a
                          field by hand (exit 1 if any does)
The format of port.toml is described at its top. Standard library only.
"""

import argparse
import re
import sys
import tomllib

from port_clients import c_header, python_messages, python_module
from port_definition import ROOT, SOURCE, faults_of
from port_fortran import fortran_names, fortran_scalars, fortran_verbs
from port_tables import manual_page

HAND = re.compile(
    r"(?:request|reply|ask)%(?:put|get|take|put_int|get_int|take_int|put_text|get_text|has)"
    r"\((?:[\w%()]+//)?'(?!\.')[^']"
)


def hand_typed() -> list[str]:
    """Return the places where Fortran code types the name of a field by hand."""
    found = []
    for part in ("common", "dem", "fem", "couple"):
        for path in sorted((ROOT / part).rglob("*.f90")):
            for number, line in enumerate(path.read_text().splitlines(), 1):
                if HAND.search(line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    return found


def main() -> int:
    """Write or check all that follows from port.toml; return 1 when something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    port = tomllib.loads(SOURCE.read_text(encoding="utf-8"))
    faults = faults_of(port)
    manual = ROOT / "manual/port.md"
    made = {} if faults else {
        ROOT / "common/port/talus_verbs.f90": fortran_verbs(port),
        ROOT / "common/port/talus_scalars.f90": fortran_scalars(port),
        ROOT / "common/port/talus_port_names.f90": fortran_names(port),
        ROOT / "common/port/talus_port_names.h": c_header(port),
        ROOT / "prepost/talus/port_names.py": python_module(port),
        ROOT / "prepost/talus/port_messages.py": python_messages(port),
        manual: manual_page(port, manual.read_text(encoding="utf-8"), faults),
    }  # fmt: skip
    for path, text in made.items():
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if options.check:
            faults.append(f"{path.relative_to(ROOT)} is out of date: run `make port`")
        else:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
    if options.check:
        faults += [f"{place} (take the name from talus_port_names)" for place in hand_typed()]
    print("\n".join(f"port.toml: {fault}" for fault in faults), end="\n" if faults else "")
    if options.check:
        print(f"{max(1, len(made)) - min(len(made), len(faults))} passed, {len(faults)} failed")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
