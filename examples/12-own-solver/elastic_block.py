"""A solid of another make at the port of Talus: an elastic block of hexahedra in plain numpy.

Usage: elastic_block.py block.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

from talus.mesh import box
from talus.port_frame import start
from talus.port_solid import Solid

CORNERS = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
                    [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])  # fmt: skip


class Block(Solid):
    """Linear elasticity, mean volumetric strain over each element (B-bar), base held."""

    program = "elastic_block"
    capabilities = Solid.capabilities + ",checkpoint"

    def __init__(self, size: list[float], cells: list[int], young: float, poisson: float,
                 density: float, gravity: list[float]) -> None:  # fmt: skip
        """Assemble the stiffness (3n, 3n); size = lower and upper corner [m], SI units."""
        mesh = box(np.array(size[:3]), np.array(size[3:]), tuple(cells))
        super().__init__(mesh.x, mesh.hex8, mesh.facets)
        self.gravity = tuple(gravity)
        self.held[mesh.nodes["z0"]] = True
        lam, mu = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
        d = np.diag([2 * mu] * 3 + [mu] * 3)
        d[:3, :3] += lam
        self.k = np.zeros((mesh.x.size, mesh.x.size))
        for nodes in mesh.hex8:
            weight, b = self.strains(mesh.x[nodes])
            dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
            self.k[np.ix_(dofs, dofs)] += np.einsum("q,qia,ij,qjb->ab", weight, b, d, b)
            self.mass[nodes] += density * weight.sum() / 8
        self.stiffness = np.diag(self.k).reshape(-1, 3).max(axis=1)
        self.weight = np.outer(self.mass, gravity)

    def strains(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return weights (8) and strains by displacements (8, 6, 24) of the points of an element."""
        xi = CORNERS / np.sqrt(3.0)
        f = 1.0 + xi[:, None] * CORNERS  # point, node, direction
        local = 0.125 * CORNERS * f[:, :, [1, 2, 0]] * f[:, :, [2, 0, 1]]
        jacobian = np.einsum("qad,ae->qde", local, x)
        weight, g = np.linalg.det(jacobian), local @ np.linalg.inv(jacobian).swapaxes(1, 2)
        b = np.zeros((8, 6, 8, 3))
        for row, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)]):
            b[:, row, :, i] += g[:, :, j]
            b[:, row, :, j] += g[:, :, i] if i != j else 0.0
        b[:, :3] += ((np.tensordot(weight, g, 1) / weight.sum() - g) / 3)[:, None]
        return weight, b.reshape(8, 6, 24)

    def balance(self, load: np.ndarray) -> int:
        """Solve K u = load + weight, with springs about the accepted state."""
        k, force = self.k.copy(), (load + self.weight).ravel()
        for nodes, weight, stiffness in self.springs:
            for d in range(3):
                dofs = 3 * nodes + d
                k[np.ix_(dofs, dofs)] += stiffness * np.outer(weight, weight)
                force[dofs] += stiffness * weight * (weight @ self.accepted[nodes, d])
        free = ~self.held.ravel()
        self.u.reshape(-1)[free] = np.linalg.solve(k[np.ix_(free, free)], force[free])
        return 1

    def elastic_energy(self) -> float:
        """Return half of u K u [J]."""
        return float(0.5 * self.u.ravel() @ self.k @ self.u.ravel())


if __name__ == "__main__":
    sys.exit(start(lambda: Block(**tomllib.loads(Path(sys.argv[1]).read_text()))))
