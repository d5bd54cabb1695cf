"""Tiles at rest that tests take ready, since they take two minutes to make.

`python kept_tiles.py` (with PYTHONPATH and TALUS_BIN as for the tests) makes all of them anew; that
tiles are made well is tested in test_tile.
"""

import shutil
import sys
from pathlib import Path

from talus.cli import main

FOLDER = Path(__file__).resolve().parent / "tiles"
SEAM = """--count 300 --axes 1e-3 1e-3 1e-3 --spread 0.2 --stress 100e3 --young 2.9e9
          --making-friction 0.15 --least-edges 4 --edge 0.025 --aspect 2 1 1"""
WORDS = {  # of `talus pack tile`
    "seam_1": f"{SEAM} --seed 1",
    "seam_2": f"{SEAM} --seed 2",
    "column": """--count 200 --axes 1e-3 1e-3 1e-3 --spread 0.2 --stress 100 --young 2.9e7 --seed 5
                 --making-friction 0.1 --edge 0.02 --least-edges 5""",
    "spheres": """--count 280 --axes 1e-3 1e-3 1e-3 --spread 0.1 --stress 20e3 --young 2.9e8
                  --making-friction 0.2 --edge 0.012 --least-edges 6""",
}


def take_tile(name: str, target: Path) -> Path:
    """Copy a tile to a path of its own; return the path."""
    shutil.copyfile(FOLDER / f"{name}.h5", target)
    return target


if __name__ == "__main__":
    sys.exit(
        max(
            main(["pack", "tile", *words.split(), "-o", str(FOLDER / f"{name}.h5")])
            for name, words in WORDS.items()
        )
    )
