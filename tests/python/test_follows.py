"""Dynamics that begin from the end of a static run: at rest under the same loads."""

import subprocess
from pathlib import Path

import numpy as np

from talus.mesh import Mesh, structured, write_mesh
from talus.programs import find_program
from talus.verification import read_history

DECK = """&run title = 'Cube under its weight', t_end = {end}, gravity = 0.0, 0.0, -9.81 /
&mesh file = 'cube.h5' /
&material id = 's', law = 'linear_elastic', young = 1.0e7, poisson = 0.3, density = 2000.0 /
&section group = 'all', material = 's' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = '{kind}', dt = {dt}{follows} /
&history every_time = {dt} /
&checkpoint every_time = 0.5 /
"""


def test_newmark_stays_at_rest(tmp_path: Path) -> None:
    """Nothing moves after the restart: kinetic energy below 1e-20 of the strain energy."""
    line = np.linspace(0.0, 1.0, 3)
    x, hex8 = structured((line, line, line))
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    mesh.nodes["z0"] = np.flatnonzero(x[:, 2] < 1.0e-9)
    write_mesh(tmp_path / "cube.h5", mesh)
    static = DECK.format(kind="static", end=1.0, dt=0.5, follows="")
    moving = DECK.format(kind="newmark", end=1.05, dt=1.0e-3, follows=", follows = 'static'")
    for text, more in ((static, []), (moving, ["--restart=auto"])):
        (tmp_path / "deck.nml").write_text(text)
        command = [find_program("talus-fem"), "deck.nml", *more]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    energy = read_history(tmp_path / "deck_energy.csv")
    last = energy["time"] > 1.0
    assert last.sum() >= 49
    assert energy["kinetic"][last].max() < 1e-20 * energy["strain"].max()
