"""An elastic block of CalculiX at the port of Talus: its stiffness matrix, solved by SciPy.

Usage: solid.py block.toml --port=SPEC (talus-couple puts both behind the command).
"""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix

from talus.faults import FaultError
from talus.mesh import Mesh, read_mesh
from talus.port_frame import start
from talus.port_linear import Linear

NAME = "calculix_block"  # of the files that ccx reads and writes


class Block(Linear):
    """A block of C3D8: what ccx assembles, its base held."""

    program = "calculix"

    def __init__(self, block: Mesh, deck: dict) -> None:
        """Let ccx store the matrices of a mesh; the deck is that of block.toml."""
        super().__init__(block.x, block.hex8, block.facets)
        self.held[np.unique(block.facets[deck["base"]])] = True
        self.gravity = tuple(deck["gravity"])
        Path(f"{NAME}.inp").write_text(model(block, deck))
        said = subprocess.run(["ccx", NAME], capture_output=True, text=True, check=False).stdout
        if not Path(f"{NAME}.sti").exists() or "*ERROR" in said:
            raise FaultError("P490", "ccx has stored no matrix", said[-300:], f"{NAME}.inp", 2)
        self.matrix(stored("sti", self.x.size))
        self.mass = np.asarray(stored("mas", self.x.size).sum(axis=1)).reshape(-1, 3)[:, 0]


def model(block: Mesh, deck: dict) -> str:
    """Return the input of ccx, without supports, so that the matrices are whole."""
    nodes = [f"{k},{x:.13g},{y:.13g},{z:.13g}" for k, (x, y, z) in enumerate(block.x, 1)]
    cells = [f"{k},{','.join(map(str, e))}" for k, e in enumerate(block.hex8 + 1, 1)]
    return "\n".join([
        "*NODE, NSET=ALL", *nodes, "*ELEMENT, TYPE=C3D8, ELSET=ALL", *cells,
        "*MATERIAL, NAME=SOIL", "*ELASTIC", f"{deck['young']}, {deck['poisson']}",
        "*DENSITY", f"{deck['density']}", "*SOLID SECTION, ELSET=ALL, MATERIAL=SOIL",
        "*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP", "",
    ])  # fmt: skip


def stored(ending: str, size: int) -> coo_matrix:
    """Return a matrix (3n, 3n) that ccx has stored, by node and direction."""
    text = Path(f"{NAME}.dof").read_text().split()
    place = np.array([3 * (int(n) - 1) + int(d) - 1 for n, d in (word.split(".") for word in text)])
    row, column, value = np.loadtxt(f"{NAME}.{ending}").T
    row, column = place[row.astype(int) - 1], place[column.astype(int) - 1]
    half = coo_matrix((value, (row, column)), shape=(size, size)).tocsr()
    upper = half + half.T
    upper.setdiag(half.diagonal())
    return upper


def make() -> Block:
    """Read block.toml and the mesh that it names."""
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    return Block(read_mesh(Path(deck["mesh"])), deck)


if __name__ == "__main__":
    sys.exit(start(make))
