"""Compare the error codes of the sources with those of errors.toml and of the tests.

Every code in the sources must be explained in errors.toml and the other way round; every code must
be expected by a test of tests/errors, tests/faults or tests/python, unless listed in UNTESTED.
"""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LISTS = {
    "common": ("common",),
    "dem": ("dem",),
    "fem": ("fem",),
    "couple": ("couple",),
    "libport": ("libport",),
    "prepost": ("prepost/talus",),
}
IN_FORTRAN = re.compile(r"'([DINSPBW]\d{3})'")
IN_C = re.compile(r'"([DINSPBW]\d{3})\b')
IN_PYTHON = re.compile(r"\bE[56]\d\d\b")
ANY = re.compile(r"\b[A-Z]\d{3}\b")

#: Codes without a failing deck, and why; those tested by a unit test are named with it.
UNTESTED: dict[str, str] = {
    "D023": "no group, key or choice has a former name yet; test_talus_deck has it",
    "N002": "no input is known that leads to NaN; test_talus_hdf5 and test_talus_history have it",
    "N304": "values of decks and messages are too small to overflow; test_fem_body has it",
    "N405": "guards the identities of the operators; no mesh that talus-fem accepts breaks them",
    "N224": "guards the choice of ghosts near free grains; a unit test of the port has it",
    "N422": "guards the identities of the operators; no mesh that talus-fem accepts breaks them",
    "N408": "guards the reference of a relaxed solid; no deck is known that breaks it",
    "N441": "guards the factor of a matrix that is positive by construction; no input breaks it",
    "P424": "a solver that dies in its --check without a word; no input does that",
    "S301": "METIS out of memory",
    "S302": "another build of MUMPS",
    "S303": "MUMPS out of memory",
    "S304": "a fault inside MUMPS",
    "S306": "a fault inside hypre; test_fem_multigrid has it",
}


def explained() -> dict[str, str]:
    """Return code and folder of every entry of errors.toml."""
    return {
        code: folder
        for folder in LISTS
        for code in tomllib.loads((ROOT / folder / "errors.toml").read_text())
    }


def in_sources() -> dict[str, str]:
    """Return every code that a source uses, and where."""
    used: dict[str, str] = {}
    kinds = {"prepost": ("talus/**/*.py", IN_PYTHON), "libport": ("*.c", IN_C)}
    sources = [(folder, *kinds.get(folder, ("**/*.f90", IN_FORTRAN))) for folder in LISTS]
    for folder, pattern, code_of in [*sources, ("common", "**/*.c", IN_C)]:
        for path in sorted((ROOT / folder).glob(pattern)):
            for code in code_of.findall(path.read_text()):
                used.setdefault(code, str(path.relative_to(ROOT)))
    return used


def in_tests() -> set[str]:
    """Return every code that a failing deck, a fault script or a Python test expects."""
    found: set[str] = set()
    for path in ROOT.glob("tests/errors/*/expect.toml"):
        found.update(tomllib.loads(path.read_text())["codes"])
    for path in [*ROOT.glob("tests/python/*.py"), *ROOT.glob("tests/faults/*/*.py")]:
        found.update(ANY.findall(path.read_text()))
    return found


def check_codes() -> list[str]:
    """Return what is wrong: codes without explanation, use or test, and idle exceptions."""
    listed, used, tested = explained(), in_sources(), in_tests()
    wrong = [f"{c} ({used[c]}) is not in errors.toml" for c in sorted(used.keys() - listed.keys())]
    wrong += [
        f"{c} ({listed[c]}/errors.toml) is used nowhere"
        for c in sorted(listed.keys() - used.keys())
    ]
    wrong += [
        f"{code} ({used.get(code, listed[code])}) has no test"
        for code in sorted(listed.keys() - tested - UNTESTED.keys())
    ]
    wrong += [f"{code} has a test, yet is in UNTESTED" for code in sorted(tested & UNTESTED.keys())]
    return wrong
