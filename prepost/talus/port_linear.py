"""The frame of a linear static solid that is a matrix (manual/own-solver.md).

A partner derives from `Linear` and gives `k`, whoever has assembled it. Needs SciPy.
"""

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, spmatrix
from scipy.sparse.linalg import splu

from talus.port import Message, Values
from talus.port_solid import Solid


class Linear(Solid):
    """K u = load + weight, with the springs of the interface in the matrix.

    `k` (3n, 3n) [N/m] is sparse, in the order node, direction; factors last until springs change.
    Where it holds supports already, `held` marks their rows all the same.
    """

    def matrix(self, k: spmatrix) -> None:
        """Take the stiffness matrix; `stiffness` is its diagonal."""
        self.k = csr_matrix(k)
        self.stiffness = self.k.diagonal().reshape(-1, 3).max(axis=1)
        self.holding, self.factors = csr_matrix(self.k.shape), None

    def set(self, request: Message) -> Values:
        """Take springs or the dead load of a set."""
        reply = super().set(request)
        entries = [(k * np.outer(w, w), *np.meshgrid(3 * n, 3 * n)) for n, w, k in self.springs]
        value, column, row = (np.concatenate([e[i].ravel() for e in entries] or [np.zeros(0, int)])
                              for i in range(3))  # fmt: skip
        places = [np.concatenate([place + d for d in range(3)]) for place in (row, column)]
        self.holding = csr_matrix((np.tile(value, 3), places), shape=self.k.shape)
        self.factors = None
        return reply

    def balance(self, load: np.ndarray) -> int:
        """Solve with springs about the accepted state."""
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
