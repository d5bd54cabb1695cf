"""The frame of an explicit solid at the exchange port (manual/own-solver.md): central differences.

A partner derives from `Explicit`, gives its mesh, mass, `step_limit` and `internal_force`; what
`Solid` of talus.port_solid does it inherits.
"""

import math

import numpy as np

from talus.port import Message, Values
from talus.port_checkpoint import State
from talus.port_names import SCALARS, Field
from talus.port_solid import Solid


class Explicit(Solid):
    """A solid with lumped mass that goes through an interval by steps of its own.

    Central differences are Newmark's scheme with beta = 0, gamma = 1/2: with analysis 'newmark'
    talus-couple gives the load at t1, and the load goes to it in a straight line. A partner that
    sets analysis = 'explicit' is coupled by scheme = 'symmetric' (impulses) or 'iterated' (loads
    that are held). `weight` (n, 3) is a dead load of its own [N], `damping` proportional to mass
    [1/s].
    """

    analysis = "newmark"
    capabilities = "report,load,solve,advance,kick_drift,impulse,reject,rehearsal,dead_load"
    step_limit = 0.0  # s, largest stable step; a partner sets it
    dt_factor = 0.8  # of the step limit
    damping = 0.0

    def __init__(self, x: np.ndarray, cells: np.ndarray, facets: dict[str, np.ndarray],
                 cell: str = "hex8", facet: str = "quad4") -> None:  # fmt: skip
        """Keep the mesh and stand still."""
        super().__init__(x, cells, facets, cell, facet)
        self.weight, self.old_dead = np.zeros(x.shape), np.zeros(x.shape)  # [N]
        self.push = np.zeros(x.shape)  # acceleration but for the damping [m/s2]
        self.kept = [np.zeros(x.shape) for _ in range(3)]  # v, a, push of the accepted state
        self.fall = self.old_fall = 0.0  # work of the weight [J]
        self.damped = self.old_damped = 0.0  # [J]

    def internal_force(self, u: np.ndarray) -> np.ndarray:
        """Return the forces (n, 3) in N with which the solid resists displacements u (n, 3) in m.

        FaultError (exit code 2) where there are none, as in an element that is inside out.
        """
        raise NotImplementedError

    def hello(self, request: Message) -> Values:
        """Say who this is, and the largest stable step."""
        return super().hello(request) | {Field.STEP_LIMIT: self.step_limit}

    def ready(self, request: Message) -> Values:
        """Tell the accepted state; dead loads that were set meanwhile hold from here on."""
        if self.resumed:
            return super().ready(request)
        if not request.flag(Field.REHEARSAL):
            self.fall = self.old_fall = self.damped = self.old_damped = 0.0
        self.old_load = self.load = self.old_load + self.dead - self.old_dead
        self.old_dead = self.dead.copy()
        self.push = self.acceleration(self.old_load)
        self.a = self.push - self.damping * self.v
        self.keep()
        return super().ready(request)

    def advance(self, request: Message) -> Values:
        """Go by own steps to t1 under loads that are held, after impulses at t0."""
        load = self.loads(request)
        count = self.go(load, load, request.t1 - request.t0, self.impulses())
        self.load = load
        return self.moved() | {Field.SUBSTEPS: count}

    def kick_drift(self, request: Message) -> Values:
        """Kick by the forces of now, then drift; or impulses alone, at once."""
        kick, drift = (float(self.needed(n, (1,))[0]) for n in (Field.KICK, Field.DRIFT))
        self.take(Field.BRIEF)
        push = self.impulses()
        if push is not None:
            if max(kick, drift) > 0.0:
                self.refuse("P302", "impulses come in a KICK_DRIFT of their own")
            self.give(push)
            return self.moved()
        load = self.loads(request)
        pull = self.acceleration(load) - self.damping * self.v
        self.v = self.v + kick * pull / (1.0 + 0.5 * kick * self.damping)
        step = drift * self.v
        self.u = self.u + step
        self.work += float(np.sum(load * step))
        self.fall += float(np.sum(self.weight * step))
        self.push, self.load = self.acceleration(load), load
        return {} if request.flag(Field.BRIEF) else self.moved()

    def moved(self) -> Values:
        """Tell motion of all sets and energies."""
        reply = self.state(0)
        del reply[Field.ITERATIONS]
        return reply

    def impulses(self) -> np.ndarray | None:
        """Return the impulses of a request on all nodes (n, 3) [N s], None where it has none."""
        push = None
        for name, (role, nodes) in self.sets.items():
            if role == "load" and f"{name}.{Field.IMPULSE}" in self.fields:
                push = np.zeros(self.x.shape) if push is None else push
                given = self.needed(f"{name}.{Field.IMPULSE}", (len(nodes), 3))
                np.add.at(push, nodes, given)
        return push

    def give(self, push: np.ndarray) -> None:
        """Change velocities by impulses (n, 3) [N s]; their work is that of loads."""
        change = np.where(self.held, 0.0, push / self.mass[:, None])
        self.work += float(np.sum(push * np.where(self.held, 0.0, self.v + 0.5 * change)))
        self.v = self.v + change
        self.a = self.push - self.damping * self.v

    def acceleration(self, load: np.ndarray) -> np.ndarray:
        """Return (n, 3) in m/s2 under a load (n, 3) in N but for the damping; 0 at supports."""
        a = (load + self.weight - self.internal_force(self.u)) / self.mass[:, None]
        a[self.held] = 0.0
        return a

    def keep(self) -> None:
        """Keep what REJECT brings back."""
        self.kept = [self.v.copy(), self.a.copy(), self.push.copy()]

    def step(self, load: np.ndarray, duration: float) -> int:
        """Go from the accepted state over a duration [s], the load in a straight line to `load`."""
        return self.go(self.old_load, load, duration)

    def go(self, first: np.ndarray, last: np.ndarray, duration: float,
           push: np.ndarray | None = None) -> int:  # fmt: skip
        """Go by own steps from the accepted state, the load from `first` to `last` (n, 3) [N].

        Impulses `push` (n, 3) [N s] come before them.
        """
        self.u = self.accepted.copy()
        self.v, self.a, self.push = (part.copy() for part in self.kept)
        self.work, self.fall, self.damped = self.old_work, self.old_fall, self.old_damped
        if push is not None:
            self.give(push)
        if duration <= 0.0:
            return 1
        self.push += np.where(self.held, 0.0, (first - self.old_load) / self.mass[:, None])
        count = math.ceil(duration / (self.dt_factor * self.step_limit) * (1.0 - 1e-12))
        before = first
        for k in range(1, count + 1):
            now = first + k / count * (last - first)
            self.central_step(before, now, duration / count)
            before = now
        return count

    def central_step(self, before: np.ndarray, now: np.ndarray, dt: float) -> None:
        """Kick, drift, kick over dt [s] from the load `before` to `now` (n, 3) [N].

        v' = a - damping v, with the damping at the middle of the step in both halves.
        """
        slow = 0.5 * dt * self.damping
        middle = (self.v + 0.5 * dt * self.push) / (1.0 + slow)
        moved = dt * middle
        self.u = self.u + moved
        self.push = self.acceleration(now)
        self.v = (1.0 - slow) * middle + 0.5 * dt * self.push
        self.a = self.push - self.damping * self.v
        self.work += 0.5 * float(np.sum((before + now) * moved))
        self.fall += float(np.sum(self.weight * moved))
        drag = self.damping * self.mass[:, None] * middle
        self.damped += float(np.sum(drag * moved))

    def accept(self, request: Message) -> Values:
        """Keep the step."""
        self.keep()
        self.old_fall, self.old_damped = self.fall, self.damped
        return super().accept(request)

    def reject(self, request: Message) -> Values:
        """Go back to the accepted state."""
        reply = super().reject(request)
        self.v, self.a, self.push = (part.copy() for part in self.kept)
        self.fall, self.damped = self.old_fall, self.old_damped
        return reply

    def accepted_state(self) -> State:
        """Return what a checkpoint holds."""
        v, a, push = self.kept
        return super().accepted_state() | {
            "v": v, "a": a, "push": push, "old_dead": self.old_dead,
            "fall": np.array(self.old_fall), "damped": np.array(self.old_damped)}  # fmt: skip

    def take_state(self, state: State) -> None:
        """Go on from what `accepted_state` returned."""
        super().take_state(state)
        self.push, self.old_dead = state["push"], state["old_dead"]
        self.fall = self.old_fall = float(state["fall"])
        self.damped = self.old_damped = float(state["damped"])
        self.keep()

    def scalars(self) -> np.ndarray:
        """Return the table of scalars (19), with what moves."""
        scalars = super().scalars()
        moving = self.mass[:, None] * self.v
        scalars[SCALARS["kinetic"]] = 0.5 * float(np.sum(moving * self.v))
        scalars[SCALARS["gravity"]] = self.fall
        scalars[SCALARS["background_damping"]] = self.damped
        at = SCALARS["momentum"]
        scalars[at : at + 3] = moving.sum(axis=0)
        at = SCALARS["angular_momentum"]
        scalars[at : at + 3] = np.cross(self.x + self.u, moving).sum(axis=0)
        return scalars
