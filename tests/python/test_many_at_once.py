"""Many talus-fem at once on one host, as in arrays of jobs: none may end for another's sake."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from talus.mesh import Mesh, structured, write_mesh
from talus.programs import find_program

RUNS, AT_ONCE = 96, 8
DECK = """&run title = 'Cube', gravity = 3.0, 0.0, -9.81 /
&mesh file = 'cube.h5' /
&material id = 's', law = 'linear_elastic', young = 1.0e9, poisson = 0.3, density = 2000.0 /
&section group = 'all', material = 's', element = 'hex8_full' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static', solver = 'direct' /
"""


def test_factorisations_start_together(tmp_path: Path) -> None:
    """MUMPS starts MPI; its folder of the whole host is shared no more (3 in 100 runs failed)."""
    line = np.linspace(0.0, 1.0, 3)
    x, hex8 = structured((line, line, line))
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    mesh.nodes["z0"] = np.flatnonzero(x[:, 2] < 1.0e-9)
    write_mesh(tmp_path / "cube.h5", mesh)
    (tmp_path / "deck.nml").write_text(DECK)

    def run(k: int) -> str:
        command = [find_program("talus-fem"), "deck.nml", "--threads=1", f"--output={tmp_path}/{k}"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        return "" if done.returncode == 0 else f"{done.returncode}: {done.stdout}{done.stderr}"

    with ThreadPoolExecutor(AT_ONCE) as pool:
        failures = [text for text in pool.map(run, range(RUNS)) if text]
    assert not failures, f"{len(failures)} of {RUNS}: {failures[0]}"
