"""A disk that fills up while fields are written: the file keeps every step that was whole."""

import resource
import subprocess
from pathlib import Path

import h5py
import numpy as np

from talus.programs import find_program
from talus.verification import write_packing

DECK = """&run       title = 'Full disk', t_end = 1.0e-3, gravity = 0.0, 0.0, -9.81 /
&material  id = 'q', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'q', 'q', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.05 /
&particles file = 'packing.h5', material = 'q' /
&dynamics  dt = 5.0e-6 /
&output    every_time = 1.0e-4 /
"""
STEPS = 11
BYTES_A_GRAIN = 150


def run(folder: Path, most: int, *options: str) -> subprocess.CompletedProcess:
    """Run talus-dem where no file may become larger than so many bytes."""
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    return subprocess.run(
        [find_program("talus-dem"), "deck.nml", *options],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard)),
    )


def whole_steps(path: Path) -> list[float]:
    """Return the times of all steps, each of which must be complete and readable."""
    with h5py.File(path) as file:
        for name, step in file["steps"].items():
            assert step.attrs["complete"] == 1, name
            assert np.isfinite(step["grains/x"][()]).all(), name
        return [float(step.attrs["time"]) for step in file["steps"].values()]


def test_steps_are_whole_or_absent(tmp_path):
    """Wherever the room ends: message, exit code 4, all earlier steps; then the run goes on."""
    line = 1.01e-3 * (1 + np.arange(12))
    x = np.array(np.meshgrid(line, line, line)).reshape(3, -1).T
    found = set()
    for number in range(6):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "deck.nml").write_text(DECK)
        write_packing(folder / "packing.h5", x, np.full((len(x), 3), 0.5e-3))
        most = 700_000 + int(number * 1.37 * BYTES_A_GRAIN * len(x))
        ended = run(folder, most)
        assert ended.returncode == 4, ended.stderr
        assert "error S002: no room to write 'deck.h5'" in ended.stderr
        times = whole_steps(folder / "deck.h5")
        assert 0 < len(times) < STEPS
        found.add(len(times))
        assert run(folder, 10**8, "--restart=auto").returncode == 0
        np.testing.assert_allclose(whole_steps(folder / "deck.h5"), 1e-4 * np.arange(STEPS))
    assert len(found) > 1
