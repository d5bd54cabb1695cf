"""A tile of 280 spheres at rest at 20 kPa, made once for all tests that use it."""

import os
from pathlib import Path

import pytest

from talus.cli import main

EDGE, STRESS = 0.012, 20.0e3  # [m], [Pa]


def sphere_tile(factory: pytest.TempPathFactory) -> Path:
    """Return the packing, making it if no test has yet."""
    folder = factory.getbasetemp() / "sphere_tile"
    if not folder.exists():
        folder.mkdir()
        here = Path.cwd()
        os.chdir(folder)
        words = "--count 280 --axes 1e-3 1e-3 1e-3 --spread 0.1 --young 2.9e8"
        made = main(["pack", "tile", *words.split(), "--making-friction", "0.2",
                     "--stress", str(STRESS), "--edge", str(EDGE), "--least-edges", "6",
                     "-o", "tile.h5"])  # fmt: skip
        os.chdir(here)
        assert made == 0
    return folder / "tile.h5"
