"""An elastic or neo-Hookean body of FEniCSx (dolfinx 0.5): forces, tangent, mass, energy by nodes.

Nothing here speaks with Talus; solid.py does.
"""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.cpp.io import perm_vtk
from dolfinx.mesh import CellType, create_mesh
from mpi4py import MPI
from petsc4py import PETSc

from talus.mesh import Mesh

VTK = perm_vtk(CellType.hexahedron, 8)
HEXAHEDRON = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.hexahedron, 1))


class Body:
    """Energy, mass and supports of dolfinx on a mesh of Talus, whose node numbers it keeps.

    Hexahedra of first order, 2 x 2 x 2 points, lumped mass: `hex8_full` of talus-fem.
    """

    def __init__(self, block: Mesh, base: str, law: str, young: float, poisson: float,
                 density: float, gravity: list[float]) -> None:  # fmt: skip
        """Hold the nodes of the facets `base`; SI units."""
        grid = create_mesh(MPI.COMM_SELF, block.hex8[:, VTK].astype(np.int64), block.x, HEXAHEDRON)
        space = fem.VectorFunctionSpace(grid, ("CG", 1))
        self.block, self.gravity = block, tuple(gravity)
        self.node = np.empty(len(block.x), dtype=np.int32)  # of each dof of dolfinx
        self.node[space.dofmap.list.array] = np.array(grid.geometry.input_global_indices)[
            grid.geometry.dofmap.array
        ]
        self.held = np.zeros(block.x.shape, dtype=bool)
        self.held[np.unique(block.facets[base])] = True
        self.u, test, trial = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
        dx = ufl.dx(metadata={"quadrature_degree": 3})
        energy = stored_energy(law, young, poisson, self.u) * dx
        force = ufl.derivative(energy, self.u, test)
        self.force, self.tangent = fem.form(force), fem.form(ufl.derivative(force, self.u, trial))
        self.energy = fem.form(energy)
        self.vector = fem.petsc.create_vector(self.force)
        self.matrix = fem.petsc.create_matrix(self.tangent)
        base_dofs = np.flatnonzero(self.held[self.node, 0]).astype(np.int32)
        self.support = [fem.dirichletbc(PETSc.ScalarType((0, 0, 0)), base_dofs, space)]
        one = fem.Constant(grid, PETSc.ScalarType((density,) * 3))
        self.mass = self.assembled(fem.form(ufl.inner(one, test) * dx))[:, 0]

    def assembled(self, form: fem.FormMetaClass) -> np.ndarray:
        """Return a linear form by nodes (n, 3)."""
        self.vector.zeroEntries()
        values = np.empty(self.held.shape)
        values[self.node] = fem.petsc.assemble_vector(self.vector, form).array.reshape(-1, 3)
        return values

    def deform(self, u: np.ndarray) -> None:
        """Take displacements u (n, 3) [m]."""
        self.u.x.array[:] = u[self.node].ravel()

    def inner_force(self, u: np.ndarray) -> np.ndarray:
        """Return what the block resists displacements u (n, 3) [m] with (n, 3) [N]."""
        self.deform(u)
        return self.assembled(self.force)

    def stiffness(self, u: np.ndarray) -> PETSc.Mat:
        """Return the tangent at displacements u (n, 3) [m], in dofs of dolfinx."""
        self.deform(u)
        self.matrix.zeroEntries()
        fem.petsc.assemble_matrix(self.matrix, self.tangent, bcs=self.support)
        self.matrix.assemble()
        return self.matrix

    def diagonal(self) -> np.ndarray:
        """Return the largest diagonal entry of each node at rest (n) [N/m]."""
        entries = np.empty(self.held.shape)
        at_rest = self.stiffness(np.zeros(self.held.shape))
        entries[self.node] = at_rest.getDiagonal().array.reshape(-1, 3)
        return entries.max(axis=1)

    def stored(self, u: np.ndarray) -> float:
        """Return the energy stored at displacements u (n, 3) [J]."""
        self.deform(u)
        return float(fem.assemble_scalar(self.energy))


def stored_energy(law: str, young: float, poisson: float, u: fem.Function) -> ufl.core.expr.Expr:
    """Return the energy per volume, the same as that of talus-fem (theory, F.21)."""
    lam, mu = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    if law == "elastic":
        strain = ufl.sym(ufl.grad(u))
        return 0.5 * lam * ufl.tr(strain) ** 2 + mu * ufl.inner(strain, strain)
    f = ufl.Identity(3) + ufl.grad(u)
    log_j = ufl.ln(ufl.det(f))
    return 0.5 * mu * (ufl.inner(f, f) - 3) - mu * log_j + 0.5 * lam * log_j**2
