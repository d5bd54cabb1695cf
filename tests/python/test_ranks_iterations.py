"""Conjugate gradients on ranks: what the ranks find at nodes they share is added with weights."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import Mesh, structured, write_mesh
from talus.programs import find_program
from talus.verification import launcher

CELLS = 16
DECK = """&run title = 'Cube', gravity = 3.0, 0.0, -9.81 /
&mesh file = 'cube.h5' /
&material id = 's', law = 'linear_elastic', young = 1.0e9, poisson = 0.3, density = 2000.0 /
&section group = 'all', material = 's', element = 'hex8_full' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static', solver = 'iterative' /
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a deck of a cube under its weight."""
    folder = tmp_path_factory.mktemp("cube")
    line = np.linspace(0.0, 1.0, CELLS + 1)
    x, hex8 = structured((line, line, line))
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    mesh.nodes["z0"] = np.flatnonzero(x[:, 2] < 1.0e-9)
    write_mesh(folder / "cube.h5", mesh)
    (folder / "deck.nml").write_text(DECK)
    return folder


def iterations(folder: Path, ranks: int) -> int:
    """Run the deck on ranks; return how many iterations it took."""
    command = [*launcher(ranks), str(find_program("talus-fem")), "deck.nml", "--threads=1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return int(json.loads((folder / "deck_summary.json").read_text())["health"]["iterations"])


def test_ranks_cost_few_iterations(folder: Path) -> None:
    """Additive Schwarz with weights 1/sqrt(ranks) costs 1.18 and 1.29 times the iterations on two
    and four ranks; with weights 1/ranks it would be 1.34 and 1.55."""  # fmt: skip
    alone = iterations(folder, 1)
    assert iterations(folder, 2) <= 1.26 * alone
    assert iterations(folder, 4) <= 1.42 * alone
