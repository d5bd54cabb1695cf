"""Seepage faces whose nodes change sides: threads and a restart leave every bit."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.programs import find_program
from talus.verification import read_history

DECK = """&run title = 'Slice', t_end = 40.0, gravity = 0.0, 0.0, -9.81 /
&mesh file = 'slice.h5' /
&material id = 'soil', density = 1600.0, young = 10.0e9, poisson = 0.3 /
&section group = 'all', material = 'soil', element = 'hex8_bbar' /
&fluid id = 'water', viscosity = 1.0e-3, bulk_modulus = 2.2e9 /
&pore material = 'soil', fluid = 'water', porosity = 0.3, permeability = 1.0e-12,
  retention = 'van_genuchten', van_genuchten = 1.0e-2, 6.0 /
&support group = 'all', fix = 'x', 'y', 'z' /
&water_table level = 1.0 /
&pore_pressure group = 'x0', head = 0.9 /
&seepage group = 'x1' /
&infiltration group = 'z1', rate = 3.0e-6 /
&analysis kind = 'static', dt = 10.0 /
&history every_time = 1.0 /
&output every_time = 10.0 /
&checkpoint every_time = 20.0, keep = 5 /
"""


def run(folder: Path, *words: str) -> tuple[dict[str, bytes], dict]:
    """Run the slice; return its histories and its health."""
    done = subprocess.run([find_program("talus-fem"), "deck.nml", *words], cwd=folder,
                          env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
                          capture_output=True, text=True, timeout=120)  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    health = json.loads((folder / "deck_summary.json").read_text())["health"]
    del health["factorisations"]  # those of this run alone
    return {p.name: p.read_bytes() for p in folder.glob("deck_*.csv")}, health


def test_bits(tmp_path: Path) -> None:
    """Two threads, and a run from half-way, write the same histories and count the same leaks."""
    box = meshes.box(np.zeros(3), np.array([1.0, 1.0 / 3.0, 1.0]), (3, 1, 3))
    meshes.write_mesh(tmp_path / "slice.h5", box)
    (tmp_path / "deck.nml").write_text(DECK)
    whole, health = run(tmp_path)
    assert health["face_leaks"] > 0 and health["liquid_balance"] < 1e-12
    books = read_history(tmp_path / "deck_pore.csv")
    assert books["x1 seepage inflow"].max() <= 0 and books["x1 seepage inflow"].min() < 0
    assert books["z1 infiltration inflow"].max() <= 3.0e-6 / 3 * (1 + 1e-12)
    assert run(tmp_path, "--threads=2") == (whole, health)
    half = min(tmp_path.glob("deck.chk.*.h5"), key=lambda p: p.stat().st_mtime)
    half = half.rename(tmp_path / "half.h5")
    assert run(tmp_path, f"--restart={half.name}") == (whole, health)
