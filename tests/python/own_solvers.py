"""What the tests of solvers of another make share: is one there, and a small block for it."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import box, write_mesh
from talus.port_test import Options, test_solver
from talus.programs import find_program

ROOT = Path(__file__).parents[2]
DECKS = ROOT / "examples/14-fenicsx"  # block.toml, solid.nml


def imports(python: str, code: str) -> bool:
    """Return whether a Python runs a piece of code."""
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, check=False)
    except OSError:
        return False
    return done.returncode == 0


def enter(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Go to a folder where solvers find the package and the programs."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "prepost"))
    monkeypatch.setenv("TALUS_BIN", str(find_program("talus-fem").resolve().parent))
    monkeypatch.chdir(folder)


def write_small_block(folder: Path) -> None:
    """Write a block of 36 nodes with the groups that the decks name, and the decks."""
    block = box(np.array([-0.01, -0.01, -0.01]), np.array([0.01, 0.01, 0.0]), (2, 3, 2))
    block.facets = {"outer": block.facets["z0"], "hole": block.facets["z1"]}
    block.volumes = {"block": block.volumes["all"]}
    write_mesh(folder / "block.h5", block)
    for name in ("block.toml", "solid.nml"):
        (folder / name).write_text((DECKS / name).read_text())


def faults_of(command: list[str], **choices: str) -> list[tuple[str, str]]:
    """Return what `talus port-test` finds of a solver that takes its time to start."""
    return test_solver(command, Options(time_limit=30.0, **choices))[0]
