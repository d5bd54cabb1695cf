"""Ranks of a side of a coupled run that die or have no room: one message, then the same results.

The same bits, where ranks of the solid die. Forces on prescribed grains are sums of the ranks'
parts, and a restart deals the grains out anew: there results are the same but for round-off.
"""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from test_rank_faults import is_alive, rank_processes

from talus.programs import find_program
from talus.verification import read_history, start_on_ranks

sys.path.insert(0, str(Path(__file__).parents[1] / "faults/coupled"))
from run import children, make_model  # noqa: E402

TABLES = ("coupled_audit.csv", "grains_energy.csv", "solid_energy.csv")
HISTORY = "&history every_time = 5.0e-4 /\n"
END = 2.4e-2  # of the run [s], twelve checkpoints
SAME = ("grains_kinetic", "grains_elastic", "grains_friction", "solid_elastic", "momentum_z",
        "force_on_solid_z", "mean_ghost_force", "kinetic", "friction", "elastic", "strain", "load")
PROGRAMS = {"solid": "talus-fem", "grains": "talus-dem"}
LONG = 120.0  # for all to leave, on a machine with other work [s]


def write_model(folder: Path, side: str) -> None:
    """Write grains on a cube, and let the program of a side have two ranks."""
    make_model(folder, END)
    with (folder / "solid.nml").open("a") as deck:
        deck.write(HISTORY)
    start_on_ranks(folder / "coupled.nml", side, 2, find_program(PROGRAMS[side]))


def begin(folder: Path, *words: str) -> subprocess.Popen:
    """Start talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    seen = (folder / "seen.txt").open("w")
    return subprocess.Popen(command, cwd=folder, stdout=seen, stderr=subprocess.STDOUT)


def whole_run(folder: Path, *words: str) -> None:
    """Run to the end."""
    assert begin(folder, *words).wait(LONG) == 0, (folder / "seen.txt").read_text()


def wait_for_checkpoint(folder: Path, run: subprocess.Popen) -> dict[int, int]:
    """Return the processes of the side that has ranks, once there is a checkpoint."""
    until = time.monotonic() + LONG
    ranks: dict[int, int] = {}
    while len(ranks) < 2 or not list(folder.glob("coupled.*.manifest")):
        assert time.monotonic() < until and run.poll() is None, (folder / "seen.txt").read_text()
        time.sleep(0.005)
        launched = children(run.pid).get("mpirun")
        ranks = rank_processes(launched) if launched else {}
    return ranks


def judge_end(folder: Path, run: subprocess.Popen, code: int, pids: list[int]) -> None:
    """One fault at most, no process and no segment is left."""
    assert run.wait(LONG) == code, (folder / "seen.txt").read_text()
    text = (folder / "seen.txt").read_text()
    faults = re.findall(r"^error ([A-Z]\d{3}): (.*)$", text, re.MULTILINE)
    assert len(faults) == (code == 4), text
    until = time.monotonic() + LONG
    while any(is_alive(pid) for pid in pids):
        assert time.monotonic() < until
        time.sleep(0.02)
    assert not list(Path("/dev/shm").glob(f"talus-{run.pid}-*"))


@pytest.fixture(scope="module", params=PROGRAMS)
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """Return the side that has ranks and the folder of a run that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    write_model(folder, request.param)
    whole_run(folder)
    return {"folder": folder, "side": request.param}


def go_on(folder: Path, whole: dict) -> None:
    """A restart goes on to the same results."""
    whole_run(folder, "--restart=auto")
    for name in TABLES:
        one, other = folder / name, whole["folder"] / name
        if whole["side"] == "solid":
            assert one.read_bytes() == other.read_bytes(), name
            continue
        rows, wanted = read_history(one), read_history(other)
        for column in ("time", *SAME):
            if column in wanted:
                most = np.abs(wanted[column]).max()
                assert rows[column] == pytest.approx(wanted[column], abs=1e-9 * most), column


@pytest.fixture
def under_way(whole: dict, tmp_path: Path) -> tuple[Path, subprocess.Popen, dict[int, int]]:
    """Return folder, process and ranks of a run that has written a checkpoint."""
    folder = tmp_path / "run"
    write_model(folder, whole["side"])
    run = begin(folder)
    return folder, run, wait_for_checkpoint(folder, run)


@pytest.mark.parametrize("victim", [0, 1])
def test_a_rank_is_killed(victim: int, whole: dict, under_way: tuple) -> None:
    """The first, which speaks with the partner, or another; a restart goes on."""
    folder, run, ranks = under_way
    os.kill(ranks[victim], signal.SIGKILL)
    judge_end(folder, run, 4, list(ranks.values()))
    go_on(folder, whole)


def test_the_disk_is_full(whole: dict, under_way: tuple) -> None:
    """No room for the rank that writes: one message, a restart goes on."""
    folder, run, ranks = under_way
    most = int(0.9 * (whole["folder"] / f"{whole['side']}_energy.csv").stat().st_size)
    resource.prlimit(ranks[0], resource.RLIMIT_FSIZE, (most, most))
    judge_end(folder, run, 4, list(ranks.values()))
    text = (folder / "seen.txt").read_text()
    assert len(re.findall(r"^error S002: ", text, re.MULTILINE)) == 1, text
    go_on(folder, whole)


def test_a_request_to_stop(whole: dict, under_way: tuple) -> None:
    """All ranks leave with a checkpoint; the run goes on."""
    folder, run, ranks = under_way
    run.send_signal(signal.SIGTERM)
    judge_end(folder, run, 3, list(ranks.values()))
    go_on(folder, whole)
