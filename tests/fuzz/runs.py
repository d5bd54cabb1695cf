"""What the fuzzers of runs share: a small coupled model, a run under way, what it leaves."""

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, Namespace
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from fuzzing import environment

from talus.port_names import SCALARS

sys.path.insert(0, str(Path(__file__).parents[1] / "faults/coupled"))
sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
from opened_column import write  # noqa: E402
from run import GRAINS, SOLID, alive, children, make_model  # noqa: E402

ROOT = Path(__file__).parents[2]
SOLVERS = {"talus-dem": "grains", "talus-fem": "solid"}
OUTPUT = "&output every_time = 1.0e-3 /\n"
SHM = Path("/dev/shm")
STEP = "step at"
STEP_LIMIT = SCALARS["step_limit"]  # no part of the state: estimated anew at a start
TIMED = ("wall", "timer", "date", "seconds")  # attributes that differ between two equal runs


def model(folder: Path, t_end: float, transport: str = "shared_memory", limit: float = 3.0) -> None:
    """Write the coupled model (18 grains fall on ghosts on a cube) with fields as output."""
    shutil.rmtree(folder, ignore_errors=True)
    make_model(folder, t_end, transport)
    (folder / "grains.nml").write_text(GRAINS + OUTPUT)
    (folder / "solid.nml").write_text(SOLID + OUTPUT)
    deck = folder / "coupled.nml"
    deck.write_text(deck.read_text().replace("time_limit = 3.0", f"time_limit = {limit}"))


def opened_column(folder: Path, t_end: float) -> None:
    """Write a coupled model in which grains wake and leave: a column that is opened."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    write(folder, ", keep_behind = 4.0e-3, hold_behind = 1.0e-3", 64)
    deck = folder / "coupled.nml"
    deck.write_text(deck.read_text().replace("t_end = 1.2e-4", f"t_end = {t_end:.6g}"))


class Run:
    """A coupled run under way."""

    def __init__(self, binaries: Path, folder: Path, *options: str) -> None:
        """Start it; what it says goes to seen.txt."""
        self.folder = folder
        self.log = (folder / "seen.txt").open("w+")
        command = [str(binaries / "talus-couple"), "coupled.nml", *options]
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment(), stdout=self.log, stderr=subprocess.STDOUT
        )
        self.pid = self.process.pid
        self.solvers: dict[str, int] = {}

    def find_solvers(self, limit: float = 20.0) -> bool:
        """Wait until both solvers are there; false when the run ends before."""
        end = time.monotonic() + limit
        while len(self.solvers) < 2 and time.monotonic() < end and self.process.poll() is None:
            self.solvers |= {k: v for k, v in children(self.pid).items() if k in SOLVERS}
            time.sleep(0.002)
        return len(self.solvers) == 2

    def wait_for_rows(self, size: int = 1000, limit: float = 30.0) -> bool:
        """Wait until the audit file has so many bytes; false when the run ends before."""
        audit = self.folder / "coupled_audit.csv"
        end = time.monotonic() + limit
        while self.process.poll() is None and time.monotonic() < end:
            if audit.exists() and audit.stat().st_size > size:
                return True
            time.sleep(0.005)
        return False

    def end(self, limit: float) -> tuple[int | None, str]:
        """Return exit code (None: it did not end within the limit and was killed) and output."""
        code = None
        try:
            code = self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.find_solvers(0.1)
            for pid in [*self.solvers.values(), self.pid]:
                kill(pid, signal.SIGKILL)
            self.process.wait()
        self.log.seek(0)
        return code, self.log.read()

    def strays(self, limit: float = 3.0) -> list[str]:
        """Return solvers that outlive the run by more than the limit [s]."""
        end = time.monotonic() + limit
        while True:
            left = [f"process {name}" for name, pid in self.solvers.items() if alive(pid)]
            if not left or time.monotonic() > end:
                return left
            time.sleep(0.01)


def kill(pid: int, number: int) -> bool:
    """Send a signal; false when the process is gone."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return False
    return True


def remains(folder: Path) -> list[str]:
    """Return what no ended run may leave: port folders, unfinished files, locks, segments."""
    patterns = ("talus-*.port", "*.tmp", "*.lock", "*.kept", "*.new", "*.out")
    left = [path.name for pattern in patterns for path in folder.glob(pattern)]
    return left + [str(path) for path in segments()]


def segments() -> list[Path]:
    """Return segments of Talus in shared memory that no live process has mapped."""
    used = set()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            used |= {os.readlink(fd) for fd in (entry / "fd").iterdir()}
        except OSError:
            continue
    return [path for path in SHM.glob("talus-*") if str(path) not in used]


def put(into: dict[str, bytes], path: Path) -> None:
    """Add the datasets of a file by name, those of a step of fields by its time, as bytes."""
    with h5py.File(path) as file:
        times = {name: step.attrs["time"] for name, step in file.get("steps", {}).items()}

        def visit(name: str, item: object) -> None:
            if not isinstance(item, h5py.Dataset) or any(word in name for word in TIMED):
                return
            if name.startswith("steps/"):
                number, rest = name.split("/", 2)[1:]
                name = f"{STEP} {times[number]} {rest}"
            value = np.asarray(item[()])
            if name.startswith("scalars/"):
                value = np.delete(value, STEP_LIMIT)
            into[f"{path.name}/{name}"] = value.tobytes()

        file.visititems(visit)


def result(folder: Path) -> dict[str, bytes]:
    """Return histories and the data of fields and checkpoints at the end, to compare two runs."""
    found = {path.name: path.read_bytes() for path in sorted(folder.glob("*.csv"))}
    for stem in ("grains", "solid"):
        if (folder / f"{stem}.h5").exists():
            put(found, folder / f"{stem}.h5")
    manifest = folder / "coupled.manifest"
    for line in manifest.read_text().splitlines() if manifest.exists() else []:
        words = line.split(maxsplit=2)
        if len(words) == 3:
            put(found, folder / Path(words[2]).name)
    return found


def differences(a: dict[str, bytes], b: dict[str, bytes]) -> list[str]:
    """Return the names of what differs between a result and that of a run in one piece."""
    return sorted(name for name in set(a) | set(b) if a.get(name) != b.get(name))


@dataclass
class Tally:
    """Counts checks; says what failed."""

    passed: int = 0
    faults: list[str] = field(default_factory=list)

    def check(self, name: str, good: bool, seen: str = "") -> bool:
        """Count one check."""
        self.passed += bool(good)
        if not good:
            self.faults.append(name)
            print(f"FAILED: {name}\n{seen[-1500:]}", flush=True)
        return bool(good)

    def finish(self) -> int:
        """Print the tally; return the exit code."""
        print(f"{self.passed} passed, {len(self.faults)} failed", flush=True)
        return 1 if self.faults else 0


def arguments(doc: str) -> Namespace:
    """Read --long, --seed, --bin, --keep; adds `rng` and `scratch`, a folder of its own."""
    parser = ArgumentParser(description=doc)
    parser.add_argument("--long", action="store_true", help="the whole campaign")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin", help="the programs")
    parser.add_argument("--keep", action="store_true", help="keep the folders of the runs")
    given = parser.parse_args()
    given.bin = given.bin.resolve()
    given.rng = random.Random(given.seed)
    given.scratch = Path(tempfile.mkdtemp(prefix="talus-fuzz-"))
    return given


def leave(given: Namespace, tally: Tally) -> int:
    """Remove the scratch folder (unless it is to be kept); return the exit code."""
    if given.keep or tally.faults:
        print(f"see {given.scratch}")
    else:
        shutil.rmtree(given.scratch, ignore_errors=True)
    return tally.finish()
