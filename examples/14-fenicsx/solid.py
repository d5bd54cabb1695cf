"""A block of FEniCSx at the port of Talus: elastic or neo-Hookean, static or explicit.

Usage: solid.py block.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
from body import Body
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, identity, kron

from talus.faults import FaultError
from talus.mesh import read_mesh
from talus.port import Message, Values
from talus.port_explicit import Explicit
from talus.port_frame import start
from talus.port_solid import Solid


def lost(why: str) -> FaultError:
    """Return the fault that ends the coupled run."""
    return FaultError("P490", why, "shorten the exchange or stiffen the block", "fenicsx", 2)


class Static(Solid):
    """The block in balance: Newton's method, springs of the interface in the tangent.

    Factors stay as long as they bring the balance nearer fast: one where K is constant.
    """

    program = "fenicsx"

    def __init__(self, body: Body) -> None:
        """Take what the port wants from dolfinx."""
        super().__init__(body.block.x, body.block.hex8, body.block.facets)
        self.body, self.held, self.mass, self.gravity = body, body.held, body.mass, body.gravity
        self.stiffness, self.factored = body.diagonal(), False
        self.holding = csr_matrix((len(self.mass),) * 2)  # springs, the same along x, y, z [N/m]
        self.solver = PETSc.KSP().create(MPI.COMM_SELF)
        self.solver.setType("preonly")
        self.solver.getPC().setType("cholesky")
        self.solver.getPC().setFactorSolverType("mumps")

    def set(self, request: Message) -> Values:
        """Take springs or the dead load of a set."""
        reply = super().set(request)
        entries = [(k * np.outer(w, w), *np.meshgrid(n, n)) for n, w, k in self.springs]
        value, column, row = (np.concatenate([e[i].ravel() for e in entries] or [np.zeros(0, int)])
                              for i in range(3))  # fmt: skip
        self.holding = csr_matrix((value, (row, column)), shape=self.holding.shape)
        self.factored = False
        return reply

    def balance(self, load: np.ndarray, tolerance: float = 1e-12, most: int = 30) -> int:
        """Solve internal force = load + weight, with springs about the accepted state."""
        load = load + np.outer(self.mass, self.gravity)
        round_off = 1e-15 * self.stiffness.max() * np.ptp(self.x)  # of the assembled forces
        least = max(tolerance * np.abs(load).max(), round_off)
        self.u, before = self.accepted.copy(), np.inf
        for iteration in range(most):
            rest = load - self.body.inner_force(self.u) - self.holding @ (self.u - self.accepted)
            rest[self.held] = 0.0
            if not np.isfinite(rest).all():
                raise lost("an element has turned inside out")
            size = np.abs(rest).max()
            if size <= least:
                return max(1, iteration)
            self.factored &= size < 0.2 * before
            before = size
            self.u += self.move(rest)
        raise lost(f"no balance after {most} iterations")

    def move(self, rest: np.ndarray) -> np.ndarray:
        """Return the Newton step (n, 3) [m] for what is out of balance (n, 3) [N]."""
        node = self.body.node
        if not self.factored:
            springs = kron(self.holding[node][:, node], identity(3), "csr")
            matrix = self.body.stiffness(self.u).copy()
            if springs.nnz:
                csr = (springs.indptr, springs.indices, springs.data)
                matrix.axpy(1.0, PETSc.Mat().createAIJ(matrix.size, csr=csr, comm=MPI.COMM_SELF))
            self.solver.setOperators(matrix)
            self.factored = True
        right = self.body.vector.duplicate()
        right.array[:] = rest[node].ravel()
        moved = np.empty(rest.shape)
        self.solver.solve(right, right)
        moved[node] = right.array.reshape(-1, 3)
        return moved

    def elastic_energy(self) -> float:
        """Return the stored energy [J]."""
        return self.body.stored(self.u)


class Moving(Explicit):
    """The block by central differences."""

    program = "fenicsx"

    def __init__(self, body: Body, damping: float) -> None:
        """Take what the port wants from dolfinx; the step limit by the rows of K."""
        super().__init__(body.block.x, body.block.hex8, body.block.facets)
        self.body, self.held, self.mass, self.gravity = body, body.held, body.mass, body.gravity
        self.weight, self.damping = np.outer(self.mass, self.gravity), damping
        self.stiffness = body.diagonal()
        start, _, value = body.matrix.getValuesCSR()
        rows = np.add.reduceat(np.abs(value), start[:-1]).reshape(-1, 3)
        free = ~self.held[body.node]
        self.step_limit = 2.0 / np.sqrt((rows / self.mass[body.node, None])[free].max())

    def internal_force(self, u: np.ndarray) -> np.ndarray:
        """Return the assembled forces (n, 3) [N]."""
        force = self.body.inner_force(u)
        if not np.isfinite(force).all():
            raise lost("an element has turned inside out")
        return force

    def elastic_energy(self) -> float:
        """Return the stored energy [J]."""
        return self.body.stored(self.u)


def make() -> Static | Moving:
    """Read block.toml and the mesh that it names."""
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    explicit, damping = deck.pop("explicit", False), deck.pop("damping", 0.0)
    body = Body(read_mesh(Path(deck.pop("mesh"))), **deck)
    return Moving(body, damping) if explicit else Static(body)


if __name__ == "__main__":
    sys.exit(start(make))
