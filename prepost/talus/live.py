"""A run of talus-dem under way: started, advanced, read and steered from Python.

`GrainsRun` is the asking end of the exchange port (manual/port.md). It uses HELLO, DESCRIBE,
SELECT, READY, ADVANCE, ACCEPT, CHECKPOINT and STOP, and nothing of talus-dem but its deck.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.measure import rotations
from talus.port import Message
from talus.port_asker import LostError, SolverAsker
from talus.port_grains import turned
from talus.port_names import PROTOCOL, SCALARS, Field
from talus.programs import find_program, program_of

REPORT = "talus-run"  # name of the set of all grains
STATE = (Field.X, Field.QUAT, Field.V, Field.OMEGA)
TRIPLES = ("momentum", "angular_momentum")  # scalars that are vectors
AS_IT_IS = np.array([[1.0, 0.0, 0.0, 0.0]])  # quaternion, w first
NOW = 1.0e-9  # of a time: what counts as the same


@dataclass
class Plate:
    """Triangles that Python moves as one rigid body, a wall of any shape.

    `x` (n, 3) are the corners [m], `triangles` (m, 3) their rows from 0, all turned alike;
    `material` is one of the deck that has a contact law with all grains.
    """

    x: np.ndarray
    triangles: np.ndarray
    material: str


@dataclass
class Body:
    """What moves as one rigid body: places (n, 3) [m] of its grains or corners, and its motion."""

    x: np.ndarray
    quat: np.ndarray | None  # (n, 4) of grains
    centre: np.ndarray  # (3,) [m]
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m/s]
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [rad/s]
    force: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) of the grains on it [N]
    moment: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) about the centre [N m]

    def move(self, duration: float) -> None:
        """Go on with its velocity and spin for a duration [s]."""
        turn = self.spin[None] * duration
        arms = (self.x - self.centre) @ rotations(turned(AS_IT_IS, turn))[0].T
        self.centre = self.centre + self.velocity * duration
        self.x = self.centre + arms
        if self.quat is not None:
            self.quat = turned(self.quat, turn)


class GrainsRun:
    """talus-dem on a deck; use it in `with`, or call `stop`.

    `held` names groups of the packing, or gives ids, of grains that Python moves; `plates` are
    surfaces that Python brings along. After every advance `x`, `v`, `omega` (n, 3) and `quat`
    (n, 4) are those of the grains `ids` (n) in SI units, at `time` [s]; `scalars` are energies by
    name [J].
    """

    def __init__(
        self, deck: str | Path, held: Mapping[str, object] | None = None,
        plates: Mapping[str, Plate] | None = None, threads: int = 1, restart: str = "",
        options: tuple[str, ...] = (), time_limit: float = 600.0,
    ) -> None:  # fmt: skip
        """Start talus-dem, which reads the deck and makes its first forces. Raises FaultError.

        `restart` is a checkpoint, 'auto' or empty; `time_limit` [s] the longest silence.
        """
        deck = Path(deck)
        if (name := program_of(deck)) != "talus-dem":
            raise FaultError("E660", f"{deck} is a deck of {name}", "give a deck of talus-dem")
        command = [str(find_program("talus-dem")), str(deck), f"--threads={threads}", *options]
        self.solver = SolverAsker(command, "shared_memory", time_limit)
        self.time, self.dt, self.bodies, self.running = 0.0, 0.0, {}, True
        try:
            self._begin(restart, dict(held or {}), dict(plates or {}))
        except BaseException:
            self._leave()
            raise

    def __enter__(self) -> "GrainsRun":
        """Return itself."""
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        """Stop the run; after an exception it is ended at once."""
        if kind is None:
            self.stop()
        self._leave()

    def _begin(self, restart: str, held: dict[str, object], plates: dict[str, Plate]) -> None:
        """Greet, read the grains, name the sets, and take the first state."""
        hello = self._ask("HELLO", run_id="python", restart=restart, protocol=PROTOCOL)
        self.time = float(np.ravel(hello.fields[Field.TIME])[0])
        self.dt = float(np.ravel(hello.fields.get(Field.DT, 0.0))[0])
        grains = self._ask("DESCRIBE", what="grains").fields
        self.ids = np.ravel(grains[Field.ID]).copy()
        self.axes, self.mass = grains[Field.AXES].copy(), np.ravel(grains[Field.MASS]).copy()
        for name, which in held.items():
            self._hold(name, which, grains)
        for name, plate in plates.items():
            self._bring(name, plate)
        self._ask("SELECT", set=REPORT, role="report", id=self.ids, fields=",".join(STATE))
        self._take(self._ask("READY", self.time, self.time))

    def _hold(self, name: str, which: object, grains: dict[str, np.ndarray]) -> None:
        """Take grains into the hands of Python: ids, or the name of a group (E664)."""
        if isinstance(which, str):
            which = self._ask("DESCRIBE", what="group", group=which).fields[Field.ID]
        ids = np.unique(np.ravel(np.asarray(which)))
        if not ids.size or not np.isin(ids, self.ids).all():
            strange = ids[~np.isin(ids, self.ids)]
            text = f"no grain has the id {strange[0]}" if ids.size else "there are no ids"
            hint = f"ids are those of the packing, {self.ids[0]} to {self.ids[-1]}"
            raise FaultError("E664", f"held '{name}': {text}", hint)
        rows = np.searchsorted(self.ids, ids)
        x = grains[Field.X][rows].copy()
        self.bodies[name] = Body(x, grains[Field.QUAT][rows].copy(), x.mean(axis=0))
        self._ask("SELECT", set=name, role="prescribe", id=ids)

    def _bring(self, name: str, plate: Plate) -> None:
        """Bring a surface along."""
        x = np.array(plate.x, float).reshape(-1, 3)
        self.bodies[name] = Body(x, None, 0.5 * (x.min(axis=0) + x.max(axis=0)))
        self._ask(
            "SELECT", set=name, role="surface", id=np.arange(1, len(x) + 1), x=x,
            triangle=np.asarray(plate.triangles, int) + 1, material=plate.material,
        )  # fmt: skip

    def set_velocity(
        self, name: str, velocity: object = (0, 0, 0), spin: object = (0, 0, 0)
    ) -> None:
        """Give a body a velocity (3,) [m/s] and a spin (3,) about its centre [rad/s]."""
        body = self.body(name)
        body.velocity, body.spin = np.array(velocity, float), np.array(spin, float)

    def body(self, name: str) -> Body:
        """Return a body by its name (E663): where it is, and the `force` and `moment` on it."""
        if name not in self.bodies:
            hint = f"bodies of this run: {', '.join(self.bodies) or 'none'}"
            raise FaultError("E663", f"there is no body '{name}'", hint)
        return self.bodies[name]

    def advance_to(self, time: float) -> None:
        """Go on to a time [s], bodies in straight lines; due output is written (E661)."""
        if not time > self.time * (1.0 + NOW):
            raise FaultError("E661", f"the run is at {self.time:g} s and cannot go to {time:g} s",
                             "give a later time")  # fmt: skip
        motion = {}
        for name, body in self.bodies.items():
            body.move(time - self.time)
            motion[f"{name}.{Field.X}"] = body.x
            if body.quat is not None:
                motion[f"{name}.{Field.QUAT}"] = body.quat
        reply = self._ask("ADVANCE", self.time, time, **motion)
        self._ask("ACCEPT", self.time, time, final=1)
        self.time = time
        self._take(reply)

    def advance(self, duration: float) -> None:
        """Go on for a duration [s]."""
        self.advance_to(self.time + duration)

    def advance_steps(self, number: int = 1) -> None:
        """Go on by steps of the deck's dt (E662)."""
        if not self.dt > 0.0:
            hint = "give dt in &dynamics or &relaxation, or advance by times"
            raise FaultError("E662", "the deck has no step of its own", hint)
        self.advance_to(self.time + number * self.dt)

    def contacts(self) -> dict[str, np.ndarray]:
        """Return ids (m, 2), point, normal, branch, force (m, 3), stiffness (m, 2) of contacts."""
        reply = self._ask("DESCRIBE", what="contacts").fields
        return {name: np.array(value) for name, value in reply.items()}

    def forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and moment about the centre [N m], (n, 3), of the contacts of grains.

        Couples of rolling resistance and bonds are not among the moments.
        """
        c = self.contacts()
        force, moment = np.zeros((len(self.ids), 3)), np.zeros((len(self.ids), 3))
        first, second = (np.searchsorted(self.ids, ids) for ids in c["ids"].reshape(-1, 2).T)
        of_two = c["ids"].reshape(-1, 2)[:, 0] > 0
        one = first[of_two]
        arm = c["point"] - self.x[second]
        arm[of_two] = c["point"][of_two] - self.x[one] - c["branch"][of_two]  # of an image
        np.add.at(force, second, c["force"])
        np.add.at(moment, second, np.cross(arm, c["force"]))
        np.add.at(force, one, -c["force"][of_two])
        np.add.at(moment, one, -np.cross(arm + c["branch"], c["force"])[of_two])
        return force, moment

    def checkpoint(self, tag: str = "") -> str:
        """Write a checkpoint of the present state and return its path."""
        return self._ask("CHECKPOINT", self.time, self.time, tag=tag).text(Field.PATH)

    def stop(self) -> None:
        """End the run: it writes what it writes at its end."""
        if not self.running:
            return
        self.running = False
        self._ask("STOP", self.time, self.time)
        self.solver.exit_code()

    def _leave(self) -> None:
        """End the process, if it is still there, and remove the port."""
        self.running = False
        self.solver.__exit__()

    def _take(self, reply: Message) -> None:
        """Keep the state that a reply tells."""
        fields = reply.fields
        for name in STATE:
            setattr(self, name, np.array(fields[f"{REPORT}.{name}"]))
        scalars = np.ravel(fields[Field.SCALARS])
        self.scalars = {
            name: float(scalars[k]) for name, k in SCALARS.items() if name not in TRIPLES
        }
        self.scalars |= {
            name: scalars[SCALARS[name] : SCALARS[name] + 3].copy() for name in TRIPLES
        }
        for name, body in self.bodies.items():
            force = np.asarray(fields[f"{name}.{Field.FORCE}"]).reshape(-1, 3)
            body.force = force.sum(axis=0)
            body.moment = np.cross(body.x - body.centre, force).sum(axis=0)
            if body.quat is not None:
                body.moment += np.asarray(fields[f"{name}.{Field.MOMENT}"]).sum(axis=0)

    def _ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request; faults of talus-dem are raised with its code, E665 when it is gone."""
        try:
            request = self.solver.request(verb, t0, t1, fields)
            self.solver.send(request)
            reply = self.solver.receive()
        except LostError as fault:
            raise FaultError(
                "E665", f"{verb}: {fault}", self.solver.output(), exit_code=4
            ) from fault
        if reply.status:
            words = (Field.ERROR_MESSAGE, Field.ERROR_HINT, Field.ERROR_PLACE)
            raise FaultError(reply.text(Field.ERROR_CODE), *map(reply.text, words), reply.status)
        return reply
