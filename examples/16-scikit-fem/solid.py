"""An elastic block of scikit-fem at the port of Talus: hexahedra, statics, pure Python.

Usage: solid.py block.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
from skfem import Basis, ElementHex1, ElementVector, MeshHex, asm
from skfem.models.elasticity import lame_parameters, linear_elasticity

from talus.mesh import Mesh, read_mesh
from talus.port_frame import start
from talus.port_linear import Linear

OWN = [0, 4, 3, 1, 7, 5, 2, 6]  # corners in the order of scikit-fem, by their places in VTK's


class Block(Linear):
    """Linear elasticity with 2 x 2 x 2 points: `hex8_full` of talus-fem."""

    program = "scikit_fem"

    def __init__(self, block: Mesh, deck: dict) -> None:
        """Assemble the stiffness of a mesh; the deck is that of block.toml."""
        super().__init__(block.x, block.hex8, block.facets)
        self.held[np.unique(block.facets[deck["base"]])] = True
        self.gravity = tuple(deck["gravity"])
        grid = MeshHex(block.x.T.copy(), block.hex8[:, OWN].T.copy())
        basis = Basis(grid, ElementVector(ElementHex1()), intorder=3)
        stiffness = asm(linear_elasticity(*lame_parameters(deck["young"], deck["poisson"])), basis)
        dofs = basis.nodal_dofs.T.ravel()  # of scikit-fem, by node and direction
        self.matrix(stiffness[dofs][:, dofs])
        volume = basis.dx.sum(axis=1) / 8
        np.add.at(self.mass, block.hex8, deck["density"] * volume[:, None])


def make() -> Block:
    """Read block.toml and the mesh that it names."""
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    return Block(read_mesh(Path(deck["mesh"])), deck)


if __name__ == "__main__":
    sys.exit(start(make))
