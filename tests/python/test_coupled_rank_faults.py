"""Ranks of a side of a coupled run that die or have no room: one message, then the same bits.

Bits do not depend on the deal of the grains over ranks, either: one rank, several ranks and a
restart, which deals them out anew, agree. Listed sums over contacts (works, kinetic and elastic
energy) are added rank by rank, and agree but for round-off.
"""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
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
SHORT = 8.0e-3  # of a run whose grains have fallen on the cube [s]
FELT = 1.0e-2  # force on the cube of grains that have [N]
WORKS = re.compile(  # sums over grains and contacts, of the grains' ledger
    r"(grains_)?(kinetic|elastic(_normal|_tangential)?|friction|contact_damping"
    r"|background_damping|curvature|tangential_relaxation|boundary(_work)?|gravity(_work)?"
    r"|staggering|closure_error)"
)
MOVED = [0, 1, 3, 4]  # of vertices: place, velocity, force, impulse; not where the list was made
ROUND_OFF = 1.0e-12  # of sums of some 10^5 terms; of the largest work
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


def same_bits(one: Path, other: Path, side: str) -> None:
    """Compare tables and the grains of the last checkpoint of two runs; sums but for round-off."""
    for name in TABLES:
        rows, wanted = read_history(one / name), read_history(other / name)
        assert list(rows) == list(wanted)
        works = [k for k in wanted if WORKS.fullmatch(k) and name[0] != "s" and side == "grains"]
        most = max((np.abs(wanted[k]).max() for k in works), default=0.0)
        for column in wanted:
            if column in works:
                assert rows[column] == pytest.approx(wanted[column], abs=ROUND_OFF * most), column
            elif column != "relative_closure" or side == "solid":
                assert np.array_equal(rows[column], wanted[column]), (name, column)
    last = [max(folder.glob("grains.x*.chk.h5"), key=exchanges) for folder in (one, other)]
    assert last[0].name == last[1].name
    with h5py.File(last[0]) as a, h5py.File(last[1]) as b:
        kept = {name: slice(None) for name in a["state"] if name.startswith("grains.")}
        assert len(kept) > 10
        if "surfaces.vertex" in a["state"]:
            kept["surfaces.vertex"] = MOVED
        for name, rows in kept.items():
            assert np.array_equal(a["state"][name][rows], b["state"][name][rows]), name


def exchanges(path: Path) -> int:
    """Return the number of exchanges before a checkpoint."""
    return int(re.search(r"\.x(\d+)\.", path.name)[1])


def go_on(folder: Path, whole: dict) -> None:
    """A restart goes on to the same bits."""
    whole_run(folder, "--restart=auto")
    same_bits(folder, whole["folder"], whole["side"])


@pytest.mark.parametrize("meets", ["ghosts", "surface"])
def test_the_deal_changes_no_bit(meets: str, tmp_path: Path) -> None:
    """One, two and three ranks of grains, which fall on ghosts of the cube or on its facets."""
    for ranks in (1, 2, 3):
        folder = tmp_path / str(ranks)
        make_model(folder, SHORT, surface=meets == "surface")
        with (folder / "solid.nml").open("a") as deck:
            deck.write(HISTORY)
        if ranks > 1:
            start_on_ranks(folder / "coupled.nml", "grains", ranks, find_program("talus-dem"))
        whole_run(folder)
        assert np.abs(read_history(folder / TABLES[0])["force_on_solid_z"]).max() > FELT
        same_bits(folder, tmp_path / "1", "grains")


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
