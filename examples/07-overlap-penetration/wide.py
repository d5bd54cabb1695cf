"""The chord with a wider free zone, in OUT/wide: packing, mesh and decks.

Usage: wide.py OUT. Grains are free to 30 mm from the middle, five radii of the tool, and ghosts end
at 37.5 mm; below, the zones are as deep as they are wide. OUT/chord has the constants of the soil.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import prepare

from talus.mesh import write_mesh
from talus.packing import read_packing, write_packing_file

FREE_EDGE, NEAR_EDGE, GHOST_EDGE = 0.030, 0.0375, 0.045  # half-widths [m]


def widen() -> float:
    """Let prepare.py cut and mesh with these widths; return the one that it had [m]."""
    before = prepare.FREE_EDGE
    prepare.FREE_EDGE, prepare.NEAR_EDGE, prepare.GHOST_EDGE = FREE_EDGE, NEAR_EDGE, GHOST_EDGE
    prepare.LINES = np.array([prepare.INNER, FREE_EDGE, NEAR_EDGE, GHOST_EDGE, 0.0525,
                              prepare.OUTER])  # fmt: skip
    return before


def main() -> int:
    """Write packing, mesh and decks."""
    out = Path(sys.argv[1])
    folder = out / "wide"
    folder.mkdir(exist_ok=True)
    before = widen()
    bed = read_packing(out / "pressed.h5")
    top = prepare.top_of(bed)
    level = prepare.levels(top, False)
    packing = prepare.core(bed, level, NEAR_EDGE)
    write_packing_file(folder / "core_pack.h5", packing)
    write_mesh(folder / "surround.h5", prepare.surround(top, level))
    text = (out / "grains.nml").read_text().replace(f"{before}", f"{FREE_EDGE}")
    (folder / "grains.nml").write_text(text)
    shutil.copy(out / "chord/chord_solid.nml", folder)
    shutil.copy(out / "chord.nml", folder)
    print(f"wide/core_pack.h5: {packing.count} grains")
    return 0


if __name__ == "__main__":
    sys.exit(main())
