"""Check the layout rules of the code that a machine can check (marked (c) in the style guide).

Usage: style.py [--root FOLDER] [--shrink]
Fortran under common, dem, fem, couple and tests/unit; Python by ruff, where it is installed; labels
of equations (style_labels.py); writers of components (writers.py); subjects of commits. Procedures
that are too long, take too many arguments or nest too deeply, and variables of modules
(style_procedures.py) are let through only if tools/style_exceptions.txt names them; that list may
only shrink (--shrink removes what is mended). Prints `file:line: rule`, closes with 'N passed, M
failed', exits with 1 on failure.
"""

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

import style_labels
import style_procedures
import writers
from style_procedures import code_of

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("common", "dem", "fem", "couple", "tests/unit")
PYTHON = ("prepost", "tools", "verification", "tests")
COLUMNS, LINES = 100, 600
REAL = re.compile(
    r"(?<![\w.])(?:\d+\.\d*(?:[ed][+-]?\d+)?|\.\d+(?:[ed][+-]?\d+)?|\d+[ed][+-]?\d+)(?!\w)"
)
FORBIDDEN = (
    (re.compile(r"(,|^)\s*pointer\b(?!\s*=)"), "pointer"),
    (re.compile(r"^\s*pointer\b"), "pointer"),
    (re.compile(r"\bgo\s*to\b"), "goto"),
    (re.compile(r"(^|,)\s*save\b(?!\s*[=(%])"), "save"),
    (re.compile(r"^\s*common\b\s*(/|\w)(?!.*=)"), "common block"),
    (re.compile(r"^\s*equivalence\s*\("), "equivalence"),
    (re.compile(r"^\s*include\s"), "include"),
)
# the module of the interface to MUMPS includes its file; memory that C owns needs a pointer; the
# routines of a contact law are procedure pointers, chosen outside the loop
ALLOWED = {
    "include": {"fem_mumps.f90"},
    "pointer": {"fem_mumps.f90", "dem_law_state.f90", "dem_additional_model.f90"},
}
EXCEPTIONS = "tools/style_exceptions.txt"
# subjects of commits are checked from this one on, where the history is there
SINCE = "1572f64"
SUBJECT = re.compile(r"^[a-z][a-z0-9, -]*: (?P<verb>[a-z][a-z-]*)\b")
NO_VERB = re.compile(r"(ed|ing|[^s]s)$|^(a|an|the|no|new|more|of|for|in)$")
VERBS = {"process", "address", "pass", "focus", "embed", "feed", "need", "bring", "string", "speed"}
# maxval, and any of a comparison, pass over a NaN: a test that uses them asserts too little
BLIND = (
    (re.compile(r"\bmaxval\s*\(\s*abs\s*\("), "maxval(abs(...)) skips NaN"),
    (re.compile(r"\.not\.\s*any\s*\(\s*abs\s*\("), ".not. any(abs(...)) passes with NaN"),
)
OF_C = re.compile(r"\bcall\s+c_f_pointer\b")
FORMAT = re.compile(r"^\s*\d+\s+format\b")


def check_layout(path: Path, lines: list[str]) -> list[tuple[int, str]]:
    """Length of lines and file, blanks at line ends, tabs."""
    found = [(n, f"line of {len(t)} columns") for n, t in enumerate(lines, 1) if len(t) > COLUMNS]
    found += [(n, "tab") for n, text in enumerate(lines, 1) if "\t" in text]
    found += [
        (n, "blank at the end of the line")
        for n, text in enumerate(lines, 1)
        if text != text.rstrip()
    ]
    if len(lines) > LINES and not path.name.endswith("_deck_keys.f90"):
        found.append((len(lines), f"file of {len(lines)} lines"))
    return found


def check_module(path: Path, code: list[str]) -> list[tuple[int, str]]:
    """One module a file, named as the file, with implicit none and private."""
    found = []
    start = re.compile(r"^\s*(module|program)\s+(\w+)\s*$")
    units = [(n, *m.groups()) for n, text in enumerate(code, 1) if (m := start.match(text))]
    if len(units) != 1:
        return [(1, f"{len(units)} modules or programs in one file")]
    number, kind, name = units[0]
    if kind == "module" and name != path.stem:
        found.append((number, f"module {name} in a file of another name"))
    if not any(re.match(r"^\s*implicit\s+none\b", text) for text in code):
        found.append((number, "no implicit none"))
    if kind == "module" and not any(re.match(r"^\s*private\s*$", text) for text in code):
        found.append((number, "no private"))
    return found


def check_statements(path: Path, code: list[str]) -> list[tuple[int, str]]:
    """`use` without only, literals without kind, forbidden statements."""
    found = []
    maps_memory = any(OF_C.search(text) for text in code)
    for number, text in enumerate(code, 1):
        if re.match(r"^\s*use\b(?!\s*=)", text) and "only" not in text:
            found.append((number, "use without only"))
        if not FORMAT.match(text):
            found += [
                (number, f"real literal {m.group()} without kind") for m in REAL.finditer(text)
            ]
        for pattern, name in FORBIDDEN:
            allowed = path.name in ALLOWED.get(name, ()) or (name == "pointer" and maps_memory)
            if pattern.search(text) and not allowed:
                found.append((number, f"{name} is not used here"))
                break
    return found


def check_tests(path: Path, code: list[str]) -> list[tuple[int, str]]:
    """Unit tests compare so that a NaN fails; the harness itself is exempt."""
    if not path.name.startswith("test_"):
        return []
    return [
        (number, f"{what}: use check_all_close or max_abs of talus_test")
        for number, text in enumerate(code, 1)
        for pattern, what in BLIND
        if pattern.search(text)
    ]


class Exceptions:
    """Procedures that may be above a limit, as far as the list allows."""

    def __init__(self, path: Path) -> None:
        """Read lines `module procedure rule value`."""
        self.path = path
        self.allowed: dict[tuple[str, str, str], int] = {}
        self.seen: dict[tuple[str, str, str], int] = {}
        for line in path.read_text().splitlines() if path.exists() else []:
            if line.strip() and not line.startswith("#"):
                module, name, rule, value = line.split()
                self.allowed[module, name, rule] = int(value)

    def check(self, path: Path, code: list[str]) -> list[tuple[int, str]]:
        """Return the breaches of a file that the list does not let through."""
        found = []
        for line, name, rule, value in style_procedures.breaches(code):
            key = (path.stem, name, rule)
            self.seen[key] = max(value, self.seen.get(key, 0))
            if value > self.allowed.get(key, 0):
                found.append(
                    (line, f"{name}: {value} {rule}, limit {style_procedures.LIMITS[rule]}")
                )
        return found

    def idle(self) -> list[str]:
        """Return entries that are mended or lower than in the list: the list must shrink."""
        return [
            f"{EXCEPTIONS}: {' '.join(key)} {value} is {self.seen.get(key, 'mended')} (--shrink)"
            for key, value in self.allowed.items()
            if self.seen.get(key, 0) < value
        ]

    def shrink(self) -> None:
        """Write the list without what is mended; nothing is added."""
        kept = {
            key: min(value, self.seen[key])
            for key, value in self.allowed.items()
            if key in self.seen
        }
        head = "# Above the limits of tools/style_procedures.py; this list only shrinks.\n"
        lines = [f"{' '.join(key)} {value}\n" for key, value in sorted(kept.items())]
        self.path.write_text(head + "".join(lines))


def check_fortran(path: Path, exceptions: Exceptions) -> list[tuple[int, str]]:
    """Return (line, rule) of all breaches in a file."""
    lines = path.read_text().splitlines()
    code = code_of(lines)
    found = check_layout(path, lines) + check_module(path, code)
    found += check_statements(path, code) + check_tests(path, code)
    return sorted(set(found + exceptions.check(path, code)))


def check_subjects(root: Path) -> list[str]:
    """Return commits whose subject is not `area: imperative` in 72 columns."""
    command = ["git", "log", "--no-merges", "--format=%h %s", f"{SINCE}..HEAD"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    found = []
    for line in done.stdout.splitlines() if done.returncode == 0 else []:
        name, subject = line.split(" ", 1)
        start = SUBJECT.match(subject)
        if len(subject) > 72:
            found.append(f"commit {name}: subject of {len(subject)} columns")
        if start is None:
            found.append(f"commit {name}: subject is not `area: what it does`: {subject}")
        elif NO_VERB.search(start["verb"]) and start["verb"] not in VERBS:
            found.append(f"commit {name}: subject is not imperative: {subject}")
    return found


def check_python(root: Path) -> tuple[int, int, list[str]]:
    """Return (files in order, files with breaches, messages of ruff); (0, 0, ...) without ruff."""
    ruff = shutil.which("ruff") or shutil.which("ruff", path=str(Path(sys.executable).parent))
    if ruff is None:
        return 0, 0, ["ruff is not installed (make deps-dev): Python was not checked"]
    folders = [name for name in PYTHON if (root / name).exists()]
    files = {str(p.relative_to(root)) for name in folders for p in (root / name).rglob("*.py")}
    bad, said = set(), []
    for name in sorted(files):
        lines = len((root / name).read_text().splitlines())
        if lines > LINES:
            bad.add(name)
            said.append(f"{name}:{lines}: file of {lines} lines")
    for arguments in (["check", "--output-format", "concise"], ["format", "--check"]):
        command = [ruff, *arguments, "--no-cache", *folders]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True)
        if done.returncode > 1:
            return 0, 1, [f"ruff failed: {done.stderr.strip()}"]
        for line in done.stdout.splitlines():
            name = line.removeprefix("Would reformat: ").split(":")[0]
            if name in files:
                bad.add(name)
                said.append(line)
    return len(files) - len(bad), len(bad), said


def main() -> int:
    """Check all files; return 1 if a rule is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--shrink", action="store_true", help="shorten the list of exceptions")
    options = parser.parse_args()
    root = options.root.resolve()
    exceptions = Exceptions(root / EXCEPTIONS)
    passed = failed = 0
    for path in (path for folder in FOLDERS for path in sorted((root / folder).rglob("*.f90"))):
        found = check_fortran(path, exceptions)
        for number, rule in found:
            print(f"{path.relative_to(root)}:{number}: {rule}")
        passed, failed = passed + (not found), failed + bool(found)
    if options.shrink:
        exceptions.shrink()
    groups = (exceptions.idle(), style_labels.check(root), writers.check(root))
    for found in (*groups, check_subjects(root)):
        print("\n".join(found), end="\n" if found else "")
        passed, failed = passed + (not found), failed + bool(found)
    good, bad, said = check_python(root)
    print("\n".join(said), end="\n" if said else "")
    passed, failed = passed + good, failed + bad
    print(f"{passed} passed, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
