"""Write the element test of a bed between plates, periodic to the sides.

Usage: crushed.py OUT.csv, in the folder of the run. Axial stress is the mean on the two plates;
lateral stresses have the ratio to it of the mean stress of the bed (*_cell.csv).
"""

import sys
from pathlib import Path

import numpy as np

from talus.histories import read

AREA = 22.36e-3**2  # [m2]
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")


def main() -> None:
    """Write the table."""
    walls, cell = read(Path("compress_walls.csv")), read(Path("compress_cell.csv"))
    floor, top = walls["wall"] == 1, walls["wall"] == 2
    axial = 0.5 * (walls["force_z"][floor] - walls["force_z"][top]) / AREA
    height = walls["z"][top]
    zero = np.zeros_like(axial)
    strain = [zero, zero, np.log(height / height[0]), zero, zero, zero]
    lateral = [axial * cell[f"stress_{c}"] / cell["stress_zz"] for c in ("xx", "yy")]
    stress = [*lateral, axial, zero, zero, zero]
    heads = ["time [s]"] + [f"strain {c} [-]" for c in COMPONENTS]
    heads += [f"stress {c} [Pa]" for c in COMPONENTS]
    rows = np.column_stack([walls["time"][floor], *strain, *stress])
    lines = [",".join(heads)] + [",".join(f"{value:.12g}" for value in row) for row in rows]
    Path(sys.argv[1]).write_text("\n".join(lines) + "\n")


main()
