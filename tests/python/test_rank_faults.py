"""Ranks that die or have nothing to do: no rank stays behind, a run goes on from its checkpoint."""

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from talus.programs import find_program
from talus.verification import launcher, write_packing

DECK = """&run       title = 'Spheres that fly apart', t_end = {t_end} /
&material  id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = 0.1 /
&particles file = 'pack.h5', material = 'quartz' /
&dynamics  dt = 2.0e-6 /
&checkpoint every_time = 2.0e-4 /
"""
RADIUS = 1.0e-3
LONG = 30.0  # for ranks to leave [s]


def write_input(folder: Path, side: int, t_end: float) -> None:
    """Write deck and packing: a cube of spheres that move slowly."""
    rng = np.random.default_rng(5)
    axes = np.meshgrid(*3 * [np.arange(side)])
    x = 2.0 * RADIUS * np.column_stack([a.ravel() for a in axes])
    write_packing(folder / "pack.h5", x, np.full(x.shape, RADIUS),
                  v=rng.normal(scale=1e-3, size=x.shape))  # fmt: skip
    (folder / "deck.nml").write_text(DECK.format(t_end=t_end))


def start(folder: Path, ranks: int, *words: str) -> subprocess.Popen:
    """Start a run on ranks."""
    return subprocess.Popen(
        [*launcher(ranks), str(find_program("talus-dem")), "deck.nml", *words], cwd=folder,
        env=dict(os.environ, OMP_NUM_THREADS="1"), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def rank_processes(launched: int) -> dict[int, int]:
    """Return rank -> process of what a launcher has started."""
    found = {}
    children = Path(f"/proc/{launched}/task/{launched}/children")
    for pid in children.read_text().split() if children.exists() else []:
        words = Path(f"/proc/{pid}/environ")
        text = words.read_bytes() if words.exists() else b""
        rank = re.search(rb"OMPI_COMM_WORLD_RANK=(\d+)", text)
        if rank:
            found[int(rank[1])] = int(pid)
    return found


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.parametrize("victim", [0, 1])
def test_a_rank_is_killed(tmp_path: Path, victim: int) -> None:
    """The first or another: the others leave, and the last checkpoint is good."""
    write_input(tmp_path, 6, 10.0)
    run = start(tmp_path, 2)
    until = time.monotonic() + 120.0
    ranks: dict[int, int] = {}
    while len(ranks) < 2 or not (tmp_path / "deck.chk.h5").exists():
        assert time.monotonic() < until and run.poll() is None
        time.sleep(0.05)
        ranks = rank_processes(run.pid)
    os.kill(ranks[victim], signal.SIGKILL)
    output, _ = run.communicate(timeout=LONG)
    assert run.returncode != 0
    assert output.count("signal 9 (Killed)") == 1
    time.sleep(0.5)
    assert not any(is_alive(pid) for pid in ranks.values())
    (tmp_path / "deck.nml").write_text(DECK.format(t_end=1.0e-4))
    again = start(tmp_path, 3, "--restart=auto")
    output, _ = again.communicate(timeout=120.0)
    assert again.returncode == 0, output
    assert "goes on from" in output


def test_more_ranks_than_grains(tmp_path: Path) -> None:
    """Eight grains on twelve ranks: some have none, the run ends well and says so."""
    write_input(tmp_path, 2, 1.0e-4)
    run = start(tmp_path, 12)
    output, _ = run.communicate(timeout=300.0)
    assert run.returncode == 0, output
    shared = json.loads((tmp_path / "deck_summary.json").read_text())["ranks"]
    assert shared["count"] == 12
    assert re.search(r"ranks +12, exchange .* 0 to [1-8] grains", output)
