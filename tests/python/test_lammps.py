"""Grains of another make at the port; LAMMPS (examples/15-lammps) where it is installed."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from own_solvers import ROOT, enter, faults_of, imports

from talus.port_grains import rotation, turned
from talus.programs import find_program
from talus.verification import read_history

HERE = ROOT / "examples/15-lammps"
SYSTEM = os.environ.get("LAMMPS_PYTHON", "/usr/bin/python3")
PROBE = "import h5py, scipy, lammps; lammps.lammps(cmdargs=['-screen', 'none', '-log', 'none'])"


needs_lammps = pytest.mark.skipif(
    not imports(SYSTEM, PROBE), reason=f"{SYSTEM} has no lammps (apt: python3-lammps liblammps-dev)"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the input of the example, go to the folder of the ball."""
    subprocess.run([sys.executable, str(HERE / "prepare.py"), str(tmp_path)], check=True)
    for deck in (*HERE.glob("*.nml"), *HERE.glob("*.toml")):
        text = deck.read_text().replace("friction = 0.5", "friction = 0.0")
        (tmp_path / "ball" / deck.name).write_text(text)
    enter(tmp_path / "ball", monkeypatch)
    return tmp_path / "ball"


def test_turns_lead_where_they_should() -> None:
    """Turning by the rotation between two orientations leads from one to the other."""
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 50, 4))
    first /= np.linalg.norm(first, axis=1)[:, None]
    second /= np.linalg.norm(second, axis=1)[:, None]
    second[0] = -first[0]
    theta = rotation(first, second)
    assert np.linalg.norm(theta, axis=1).max() <= np.pi and np.abs(theta[0]).max() < 1e-7
    assert np.abs(np.abs(np.sum(turned(first, theta) * second, axis=1)) - 1.0).max() < 1e-14
    quarter = turned(np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([[0.0, 0.0, np.pi / 2]]))
    assert np.allclose(quarter, [[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]], atol=1e-15)


@needs_lammps
def test_ball_as_with_talus_dem(folder: Path) -> None:
    """A ball on an elastic block: force and displacement are those of talus-dem."""
    starts = {
        "grains.nml": "threads = 1",
        "grains.toml": f"launch = 'command', command = '{SYSTEM} {HERE / 'grains.py'}'",
    }
    audits = []
    for deck, start in starts.items():
        text = (folder / "coupled.nml").read_text().replace("@deck@", deck)
        text = text.replace("t_end = 0.015", "t_end = 0.004").replace("@start@", start)
        name = f"run_{deck.partition('.')[2]}"
        (folder / f"{name}.nml").write_text(text)
        subprocess.run([find_program("talus-couple"), f"{name}.nml"], check=True,
                       capture_output=True)  # fmt: skip
        audits.append(read_history(folder / f"{name}_audit.csv"))
    for column in ("force_on_solid_z", "largest_ghost_displacement"):
        one, other = (audit[column] for audit in audits)
        assert np.abs(one).max() > (0.1 if column == "force_on_solid_z" else 1e-4)
        assert np.abs(one - other).max() < 1e-6 * np.abs(one).max()


@needs_lammps
def test_port_finds_no_fault(folder: Path) -> None:
    """Every verb, legal and illegal."""
    found = faults_of([SYSTEM, str(HERE / "grains.py"), "grains.toml"], group="ghosts")
    assert not found, found


@needs_lammps
def test_ellipsoids_are_refused(folder: Path) -> None:
    """A grain that is no sphere is named before anything runs (E625)."""
    text = (
        "from pathlib import Path; from talus.packing import read_h5, write_h5\n"
        "p = read_h5(Path('pack.h5')); p.axes[3, 0] *= 1.1; write_h5(Path('pack.h5'), p)"
    )
    subprocess.run([sys.executable, "-c", text], check=True)
    command = [SYSTEM, str(HERE / "grains.py"), "grains.toml", "--port=hdf5:none/grains"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "E625" in done.stderr and "no sphere" in done.stderr
