"""Ranks of a solid in a coupled run that die: one message, nothing stays behind, same bits."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_rank_faults import is_alive, rank_processes

from talus.programs import find_program
from talus.verification import start_on_ranks

sys.path.insert(0, str(Path(__file__).parents[1] / "faults/coupled"))
from run import children, make_model  # noqa: E402

TABLES = ("coupled_audit.csv", "grains_energy.csv", "solid_energy.csv")
HISTORY = "&history every_time = 5.0e-4 /\n"
END = 2.4e-2  # of the run [s], twelve checkpoints
LONG = 120.0  # for all to leave, on a machine with other work [s]


def write_model(folder: Path) -> None:
    """Write grains on a cube whose program has two ranks."""
    make_model(folder, END)
    with (folder / "solid.nml").open("a") as deck:
        deck.write(HISTORY)
    start_on_ranks(folder / "coupled.nml", "solid", 2, find_program("talus-fem"))


def begin(folder: Path, *words: str) -> subprocess.Popen:
    """Start talus-couple."""
    command = [str(find_program("talus-couple")), "coupled.nml", *words]
    seen = (folder / "seen.txt").open("w")
    return subprocess.Popen(command, cwd=folder, stdout=seen, stderr=subprocess.STDOUT)


def whole_run(folder: Path, *words: str) -> None:
    """Run to the end."""
    assert begin(folder, *words).wait(LONG) == 0, (folder / "seen.txt").read_text()


def wait_for_checkpoint(folder: Path, run: subprocess.Popen) -> dict[int, int]:
    """Return the processes of the solid by rank, once there is a checkpoint."""
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


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the tables of a run that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    write_model(folder)
    whole_run(folder)
    return {name: (folder / name).read_bytes() for name in TABLES}


@pytest.mark.parametrize("victim", [0, 1])
def test_a_rank_is_killed(victim: int, whole: dict[str, bytes], tmp_path: Path) -> None:
    """The first, which speaks with the partner, or another; a restart goes on to the same bits."""
    folder = tmp_path / "run"
    write_model(folder)
    run = begin(folder)
    ranks = wait_for_checkpoint(folder, run)
    os.kill(ranks[victim], signal.SIGKILL)
    judge_end(folder, run, 4, list(ranks.values()))
    whole_run(folder, "--restart=auto")
    for name in TABLES:
        assert (folder / name).read_bytes() == whole[name], name


def test_a_request_to_stop(whole: dict[str, bytes], tmp_path: Path) -> None:
    """All ranks leave with a checkpoint; the run goes on to the same bits."""
    folder = tmp_path / "run"
    write_model(folder)
    run = begin(folder)
    ranks = wait_for_checkpoint(folder, run)
    run.send_signal(signal.SIGTERM)
    judge_end(folder, run, 3, list(ranks.values()))
    whole_run(folder, "--restart=auto")
    for name in TABLES:
        assert (folder / name).read_bytes() == whole[name], name
