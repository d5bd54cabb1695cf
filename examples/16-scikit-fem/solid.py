"""An elastic block of scikit-fem at the port of Talus: hexahedra, statics, pure Python.

Usage: solid.py block.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu
from skfem import Basis, ElementHex1, ElementVector, MeshHex, asm
from skfem.models.elasticity import lame_parameters, linear_elasticity

from talus.mesh import Mesh, read_mesh
from talus.port import Message, Values
from talus.port_frame import start
from talus.port_solid import Solid

OWN = [0, 4, 3, 1, 7, 5, 2, 6]  # corners in the order of scikit-fem, by their places in VTK's


class Block(Solid):
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
        self.k = csr_matrix(stiffness[dofs][:, dofs])
        volume = basis.dx.sum(axis=1) / 8
        np.add.at(self.mass, block.hex8, deck["density"] * volume[:, None])
        self.stiffness = self.k.diagonal().reshape(-1, 3).max(axis=1)
        self.holding, self.factors = csr_matrix(self.k.shape), None

    def set(self, request: Message) -> Values:
        """Take springs or the dead load of a set; springs stand in the matrix."""
        reply = super().set(request)
        entries = [(k * np.outer(w, w), *np.meshgrid(3 * n, 3 * n)) for n, w, k in self.springs]
        value, column, row = (np.concatenate([e[i].ravel() for e in entries] or [np.zeros(0, int)])
                              for i in range(3))  # fmt: skip
        places = [np.concatenate([place + d for d in range(3)]) for place in (row, column)]
        self.holding = csr_matrix((np.tile(value, 3), places), shape=self.k.shape)
        self.factors = None
        return reply

    def balance(self, load: np.ndarray) -> int:
        """Solve K u = load + weight, with springs about the accepted state."""
        free = np.flatnonzero(~self.held)
        if self.factors is None:
            self.factors = splu(csc_matrix((self.k + self.holding)[free][:, free]))
        force = (load + np.outer(self.mass, self.gravity)).ravel()
        force += self.holding @ self.accepted.ravel()
        self.u.reshape(-1)[free] = self.factors.solve(force[free])
        return 1

    def elastic_energy(self) -> float:
        """Return half of u K u [J]."""
        return float(0.5 * self.u.ravel() @ (self.k @ self.u.ravel()))


def make() -> Block:
    """Read block.toml and the mesh that it names."""
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    return Block(read_mesh(Path(deck["mesh"])), deck)


if __name__ == "__main__":
    sys.exit(start(make))
