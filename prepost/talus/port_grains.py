"""The frame of grains at the exchange port (manual/own-solver.md).

A partner derives from `Grains`, gives its spheres and an `advance_by`; order of verbs, sets, the
motion of ghosts, work, scalars and faults are here.
"""

import numpy as np

from talus.faults import FaultError
from talus.packing import Packing
from talus.port import Message, Values
from talus.port_frame import Partner
from talus.port_names import SCALAR_COUNT, SCALARS, Field


class Grains(Partner):
    """Spheres with ids, centres x (n, 3) in m, radius (n) in m and mass (n) in kg, groups of ids.

    `kind` (n) is 0 of what is free. `advance_by` is the one thing that a partner must do; it keeps
    x, v, omega, and the forces `f` and moments `m` of contacts on every grain (n, 3) as they are
    at its end. `dt` [s] is the partner's step.
    """

    program = "grains"
    capabilities = "prescribe,advance"
    dt = 0.0

    def __init__(self, ids: np.ndarray, x: np.ndarray, radius: np.ndarray, mass: np.ndarray,
                 kind: np.ndarray, groups: dict[str, np.ndarray]) -> None:  # fmt: skip
        """Keep the grains, which are at rest and touch nothing."""
        super().__init__()
        self.ids, self.x, self.radius, self.mass = ids, x.copy(), radius, mass
        self.kind, self.groups = kind, groups
        self.inertia = 0.4 * mass * radius**2
        self.v, self.omega = np.zeros(x.shape), np.zeros(x.shape)  # m/s, rad/s
        self.f, self.m = np.zeros(x.shape), np.zeros(x.shape)  # N, N m
        self.quat = np.tile([1.0, 0.0, 0.0, 0.0], (len(x), 1))  # of what is prescribed
        self.row = {int(name): k for k, name in enumerate(ids)}
        self.boundary = 0.0  # work of what is prescribed [J]

    def advance_by(self, duration: float, rows: np.ndarray, v: np.ndarray,
                   omega: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:  # fmt: skip
        """Go on for a duration [s] while the grains of rows have v [m/s] and omega [rad/s].

        Returns own steps, and the integrals over them of the force and the moment that the other
        grains exert on each of rows (n, 3) [N s, N m s].
        """
        raise NotImplementedError

    def contact_stiffness(self) -> np.ndarray:
        """Return the sum of the normal stiffness of the contacts of each grain (n) [N/m]."""
        return np.zeros(len(self.ids))

    def elastic_energy(self) -> float:
        """Return the energy stored in contacts [J]; 0 where a solver does not know it."""
        return 0.0

    def hello(self, request: Message) -> Values:
        """Say who this is."""
        return super().hello(request) | ({Field.DT: self.dt} if self.dt > 0.0 else {})

    def describe(self, request: Message) -> Values:
        """Tell the grains, their groups or one of them."""
        what, group = self.words(Field.WHAT), self.words(Field.GROUP)
        if what == "groups":
            return {Field.NAMES: "\n".join(self.groups)}
        if what == "group" and group in self.groups:
            return {Field.ID: np.asarray(self.groups[group])}
        if what != "grains":
            self.refuse("P301", f"nothing is known of {what} '{group}'", ", ".join(self.groups))
        three = np.ones((1, 3))
        return {
            Field.ID: self.ids, Field.X: self.x, Field.QUAT: self.quat, Field.KIND: self.kind,
            Field.AXES: self.radius[:, None] * three, Field.RADIUS: self.radius,
            Field.MASS: self.mass, Field.INERTIA: self.inertia[:, None] * three,
        }  # fmt: skip

    def select(self, request: Message) -> Values:
        """Keep a set of grains."""
        name, role = self.words(Field.SET), self.words(Field.ROLE)
        ids = self.needed(Field.ID, (-1,))
        if not self.can(role) or not name:
            self.refuse("P427", f"{self.program} has no role '{role}'", self.capabilities)
        if unknown := [int(i) for i in ids if int(i) not in self.row]:
            self.refuse("P302", f"there is no grain {unknown[0]}", "DESCRIBE grains tells the ids")
        rows = np.array([self.row[int(i)] for i in ids], dtype=int)
        if (self.kind[rows] == 0).any():
            self.refuse("P302", "a free grain is to be prescribed", "its kind must be 1")
        self.sets[name] = role, rows
        return {Field.MASS: self.mass[rows], Field.STIFFNESS: self.contact_stiffness()[rows]}

    def ready(self, request: Message) -> Values:
        """Tell the state."""
        if request.flag(Field.REHEARSAL):
            self.refuse("P427", f"{self.program} cannot rehearse", "write initial = 'none'")
        self.boundary = 0.0
        reply = self.state(0)
        for name, (_, rows) in self.sets.items():
            reply |= self.integrals(name, np.zeros((2, len(rows), 3)), 0.0)
        return reply

    def advance(self, request: Message) -> Values:
        """Move what is prescribed in straight lines to t1, the others freely."""
        duration = request.t1 - request.t0
        parts = [self.motion(name, rows, duration) for name, (_, rows) in self.sets.items()]
        rows, v, omega = (np.concatenate(p) for p in zip(*parts, strict=True)) if parts else (
            np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)))  # fmt: skip
        before = self.quat[rows]
        steps, impulse, turn = self.advance_by(duration, rows, v, omega)
        self.quat[rows] = turned(before, omega * duration)
        reply, at = self.state(steps), 0
        for name, (_, own) in self.sets.items():
            part = slice(at, at + len(own))
            work = -float(np.sum(impulse[part] * v[part]) + np.sum(turn[part] * omega[part]))
            self.boundary += work
            reply |= self.integrals(name, np.array([impulse[part], turn[part]]), work)
            at += len(own)
        reply[Field.SCALARS][SCALARS["boundary"]] = self.boundary
        return reply

    def motion(self, name: str, rows: np.ndarray, duration: float) -> tuple[np.ndarray, ...]:
        """Return rows, velocities and spins (n, 3) that bring a set to where it is due at t1."""
        v, omega = np.zeros((2, len(rows), 3))
        if f"{name}.{Field.X}" in self.fields:
            x = self.needed(f"{name}.{Field.X}", (len(rows), 3))
            v = (x - self.x[rows]) / duration
        if f"{name}.{Field.QUAT}" in self.fields:
            quat = self.needed(f"{name}.{Field.QUAT}", (len(rows), 4))
            omega = rotation(self.quat[rows], quat) / duration
        return rows, v, omega

    def integrals(self, name: str, both: np.ndarray, work: float) -> Values:
        """Return impulses (2, n, 3) and work of a set as fields."""
        return {f"{name}.{Field.IMPULSE}": both[0], f"{name}.{Field.MOMENT_IMPULSE}": both[1],
                f"{name}.{Field.WORK}": work}  # fmt: skip

    def accept(self, request: Message) -> Values:
        """Keep the step: nothing goes back here."""
        return {}

    def state(self, substeps: int) -> Values:
        """Tell forces on the sets, own steps and energies."""
        reply: Values = {Field.SUBSTEPS: substeps, Field.SCALARS: self.scalars()}
        for name, (_, rows) in self.sets.items():
            reply |= {f"{name}.{Field.FORCE}": self.f[rows], f"{name}.{Field.MOMENT}": self.m[rows]}
        return reply

    def scalars(self) -> np.ndarray:
        """Return the table of scalars (19); kinetic energy and momenta are those of free grains."""
        free, scalars = self.kind == 0, np.zeros(SCALAR_COUNT)
        moving = self.mass[free, None] * self.v[free]
        turning = self.inertia[free, None] * self.omega[free]
        energy = np.sum(moving * self.v[free]) + np.sum(turning * self.omega[free])
        scalars[SCALARS["kinetic"]] = 0.5 * float(energy)
        scalars[SCALARS["elastic"]] = self.elastic_energy()
        scalars[SCALARS["boundary"]] = self.boundary
        at = SCALARS["momentum"]
        scalars[at : at + 3] = moving.sum(axis=0)
        at = SCALARS["angular_momentum"]
        scalars[at : at + 3] = (np.cross(self.x[free], moving) + turning).sum(axis=0)
        return scalars


def radii_of_spheres(packing: Packing) -> np.ndarray:
    """Return the radii (n) [m] of a packing for a solver of spheres; E625 where one is none."""
    radius = packing.axes[:, 0]
    odd = ~np.isclose(packing.axes, radius[:, None], rtol=1e-9, atol=0.0).all(axis=1)
    odd |= (packing.skew != 0.0).any(axis=1) | (packing.exponent != 2.0)
    if odd.any():
        name = packing.id[np.flatnonzero(odd)[0]]
        raise FaultError("E625", f"grain {name} is no sphere", "this solver knows spheres alone")
    return radius


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return products of quaternions w x y z (n, 4)."""
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
    rest = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.hstack([w, rest])


def rotation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (n, 3), of at most pi, from one orientation (n, 4) to another."""
    q = product(second, first * [1.0, -1.0, -1.0, -1.0])
    q = np.where(q[:, :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[:, :1])
    return q[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)


def turned(quat: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return orientations (n, 4) turned by rotation vectors theta (n, 3) of the space frame."""
    half = 0.5 * np.linalg.norm(theta, axis=1, keepdims=True)
    axis = 0.5 * theta * np.sinc(half / np.pi)
    return product(np.hstack([np.cos(half), axis]), quat)
