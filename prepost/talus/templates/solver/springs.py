"""A solid of your own at the port of Talus: a plate of masses on springs, which go up and down.

Usage: springs.py springs.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

from talus.mesh import box
from talus.port_explicit import Explicit
from talus.port_frame import start


class Springs(Explicit):
    """A plate on springs: modulus is stress over settlement [N/m3], damping in 1/s."""

    program = "springs"

    def __init__(self, width: float, thick: float, cells: int, density: float, modulus: float,
                 damping: float) -> None:  # fmt: skip
        """Make the mesh that the coupling sees: one layer of hexahedra, of which the top moves."""
        lower, upper = np.array([0.0, 0.0, -thick]), np.array([width, width, 0.0])
        mesh = box(lower, upper, (cells, cells, 1))
        super().__init__(mesh.x, mesh.hex8, mesh.facets)
        self.gravity = (0.0, 0.0, -9.81)  # that of grains.nml; u counts from the plate at rest
        top, facets = mesh.nodes["z1"], mesh.facets["z1"]
        area = np.bincount(facets.ravel(), minlength=len(mesh.x)) * (width / cells) ** 2 / 4  # m2
        self.k = modulus * area  # N/m
        self.mass = np.where(area > 0.0, density * thick * area, 1.0)  # kg
        self.held[:] = True
        self.held[top, 2] = False
        self.stiffness, self.damping = self.k, damping
        self.step_limit = 2.0 * np.sqrt(density * thick / modulus)  # s, two over the frequency

    def internal_force(self, u: np.ndarray) -> np.ndarray:
        """Return what the springs resist u (n, 3) with [N]: your own mechanics go here."""
        return self.k[:, None] * u

    def elastic_energy(self) -> float:
        """Return half of k u u [J]."""
        return float(0.5 * np.sum(self.k[:, None] * self.u**2))

    def stop(self, request: object) -> dict:
        """Say at the end how far the plate went down."""
        mean = np.sum(self.k * self.accepted[:, 2]) / self.k.sum()
        Path("springs.txt").write_text(f"mean settlement {-1e6 * mean:.2f} micrometres\n")
        return super().stop(request)


if __name__ == "__main__":
    sys.exit(start(lambda: Springs(**tomllib.loads(Path(sys.argv[1]).read_text()))))
