"""Put one-line faults into the code, one at a time, and see which test notices each.

Usage: mutants.py [--out build/mutants] [--only ID ...] [--check] [--accept]
tools/mutants.toml lists the faults: a text that occurs once in a file, what replaces it, and the
tests that are about the thing and must fail then. The work is done in a copy of the tree with its
build, rebuilt where it is older; the checkout is not touched. --check only says whether each
text still occurs once in its file. --accept writes the report to manual/mutants.csv; with --only
it replaces the rows of the faults that were tried.
Closes with 'N passed, M failed'; exits with 1 if a fault is not noticed.
"""

import argparse
import csv
import os
import shutil
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = "tools/mutants.toml"
PARTS = ("common", "dem", "fem", "couple", "prepost")
SECONDS = 900  # a slower test has noticed: the fault makes it hang


@dataclass
class Mutant:
    """A fault: in `file`, `find` becomes `put`; one of `tests` must notice."""

    name: str
    file: str
    find: str
    put: str
    tests: list[str]
    about: str


def read_list(root: Path) -> list[Mutant]:
    """Return the faults of tools/mutants.toml."""
    data = tomllib.loads((root / LIST).read_text())
    return [
        Mutant(name, it["file"], it["find"], it["put"], it["noticed_by"], it["about"])
        for name, it in data.items()
    ]


def place_of(root: Path, mutant: Mutant) -> tuple[Path | None, str]:
    """Return the file of a fault, or None and what is wrong."""
    paths = [p for part in PARTS for p in (root / part).rglob(mutant.file)]
    if len(paths) != 1:
        return None, f"{mutant.name}: {len(paths)} files {mutant.file}"
    count = paths[0].read_text().count(mutant.find)
    if count != 1 or mutant.find == mutant.put:
        return None, f"{mutant.name}: its text occurs {count} times in {mutant.file}"
    return paths[0], ""


def check(root: Path) -> int:
    """Say which faults no longer fit the sources; return how many."""
    mutants = read_list(root)
    wrong = [text for it in mutants if (text := place_of(root, it)[1])]
    for it in mutants:
        wrong += [f"{it.name}: no test {name}" for name in it.tests if not test_exists(root, name)]
    print("\n".join(wrong), end="\n" if wrong else "")
    print(f"{max(len(mutants) - len(wrong), 0)} passed, {len(wrong)} failed")
    return len(wrong)


def test_exists(root: Path, name: str) -> bool:
    """Is there a test `unit X`, `case X`, `python X` or `error X`?"""
    kind, what = name.split()
    pattern = {
        "unit": f"tests/unit/**/test_{what}.f90",
        "case": f"verification/*/{what}/case.toml",
        "python": f"tests/python/test_{what}.py",
        "error": f"tests/errors/{what}/expect.toml",
    }[kind]
    return any(root.glob(pattern))


def copy_tree(out: Path) -> Path:
    """Return a copy of the tracked files and of the build, brought up to date."""
    tree = out / "tree"
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    names = {name for name in listed.split("\0") if name and (ROOT / name).exists()}
    for path in [p for part in PARTS for p in (tree / part).rglob("*.*")]:
        if path.is_file() and str(path.relative_to(tree)) not in names:
            path.unlink()  # has moved in the checkout
    for name in sorted(names):
        source, target = ROOT / name, tree / name
        if not target.exists() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    if not (tree / "build/obj").exists() and (ROOT / "build/obj").exists():
        for folder in ("obj", "mod", "lib"):
            shutil.copytree(ROOT / "build" / folder, tree / "build" / folder)
    if not (tree / "build/venv").exists():
        (tree / "build").mkdir(exist_ok=True)
        (tree / "build/venv").symlink_to(ROOT / "build/venv")
    return tree


def make(tree: Path, *targets: str) -> subprocess.CompletedProcess:
    """Build targets in the copy."""
    command = ["make", "-s", "-j", str(os.cpu_count() or 1), *targets]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True)


def run_test(tree: Path, name: str) -> tuple[str, str]:
    """Return ('noticed' | 'passed' | 'broken', first line of what failed)."""
    kind, what = name.split()
    python = str(ROOT / "build/venv/bin/python")
    binaries = str(tree / "build/bin")
    if kind == "unit":
        built = make(tree, f"build/unit/test_{what}")
        command = [f"build/unit/test_{what}"]
    else:
        built = make(tree, "all")
        command = {
            "case": [python, "tools/verify.py", "--bin", binaries, "--out", "build/verification",
                     "--case", what],
            "python": [python, "-m", "pytest", "-q", "-x", f"tests/python/test_{what}.py"],
            "error": [python, "tools/test_errors.py", "--bin", binaries, "--only", what],
        }[kind]  # fmt: skip
    if built.returncode != 0:
        return "broken", built.stderr.strip().splitlines()[-1] if built.stderr else "make failed"
    environment = dict(os.environ, PYTHONPATH=str(tree / "prepost"))
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        return "noticed", "does not end"
    lines = [line.strip() for line in done.stdout.splitlines() if "fail" in line.lower()]
    if done.returncode == 0:
        return "passed", ""
    return "noticed", (lines or [f"exit code {done.returncode}"])[0][:160]


def try_mutant(tree: Path, mutant: Mutant) -> dict[str, str]:
    """Put the fault in, run its tests until one notices, take the fault out."""
    path, wrong = place_of(tree, mutant)
    row = {
        "id": mutant.name,
        "file": mutant.file,
        "about": mutant.about,
        "noticed by": "",
        "how": "",
    }
    if path is None:
        return row | {"how": wrong}
    sound = path.read_text()
    path.write_text(sound.replace(mutant.find, mutant.put))
    try:
        for name in mutant.tests:
            outcome, how = run_test(tree, name)
            if outcome != "passed":
                caught = name if outcome == "noticed" else ""
                return row | {"noticed by": caught, "how": how}
    finally:
        path.write_text(sound)
    return row | {"how": "passes " + ", ".join(mutant.tests)}


def write_report(rows: list[dict[str, str]], path: Path) -> None:
    """Write one line a fault; bytes that print nothing, as in texts cut by a fault, become `?`."""
    rows = [
        {key: "".join(c if c.isprintable() else "?" for c in text) for key, text in row.items()}
        for row in rows
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def accept(rows: list[dict[str, str]], names: list[str], path: Path) -> None:
    """Put rows in place of older ones, in the order of the list; what left the list goes."""
    known: dict[str, dict[str, str]] = {}
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            known = {row["id"]: row for row in csv.DictReader(file)}
    known |= {row["id"]: row for row in rows}
    write_report([known[name] for name in names if name in known], path)


def sound_tests(tree: Path, mutants: list[Mutant]) -> list[str]:
    """Return the tests that fail without any fault: they cannot notice one."""
    names = sorted({name for it in mutants for name in it.tests})
    return [f"{name}: {how}" for name in names for state, how in [run_test(tree, name)] if how]


def main() -> int:
    """Try all faults; return 1 if one is not noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "build/mutants")
    parser.add_argument(
        "--only", nargs="*", default=[], help="faults whose name holds one of these"
    )
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--accept", action="store_true")
    options = parser.parse_args()
    if options.check:
        return int(check(ROOT) > 0)
    tree = copy_tree(options.out.resolve())
    mutants = [
        it
        for it in read_list(ROOT)
        if not options.only or any(word in it.name for word in options.only)
    ]
    unsound = sound_tests(tree, mutants)
    if unsound:
        print("these tests fail without any fault:", *unsound, sep="\n")
        return 1
    rows = []
    for it in mutants:
        start = time.monotonic()
        rows.append(try_mutant(tree, it))
        caught = rows[-1]["noticed by"] or "NOT NOTICED"
        print(f"{it.name:32s} {caught:36s} {time.monotonic() - start:6.1f} s", flush=True)
        if not rows[-1]["noticed by"]:
            print(f"    {rows[-1]['how']}", flush=True)
    write_report(rows, options.out / "report.csv")
    if options.accept:
        accept(rows, [it.name for it in read_list(ROOT)], ROOT / "manual/mutants.csv")
    failed = sum(1 for row in rows if not row["noticed by"])
    print(f"{len(rows) - failed} passed, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
