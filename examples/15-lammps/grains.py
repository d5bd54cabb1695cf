"""Grains of LAMMPS at the port of Talus: spheres with gran/hertz/history.

Usage: grains.py grains.toml --port=SPEC (talus-couple puts both behind the command).
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
from lammps import lammps
from scipy.spatial import cKDTree

from talus.packing import Packing, read_h5
from talus.port_frame import start
from talus.port_grains import Grains, radii_of_spheres
from talus.port_names import SCALARS

INPUT = """units si
atom_style sphere
atom_modify map array sort 0 0.0
boundary f f f
newton off
comm_modify vel yes
region box block {low[0]} {high[0]} {low[1]} {high[1]} {low[2]} {high[2]}
create_box 1 box
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes
pair_style gran/hertz/history {kn} {kt} {gn} {gt} {friction} 1
pair_coeff * *
timestep {dt}
thermo_modify lost error
"""
GROUPS = """group held id {held}
group free subtract all held
neigh_modify exclude group held held
fix still held nve/noforce
fix move free nve/sphere
fix weight free gravity {weight} vector {pull[0]} {pull[1]} {pull[2]}
run 0 post no
"""


class Spheres(Grains):
    """Spheres of LAMMPS in one process."""

    program, version = "lammps", "29Sep2021"

    def __init__(self, packing: Packing, deck: dict) -> None:
        """Make the grains of a packing; the deck is that of grains.toml."""
        radius = radii_of_spheres(packing)
        mass = deck["density"] * 4.0 / 3.0 * np.pi * radius**3
        super().__init__(packing.id, packing.x, radius, mass, packing.kind, packing.groups)
        self.dt, self.gravity = deck["dt"], tuple(deck["gravity"])
        shear, poisson = deck["young"] / 2 / (1 + deck["poisson"]), deck["poisson"]
        self.kn, self.fallen, self.held = 4 * shear / 3 / (1 - poisson), 0.0, packing.kind != 0
        damping = deck.get("damping", 0.0)  # gamma_n of gran/hertz/history [1/(m s)]
        far = 20 * radius.max() + np.ptp(packing.x, axis=0).max()
        text = INPUT.format(low=packing.x.min(axis=0) - far, high=packing.x.max(axis=0) + far,
                            skin=0.3 * radius.min(), kn=self.kn, kt=4 * shear / (2 - poisson),
                            gn=damping, gt=0.5 * damping, friction=deck["friction"],
                            dt=self.dt)  # fmt: skip
        self.lmp = lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        self.lmp.commands_string(text)
        self.fill(packing)
        held = " ".join(str(k + 1) for k in np.flatnonzero(self.held))
        weight = float(np.linalg.norm(self.gravity))
        pull = self.gravity if weight else (0, 0, -1)
        text = GROUPS.format(held=held, weight=weight, pull=pull)
        self.lmp.commands_string(text)
        self.look()

    def fill(self, packing: Packing) -> None:
        """Create the atoms, atom k + 1 for row k."""
        count = len(packing.id)
        self.lmp.create_atoms(count, list(range(1, count + 1)), [1] * count,
                              packing.x.ravel().tolist(), packing.v.ravel().tolist())  # fmt: skip
        self.seek()
        self.view("radius")[:] = self.radius[self.order]
        self.view("rmass")[:] = self.mass[self.order]
        self.view("omega")[:] = packing.omega[self.order]

    def seek(self) -> None:
        """Learn which row each atom of LAMMPS has."""
        self.count = self.lmp.extract_global("nlocal")
        self.order = self.view("id").ravel() - 1

    def view(self, name: str) -> np.ndarray:
        """Return what LAMMPS has of its atoms, in its order."""
        return self.lmp.numpy.extract_atom(name, nelem=len(self.ids))

    def look(self) -> None:
        """Take the state from LAMMPS."""
        for own, name in ((self.x, "x"), (self.v, "v"), (self.omega, "omega"), (self.f, "f"),
                          (self.m, "torque")):  # fmt: skip
            own[self.order] = self.view(name)
        self.f[~self.held] -= np.outer(self.mass[~self.held], self.gravity)

    def advance_by(self, duration: float, rows: np.ndarray, v: np.ndarray,
                   omega: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:  # fmt: skip
        """Run LAMMPS, one step after the other, and add the forces on rows by trapezoids."""
        steps = round(duration / self.dt)
        if abs(steps * self.dt - duration) > 1e-9 * duration:
            self.refuse("P254", f"{duration} s are no whole number of steps of {self.dt} s", "dt")
        place = np.argsort(self.order)[rows]
        self.view("v")[place], self.view("omega")[place] = v, omega
        impulse, turn = 0.5 * self.f[rows], 0.5 * self.m[rows]
        for _ in range(steps):
            self.lmp.command("run 1 pre no post no")
            impulse += self.view("f")[place]
            turn += self.view("torque")[place]
        before = self.x.copy()
        self.seek()
        self.look()
        fallen = (self.x - before)[~self.held] @ np.array(self.gravity)
        self.fallen += float(np.sum(self.mass[~self.held] * fallen))
        impulse -= 0.5 * self.f[rows]
        turn -= 0.5 * self.m[rows]
        return steps, self.dt * impulse, self.dt * turn

    def contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pairs (m, 2), overlaps and reduced radii of contacts [m]."""
        pair = cKDTree(self.x).query_pairs(2 * self.radius.max(), output_type="ndarray")
        pair = pair[~self.held[pair].all(axis=1)]
        r = self.radius[pair]
        overlap = r.sum(axis=1) - np.linalg.norm(self.x[pair[:, 1]] - self.x[pair[:, 0]], axis=1)
        touch = overlap > 0.0
        return pair[touch], overlap[touch], (r.prod(axis=1) / r.sum(axis=1))[touch]

    def contact_stiffness(self) -> np.ndarray:
        """Return the sum of the normal stiffness of the contacts of each grain (n) [N/m]."""
        pair, overlap, reduced = self.contacts()
        sums = np.zeros(len(self.ids))
        np.add.at(sums, pair, 1.5 * self.kn * np.sqrt(reduced * overlap)[:, None])
        return sums

    def elastic_energy(self) -> float:
        """Return the energy of normal overlaps [J]; LAMMPS does not tell the tangential one."""
        _, overlap, reduced = self.contacts()
        return float(0.4 * self.kn * np.sum(np.sqrt(reduced) * overlap**2.5))

    def scalars(self) -> np.ndarray:
        """Return the table of scalars (19), with gravity."""
        scalars = super().scalars()
        scalars[SCALARS["gravity"]] = self.fallen
        return scalars


def make() -> Spheres:
    """Read grains.toml and the packing that it names."""
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    return Spheres(read_h5(Path(deck["packing"])), deck)


if __name__ == "__main__":
    sys.exit(start(make))
