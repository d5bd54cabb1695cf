"""A tile of 280 spheres at rest at 20 kPa."""

from pathlib import Path

import pytest
from kept_tiles import take_tile

EDGE, STRESS = 0.012, 20.0e3  # [m], [Pa]


def sphere_tile(factory: pytest.TempPathFactory) -> Path:
    """Return the packing in a folder of its own."""
    return take_tile("spheres", factory.mktemp("sphere_tile") / "tile.h5")
