"""Run every test suite of Talus and add up what passed and failed.

As many suites run at a time as there are cores, at most two, and one more, since some wait; the
cases of verification are the last suite and run in parallel themselves.
Usage: test_all.py [--bin build/bin] [--units build/unit] [--only NAME ...]
Each suite prints its own failures and closes with 'N passed, M failed'; all that it printed, with
the times of its parts, is kept in build/tests/logs.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PARTS = 3  # of the tests in Python
TALLY = re.compile(r"(\d+) passed(?:, (\d+) failed)?")
PYTEST_FAILED = re.compile(r"(\d+) failed(?:, (\d+) passed)?")


def suites(binaries: Path, units: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield (name, command) of every suite."""
    python = sys.executable
    files = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("tests/python/test_*.py"))
    for part in range(PARTS):
        yield f"python {part + 1}", [
            python, "-m", "pytest", "-q", "--no-header", "--durations=40", "-x", "-p",
            "no:cacheprovider", *files[part::PARTS],
        ]  # fmt: skip
    yield "keys", [python, "tools/keys.py", "--check"]
    yield "style", [python, "tools/style.py"]
    yield "mutants", [python, "tools/mutants.py", "--check"]
    for unit in sorted(units.glob("test_*")):
        yield f"unit {unit.name}", [str(unit)]
    yield "errors", [python, "tools/test_errors.py", "--bin", str(binaries)]
    for script in sorted(ROOT.glob("tests/regression/*/run.*")) + sorted(
        ROOT.glob("tests/faults/*/run.*")
    ):
        command = [python] if script.suffix == ".py" else ["bash"]
        scratch = ROOT / "build" / "tests" / script.parent.name
        yield f"{script.parent.parent.name} {script.parent.name}", [
            *command, str(script), str(binaries), str(scratch),
        ]  # fmt: skip


def cases(binaries: Path, jobs: int) -> tuple[str, list[str]]:
    """Return (name, command) of the quick verification cases, run on all cores."""
    return "verification (quick)", [
        sys.executable, "tools/verify.py", "--quick", "--jobs", str(jobs), "--bin", str(binaries),
        "--out", "build/verification",
    ]  # fmt: skip


def tally(output: str, code: int) -> tuple[int, int]:
    """Return (passed, failed) of a suite from its closing line, or from its exit code."""
    passed, failed = int(code == 0), int(code != 0)
    for line in reversed(output.splitlines()):
        found = PYTEST_FAILED.search(line)
        if found and line.strip().startswith(found.group(0)) and "in " in line:
            return int(found.group(2) or 0), int(found.group(1))
        if found := TALLY.search(line):
            passed, failed = int(found.group(1)), int(found.group(2) or 0)
            break
    if code != 0 and failed == 0:
        failed = 1
    return passed, failed


def run_suite(suite: tuple[str, list[str]]) -> tuple[int, int]:
    """Run one suite (name, command), print a line for it and its output when it failed."""
    name, command = suite
    start = time.monotonic()
    environment = dict(os.environ, PYTHONPATH=str(ROOT / "prepost"))
    done = subprocess.run(
        command,
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    logs = ROOT / "build" / "tests" / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    (logs / f"{name.replace(' ', '_')}.txt").write_text(done.stdout)
    passed, failed = tally(done.stdout, done.returncode)
    seconds = time.monotonic() - start
    line = f"{name:40s} {passed:4d} passed {failed:4d} failed {seconds:8.1f} s"
    print("\n".join([line, done.stdout[-6000:]] if failed else [line]), flush=True)
    return passed, failed


def main() -> int:
    """Run the suites; return 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--units", type=Path, default=ROOT / "build/unit")
    parser.add_argument(
        "--only", nargs="*", default=[], help="suites whose name contains one of these"
    )
    options = parser.parse_args()
    jobs = min(os.cpu_count() or 1, 2)
    binaries = options.bin.resolve()
    verification = cases(binaries, jobs)
    wanted = [
        suite
        for suite in [*suites(binaries, options.units.resolve()), verification]
        if not options.only or any(word in suite[0] for word in options.only)
    ]
    with ThreadPoolExecutor(jobs + 1) as pool:
        tallies = list(pool.map(run_suite, [suite for suite in wanted if suite != verification]))
    tallies += [run_suite(verification)] if verification in wanted else []
    passed, failed = sum(good for good, _ in tallies), sum(bad for _, bad in tallies)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
