"""One rank runs out of memory: one message, exit code 4, nothing stays, the run goes on.

Both solvers, alone and in a coupled run; the memory is refused by a library that is preloaded
(tests/faults/memory), as a small model asks for no more once it runs.
"""

import os
import re
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from test_coupled_rank_faults import (
    LONG,
    begin,
    go_on,
    judge_end,
    wait_for_checkpoint,
    whole,
    write_model,
)
from test_rank_faults import is_alive, rank_processes, write_input

from talus.mesh import box, write_mesh
from talus.programs import find_program
from talus.verification import launcher, read_history

__all__ = ["whole"]  # a fixture
SOURCE = Path(__file__).parents[1] / "faults/memory/no_memory.c"
DEMAND = r"error S018: no memory for \S+ MiB more on rank {rank}, "
SOLID = """&run title = 'Cube that swings', t_end = {t_end}, gravity = 0.0, 0.0, -9.81 /
&mesh file = 'cube.h5' /
&material id = 'm', density = 1800.0, young = 1.0e6, poisson = 0.25 /
&section group = 'all', material = 'm', element = 'hex8_full' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'explicit', dt = 1.0e-4 /
&history every_time = 1.0e-2 /
&checkpoint every_time = 2.0e-2 /
"""


@pytest.fixture(scope="module")
def refusing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the library that refuses memory."""
    library = tmp_path_factory.mktemp("library") / "no_memory.so"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-shared", "-fPIC", "-O1"]
    subprocess.run(["gcc", *flags, str(SOURCE), "-o", str(library)], check=True)
    return library


def refuse(monkeypatch: pytest.MonkeyPatch, library: Path, rank: int, when: Path) -> None:
    """Let memory end on a rank when a file is there."""
    for name, value in (("LD_PRELOAD", library), ("NO_MEMORY_RANK", rank),
                        ("NO_MEMORY_FILE", when)):  # fmt: skip
        monkeypatch.setenv(name, str(value))


@pytest.mark.parametrize("victim", [0, 1])
def test_in_a_coupled_run(victim: int, whole: dict, refusing: Path, tmp_path: Path,
                          monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """The partner's fault has the message; a restart goes on to the same bits."""
    folder, now = tmp_path / "run", tmp_path / "now"
    write_model(folder, whole["side"])
    with monkeypatch.context() as patch:
        refuse(patch, refusing, victim, now)
        run = begin(folder)
    ranks = wait_for_checkpoint(folder, run)
    now.touch()
    judge_end(folder, run, 4, list(ranks.values()))
    text = (folder / "seen.txt").read_text()
    assert len(re.findall(DEMAND.format(rank=victim), text)) == 1, text
    go_on(folder, whole)


def write_case(folder: Path, program: str, t_end: float) -> None:
    """Write the deck of a solver alone, with what it names."""
    folder.mkdir(exist_ok=True)
    if program == "talus-dem":
        write_input(folder, 6, t_end)
        return
    write_mesh(folder / "cube.h5", box(np.zeros(3), np.ones(3), (4, 4, 4)))
    (folder / "deck.nml").write_text(SOLID.format(t_end=t_end))


def start(folder: Path, program: str, *words: str) -> subprocess.Popen:
    """Start a solver on two ranks."""
    return subprocess.Popen(
        [*launcher(2), str(find_program(program)), "deck.nml", *words], cwd=folder,
        env=dict(os.environ, OMP_NUM_THREADS="1"), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def last_state(folder: Path, program: str) -> dict[str, np.ndarray]:
    """Return what a checkpoint holds of grains, whose contacts stand in the order of the ranks, or
    of a solid.
    """
    with h5py.File(folder / "deck.chk.h5") as file:
        return {name: value[()] for name, value in file["state"].items()
                if program == "talus-fem" or name.startswith("grains.")}  # fmt: skip


@pytest.mark.parametrize("victim", [0, 1])
@pytest.mark.parametrize(("program", "end"), [("talus-dem", 2.0e-2), ("talus-fem", 0.5)])
def test_alone(program: str, end: float, victim: int, refusing: Path, tmp_path: Path,
               monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """One message; the last checkpoint is good, and what goes on from it ends at the same bits."""
    folder, now = tmp_path / "run", tmp_path / "now"
    write_case(folder, program, end)
    with monkeypatch.context() as patch:
        refuse(patch, refusing, victim, now)
        run = start(folder, program)
    until, ranks = time.monotonic() + LONG, {}
    while len(ranks) < 2 or not (folder / "deck.chk.h5").exists():
        assert time.monotonic() < until and run.poll() is None
        time.sleep(0.02)
        ranks = rank_processes(run.pid)
    now.touch()
    text, _ = run.communicate(timeout=LONG)
    assert run.returncode == 4, text
    assert len(re.findall("^" + DEMAND.format(rank=victim), text, re.MULTILINE)) == 1, text
    assert len(re.findall("^error ", text, re.MULTILINE)) == 1, text
    time.sleep(0.5)
    assert not any(is_alive(pid) for pid in ranks.values())
    again = start(folder, program, "--restart=auto")
    text, _ = again.communicate(timeout=LONG)
    assert again.returncode == 0 and "goes on from" in text, text
    write_case(tmp_path / "whole", program, end)
    other = start(tmp_path / "whole", program)
    text, _ = other.communicate(timeout=LONG)
    assert other.returncode == 0, text
    one, two = (last_state(path, program) for path in (folder, tmp_path / "whole"))
    assert one.keys() == two.keys() and len(one) > 3
    for name in one:
        assert np.array_equal(one[name], two[name]), name
    if program == "talus-fem":
        rows = [read_history(path / "deck_energy.csv") for path in (folder, tmp_path / "whole")]
        assert np.array_equal(rows[0]["kinetic"], rows[1]["kinetic"])
