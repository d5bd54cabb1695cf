"""The deck maker of tools/bench_coupled.py: a small pit runs, and its grains get what they give."""

import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.mesh import read_mesh
from talus.programs import find_program
from talus.verification import read_history

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
import bench_coupled  # noqa: E402


def test_a_small_pit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every ghost is on a facet; momentum is the impulse of weight and forces of the pit."""
    monkeypatch.setattr(bench_coupled, "BLOCK", (6, 6, 5))
    monkeypatch.setattr(bench_coupled, "PIT", (4, 4, 3))
    bench_coupled.write(Namespace(out=tmp_path, wide=9, deep=7, exchanges=20, steps=5))
    mesh = read_mesh(tmp_path / "mesh.h5")
    assert len(mesh.cells["hex8"]) == 6 * 6 * 5 - 4 * 4 * 3
    assert len(mesh.facets["pit"]) == 4 * 4 + 4 * 4 * 3
    with h5py.File(tmp_path / "pit.h5") as file:
        ghosts = file["groups/ghosts"].size
    assert ghosts == 10 * 10 + 4 * 9 * 7
    run = [str(find_program("talus-couple")), "coupled.nml"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"{ghosts}   on {len(mesh.facets['pit'])} facets" in done.stdout
    audit = read_history(tmp_path / "coupled_audit.csv")
    radius, exchange = bench_coupled.RADIUS, 5 * bench_coupled.DT
    mass = bench_coupled.DENSITY * 4 / 3 * np.pi * radius**3 * (800 - ghosts)
    weight = mass * bench_coupled.GRAVITY
    for axis, load in (("x", 0.0), ("y", 0.0), ("z", -weight)):
        gained = np.diff(np.append(0.0, audit[f"momentum_{axis}"]))
        given = (load - audit[f"force_on_solid_{axis}"]) * exchange
        assert np.abs(gained - given).max() < 1.0e-9 * weight * exchange
    assert audit["force_on_solid_z"][-1] < -0.01 * weight  # the grains lean on the pit
