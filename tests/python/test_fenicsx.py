"""FEniCSx at the port (examples/14-fenicsx), where a Python of the system has dolfinx."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from own_solvers import DECKS, enter, faults_of, imports, write_small_block

SYSTEM = os.environ.get("FENICSX_PYTHON", "/usr/bin/python3")
pytestmark = pytest.mark.skipif(
    not imports(SYSTEM, "import dolfinx, h5py, scipy"),
    reason=f"{SYSTEM} has no dolfinx (apt: python3-dolfinx python3-h5py python3-scipy)",
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a small block and go to its folder."""
    write_small_block(tmp_path)
    enter(tmp_path, monkeypatch)
    return tmp_path


def test_same_displacements_as_talus_fem(folder: Path) -> None:
    """Both laws, statics and central differences, give those of talus-fem under the same load."""
    command = [sys.executable, str(DECKS / "same_load.py"), ".", "1500.0"]
    done = subprocess.run(command, check=False)
    rows = (folder / "same_load.csv").read_text().splitlines()[1:]
    assert done.returncode == 0 and len(rows) == 4
    assert all(float(row.rsplit(",", 1)[1]) <= 1e-6 for row in rows), rows


@pytest.mark.parametrize("explicit", ["false", "true"])
def test_port_finds_no_fault(explicit: str, folder: Path) -> None:
    """Every verb, legal and illegal."""
    deck = (folder / "block.toml").read_text().replace('"elastic"', '"neo_hookean"')
    (folder / "own.toml").write_text(deck.replace("explicit = false", f"explicit = {explicit}"))
    found = faults_of([SYSTEM, str(DECKS / "solid.py"), "own.toml"], facets="hole")
    assert not found, found
