"""scikit-fem at the port (examples/16-scikit-fem), where a Python has it."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from own_solvers import DECKS, ROOT, enter, faults_of, imports, write_small_block

from talus.programs import find_program

OWN = os.environ.get("SKFEM_PYTHON", str(ROOT / "build/scikit-fem/bin/python"))
SOLID = [OWN, str(ROOT / "examples/16-scikit-fem/solid.py"), "block.toml"]
sys.path.insert(0, str(DECKS))
from same_load import moved  # noqa: E402

pytestmark = pytest.mark.skipif(
    not imports(OWN, "import skfem, h5py"), reason=f"{OWN} has no scikit-fem (pip: scikit-fem h5py)"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a small block and go to its folder."""
    write_small_block(tmp_path)
    enter(tmp_path, monkeypatch)
    return tmp_path


def test_same_displacements_as_talus_fem(folder: Path) -> None:
    """Both give the same displacements under the same load on one face."""
    load = np.zeros((36, 3))
    load[-12:] = np.outer(np.arange(12.0), [1.0, 0.5, -3.0])
    fem = [str(find_program("talus-fem")), "solid.nml"]
    one, other = (moved(command, load, False)[-1] for command in (fem, SOLID))
    assert np.abs(one).max() > 1e-6
    assert np.abs(one - other).max() < 1e-10 * np.abs(one).max()


def test_port_finds_no_fault(folder: Path) -> None:
    """Every verb, legal and illegal."""
    found = faults_of(SOLID, facets="hole")
    assert not found, found
