"""Run the failing decks of tests/errors and compare exit code, codes and text.

Usage: test_errors.py [--bin build/bin] [--only WORD]
Each folder holds expect.toml: program, exit, codes, contains (texts that must appear), optional
args, deck (default deck.nml) and writes = true where files may be left behind. make_input.py, if
there, is run first in the scratch copy.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CODE = re.compile(r"\berror ([A-Z]\d{3})")


def contents(folder: Path) -> dict[str, bytes]:
    """Return the hash of every file under a folder by its name (empty for folders)."""
    return {
        str(path.relative_to(folder)): (
            hashlib.sha256(path.read_bytes()).digest() if path.is_file() else b""
        )
        for path in folder.rglob("*")
    }


def judge(folder: Path, binaries: Path) -> list[str]:
    """Run one failing deck in a scratch copy; return what differs from expect.toml."""
    expect = tomllib.loads((folder / "expect.toml").read_text())
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name) / folder.name
        shutil.copytree(folder, scratch)
        environment = dict(
            os.environ, PYTHONPATH=str(ROOT / "prepost"), PYTHONDONTWRITEBYTECODE="1"
        )
        if (scratch / "make_input.py").exists():
            made = subprocess.run(
                [sys.executable, "make_input.py"],
                cwd=scratch,
                env=environment,
                capture_output=True,
                text=True,
            )
            if made.returncode:
                return [f"make_input.py failed: {made.stderr[-500:]}"]
        before = contents(scratch)
        command = [
            str(binaries / expect["program"]),
            expect.get("deck", "deck.nml"),
            *expect.get("args", []),
        ]
        try:
            done = subprocess.run(
                command,
                cwd=scratch,
                env=environment,
                capture_output=True,
                text=True,
                timeout=120,
                errors="replace",
            )
        except subprocess.TimeoutExpired:
            return ["ran longer than 120 s"]
        after = contents(scratch)
    touched = sorted(
        name for name in before.keys() | after.keys() if before.get(name) != after.get(name)
    )
    return differences(expect, done, touched)


def differences(expect: dict, done: subprocess.CompletedProcess, touched: list[str]) -> list[str]:
    """Compare a finished run with what was expected."""
    output = done.stdout + done.stderr
    found = []
    if done.returncode != expect["exit"]:
        found.append(f"exit code {done.returncode}, expected {expect['exit']}")
    missing = set(expect["codes"]) - set(CODE.findall(output))
    if missing:
        found.append(
            f"codes {sorted(missing)} not reported (reported: {sorted(set(CODE.findall(output)))})"
        )
    found += [
        f"text not shown: {text!r}" for text in expect.get("contains", []) if text not in output
    ]
    if expect["exit"] == 1 and touched and not expect.get("writes"):
        found.append(f"files made, changed or removed: {', '.join(touched)}")
    if found:
        found.append("output: " + output[-800:])
    return found


def main() -> int:
    """Run all failing decks; return 1 if any was not refused as expected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    passed = failed = 0
    for path in sorted(ROOT.glob("tests/errors/*/expect.toml")):
        if options.only not in path.parent.name:
            continue
        problems = judge(path.parent, options.bin.resolve())
        passed, failed = passed + (not problems), failed + bool(problems)
        if problems:
            print(f"FAILED {path.parent.name}\n    " + "\n    ".join(problems))
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
