"""FEniCSx at the port (examples/14-fenicsx), where a Python of the system has dolfinx."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import box, write_mesh
from talus.port_test import Options
from talus.port_test import test_solver as find_faults
from talus.programs import find_program

ROOT = Path(__file__).parents[2]
HERE = ROOT / "examples/14-fenicsx"
SYSTEM = os.environ.get("FENICSX_PYTHON", "/usr/bin/python3")


def has_dolfinx() -> bool:
    """Return whether the Python of the system has what solid.py imports."""
    test = [SYSTEM, "-c", "import dolfinx, h5py, scipy"]
    try:
        return subprocess.run(test, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


pytestmark = pytest.mark.skipif(
    not has_dolfinx(), reason=f"{SYSTEM} has no dolfinx (apt: python3-dolfinx python3-h5py)"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a small block with the groups of the example's decks, go to its folder."""
    block = box(np.array([-0.01, -0.01, -0.01]), np.array([0.01, 0.01, 0.0]), (2, 3, 2))
    block.facets = {"outer": block.facets["z0"], "hole": block.facets["z1"]}
    block.volumes = {"block": block.volumes["all"]}
    write_mesh(tmp_path / "block.h5", block)
    for name in ("block.toml", "solid.nml"):
        (tmp_path / name).write_text((HERE / name).read_text())
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "prepost"))
    monkeypatch.setenv("TALUS_BIN", str(find_program("talus-fem").resolve().parent))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_same_displacements_as_talus_fem(folder: Path) -> None:
    """Both laws, statics and central differences, give those of talus-fem under the same load."""
    command = [sys.executable, str(HERE / "same_load.py"), ".", "1500.0"]
    done = subprocess.run(command, check=False)
    rows = (folder / "same_load.csv").read_text().splitlines()[1:]
    assert done.returncode == 0 and len(rows) == 4
    assert all(float(row.rsplit(",", 1)[1]) <= 1e-6 for row in rows), rows


@pytest.mark.parametrize("explicit", ["false", "true"])
def test_port_finds_no_fault(explicit: str, folder: Path) -> None:
    """Every verb, legal and illegal."""
    deck = (folder / "block.toml").read_text().replace('"elastic"', '"neo_hookean"')
    (folder / "own.toml").write_text(deck.replace("explicit = false", f"explicit = {explicit}"))
    command = [SYSTEM, str(HERE / "solid.py"), "own.toml"]
    found = find_faults(command, Options(facets="hole", time_limit=30.0))[0]
    assert not found, found
