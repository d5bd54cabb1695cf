"""What the fuzzers share: scratch copies, the verdict on a run, the count at the end.

A program that gets a damaged input must end as with the whole one, with the same results, or
refuse it: exit code 1, 2 or 4 and a message with a code. A signal, a backtrace, a hang, other
results or a number that is none in them are failures; the input is then kept.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
CODE = re.compile(r"\berror ([A-Z]\d{3})")
CRASH = re.compile(
    r"SIG[A-Z]{3,4}\b.*|Backtrace.*|Fortran runtime error.*|ERROR STOP.*|"
    r"(?:ERROR|SUMMARY): \w*Sanitizer.*|bug: .*|Traceback \(most.*|free\(\): .*|"
    r"malloc\(\): .*|.*corrupted.*|runtime error: .*"
)
MEMORY = 8 << 30  # [bytes] that a program may have
PATIENCE = 60.0  # [s] a program that takes longer hangs; undamaged runs take less than a second
REFUSALS = (1, 2, 4)
GOOD = ("same", "changed", "refused", "stopped")  # verdicts that are no failures
FAST = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # no disk waits for each copy


@dataclass
class Run:
    """A command line in a folder of inputs, and what it wrote undamaged."""

    name: str
    folder: Path
    command: list[str]
    results: dict[str, bytes] = field(default_factory=dict)
    inputs: set[str] = field(default_factory=set)


@dataclass
class Tally:
    """Counts of verdicts and the failures with their inputs."""

    counts: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def add(self, verdict: str, what: str) -> None:
        """Count a verdict; those that are not in GOOD are failures."""
        kind = verdict.split(":")[0]
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if kind not in GOOD:
            self.failures.append(f"{what}: {verdict}")
            print(f"FAILED: {what}: {verdict}", flush=True)

    def close(self) -> int:
        """Print the counts; return 1 after a failure."""
        print(", ".join(f"{count} {kind}" for kind, count in sorted(self.counts.items())))
        bad = len(self.failures)
        print(f"{sum(self.counts.values()) - bad} passed, {bad} failed")
        return 1 if bad or not self.counts else 0


def options(text: str) -> argparse.Namespace:
    """Return what the command line of a fuzzer says."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--long", action="store_true", help="the long campaign")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, help="damaged inputs of each kind")
    parser.add_argument("--only", nargs="*", default=[], help="kinds that contain one of these")
    parser.add_argument("--keep", type=Path, help="folder to which failing inputs are copied")
    found = parser.parse_args()
    found.bin = found.bin.resolve()
    return found


def environment() -> dict[str, str]:
    """Environment of the programs: one thread, the Python package of this tree."""
    return dict(
        os.environ,
        PYTHONPATH=str(ROOT / "prepost"),
        PYTHONDONTWRITEBYTECODE="1",
        OMP_NUM_THREADS="1",
        OPENBLAS_NUM_THREADS="1",
        ASAN_OPTIONS=f"detect_leaks=0:allocator_may_return_null=1:soft_rss_limit_mb={MEMORY >> 20}",
    )


@cache
def is_sanitized(program: Path) -> bool:
    """Whether a program was built with MODE=debug, whose sanitizer watches its memory."""
    return b"__asan_init" in program.read_bytes()


def call(command: list[str], folder: Path) -> tuple[int | None, str]:
    """Run a command; return exit code (None: it hangs) and all that it says."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stdout.decode(errors="replace")


def numbers(path: Path) -> Iterable[tuple[str, np.ndarray]]:
    """Yield name and values of all datasets of numbers in an HDF5 file."""
    found: list[tuple[str, np.ndarray]] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
            found.append((name, item[()]))

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def results(folder: Path, inputs: set[str]) -> dict[str, bytes]:
    """Histories as they stand, datasets of HDF5 files bit for bit; not what was there before."""
    found: dict[str, bytes] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if name in inputs or not path.is_file():
            continue
        if path.suffix in (".csv", ".txt", ".stl"):
            found[name] = path.read_bytes()
        elif path.suffix == ".h5":
            try:
                for dataset, values in numbers(path):
                    found[f"{name}:{dataset}"] = np.asarray(values).tobytes()
            except (OSError, RuntimeError, KeyError, ValueError):
                found[f"{name}:unreadable"] = b""
    return found


def baseline(run: Run) -> Run:
    """Run it undamaged and keep what it writes."""
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as name:
        folder = Path(name) / "run"
        shutil.copytree(run.folder, folder)
        code, said = call(run.command, folder)
        if code != 0:
            sys.exit(f"{run.name}: the undamaged run ends with {code}:\n{said[-3000:]}")
        before = {p.relative_to(run.folder): p for p in run.folder.rglob("*") if p.is_file()}
        run.inputs = {
            str(name)
            for name, path in before.items()
            if (folder / name).is_file() and (folder / name).read_bytes() == path.read_bytes()
        }
        run.results = results(folder, run.inputs)
        if not run.results:
            sys.exit(f"{run.name}: the undamaged run writes nothing")
    return run


def not_finite(found: dict[str, bytes], whole: dict[str, bytes]) -> str:
    """First history that holds NaN or infinity and did not before."""
    for name, data in found.items():
        if name.endswith(".csv"):
            for word in (b"nan", b"inf"):
                if word in data.lower() and word not in whole.get(name, b"").lower():
                    return name
    return ""


def verdict(run: Run, folder: Path, may_change: bool) -> str:
    """Run in a folder with a damaged input: same, changed (if it may), refused or a failure."""
    start = time.monotonic()
    code, said = call(run.command, folder)
    seconds = time.monotonic() - start
    if code is None:
        return f"hang: longer than {PATIENCE:g} s"
    crash = CRASH.search(said)
    if code < 0 or code >= 128 or crash:
        return f"crash: exit {code}, {crash.group(0)[:90] if crash else said[-200:]!r}"
    if seconds > PATIENCE / 3.0:
        return f"slow: {seconds:.0f} s"
    if code != 0:
        if code not in REFUSALS or not CODE.search(said):
            return f"unclear: exit {code}, {said[-200:]!r}"
        return "refused"
    found = results(folder, run.inputs)
    if found == run.results:
        return "same"
    if not may_change:
        different = [n for n in run.results if found.get(n) != run.results[n]]
        return f"other results: {', '.join(different[:4])}"
    bad = not_finite(found, run.results)
    return f"not finite: {bad}" if bad else "changed"


def trial(run: Run, damage: object, may_change: bool, keep: Path | None) -> str:
    """Damage a fresh copy of the inputs, judge the run; failing copies are kept if asked for."""
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as name:
        folder = Path(name) / "run"
        shutil.copytree(run.folder, folder)
        damage(folder)
        spare = Path(name) / "before"
        if keep:
            shutil.copytree(folder, spare)
        found = verdict(run, folder, may_change)
        if keep and found.split(":")[0] not in GOOD:
            keep.mkdir(parents=True, exist_ok=True)
            place = keep / f"{run.name}_{len(list(keep.iterdir())):03d}"
            shutil.copytree(spare, place)
            (place / "command").write_text(" ".join(run.command) + "\n" + found + "\n")
        return found
