"""Programs that die while elements open and close: one message, nothing stays behind, same bits."""

import contextlib
import os
import random
import re
import resource
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from test_adapt_close import CLOSING, write_long

from talus.packing import read_packing, write_h5
from talus.programs import find_program

TABLES = ("coupled_audit.csv", "grains_energy.csv", "coupled_conversions.csv")
GROWING = {"talus-couple": "coupled_audit.csv", "talus-dem": "grains.h5"}  # the largest files
SOLVERS = ("talus-dem", "talus-fem")
CODES = {"talus-dem": 4, "talus-fem": 4, "talus-couple": -signal.SIGKILL, "terminate": 3}


def write_model(folder: Path) -> None:
    """Write a column that moves a little; an element opens or closes every tenth exchange."""
    write_long(folder, CLOSING)
    packing = read_packing(folder / "packing.h5")
    packing.v = 1e-3 * np.sin(1e3 * packing.x)
    write_h5(folder / "packing.h5", packing)
    with (folder / "coupled.nml").open("a") as deck:
        deck.write("&port time_limit = 3.0 /\n")


def begin(folder: Path, *words: str) -> subprocess.Popen:
    """Start talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    seen = (folder / "seen.txt").open("w")
    return subprocess.Popen(command, cwd=folder, stdout=seen, stderr=subprocess.STDOUT)


def solvers_of(run: subprocess.Popen) -> dict[str, int]:
    """Return the solvers that a run has started, by name."""
    words = ["ps", "--ppid", str(run.pid), "-o", "pid=,comm="]
    rows = subprocess.run(words, capture_output=True, text=True).stdout.split()
    return dict(zip(rows[1::2], map(int, rows[::2]), strict=True))


def wait_until_gone(pids: list[int]) -> bool:
    """Tell whether the processes end within ten seconds."""
    end = time.monotonic() + 10.0
    while any(Path(f"/proc/{pid}").exists() for pid in pids):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes | float]:
    """Return the tables of a run that nobody disturbs, and the seconds that it took."""
    folder = tmp_path_factory.mktemp("whole")
    write_model(folder)
    began = time.monotonic()
    assert begin(folder).wait() == 0, (folder / "seen.txt").read_text()
    took = time.monotonic() - began
    size = {who: (folder / name).stat().st_size for who, name in GROWING.items()}
    return {name: (folder / name).read_bytes() for name in TABLES} | {"took": took} | size


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("who", [*SOLVERS, "talus-couple", "terminate"])
def test_whoever_dies(who: str, seed: int, whole: dict, tmp_path: Path) -> None:
    """At a random moment; the run goes on from its last checkpoint to the same bits."""
    write_model(tmp_path)
    run = begin(tmp_path)
    while not list(tmp_path.glob("coupled.*.manifest")) and run.poll() is None:
        time.sleep(0.005)
    solvers = solvers_of(run)
    assert set(solvers) == set(SOLVERS)
    time.sleep(0.5 * whole["took"] * random.Random(who + str(seed)).random())
    victim = solvers.get(who, run.pid)
    with contextlib.suppress(ProcessLookupError):
        os.kill(victim, signal.SIGTERM if who == "terminate" else signal.SIGKILL)
    code = run.wait(60.0)
    text = (tmp_path / "seen.txt").read_text()
    assert code in (0, CODES[who]), text
    faults = re.findall(r"^error ([A-Z]\d{3}): (.*)$", text, re.MULTILINE)
    assert len(faults) == (code == 4), text
    assert wait_until_gone(list(solvers.values()))
    assert not list(Path("/dev/shm").glob(f"talus-{run.pid}-*"))
    if code != 0:
        assert begin(tmp_path, "--restart=auto").wait() == 0, (tmp_path / "seen.txt").read_text()
    for name in TABLES:
        assert (tmp_path / name).read_bytes() == whole[name], name


@pytest.mark.parametrize("who", GROWING)
def test_the_disk_is_full(who: str, whole: dict, tmp_path: Path) -> None:
    """While elements open and close: one message, and a restart goes on to the same bits."""
    write_model(tmp_path)
    run = begin(tmp_path)
    while not list(tmp_path.glob("coupled.*.manifest")) and run.poll() is None:
        time.sleep(0.005)
    most = int(0.9 * whole[who])
    resource.prlimit({"talus-couple": run.pid, **solvers_of(run)}[who], resource.RLIMIT_FSIZE,
                     (most, most))  # fmt: skip
    assert run.wait(60.0) == 4
    text = (tmp_path / "seen.txt").read_text()
    assert len(re.findall(r"^error S002: .*no room", text, re.MULTILINE)) == 1, text
    assert not list(Path("/dev/shm").glob(f"talus-{run.pid}-*"))
    assert begin(tmp_path, "--restart=auto").wait() == 0, (tmp_path / "seen.txt").read_text()
    for name in TABLES:
        assert (tmp_path / name).read_bytes() == whole[name], name
