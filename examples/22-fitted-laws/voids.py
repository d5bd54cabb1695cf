"""Print the void ratio at the start of a test of 500 ellipsoids: voids.py *_cell.csv."""

import sys
from pathlib import Path

import numpy as np

from talus.histories import read

SOLID = 500 * 4.0 / 3.0 * np.pi * 2.5e-3 * 2.0e-3 * 1.5e-3  # [m3]

print(f"{read(Path(sys.argv[1]))['volume'][0] / SOLID - 1.0:.5f}")
