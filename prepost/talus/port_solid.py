"""The frame of a static solid at the exchange port (manual/own-solver.md).

A partner derives from `Solid`, gives its mesh and a `balance`; order of verbs, sets, springs, dead
loads, trial and accepted state, energies and faults are here.
"""

import numpy as np

from talus.faults import FaultError
from talus.port import Message, Values, serve
from talus.port_names import CELLS, PROTOCOL, SCALAR_COUNT, SCALARS, Field

NEEDS = {"SOLVE": "solve", "ADVANCE": "advance", "REJECT": "reject"}  # of verbs that are here
STEPS = ("ADVANCE", "SOLVE", "FORCE", "KICK_DRIFT", "ACCEPT", "REJECT")
INTEGERS = {Field.ID, Field.NODE, Field.PROTOCOL}
PASSED_OVER = {Field.FINAL, Field.TRIAL, Field.TAG, Field.EARLY, Field.REHEARSAL, Field.FIELDS}


class Solid:
    """A solid with nodes x (n, 3) in m, cells (e, k) and facets by name, node numbers from 0.

    `held` (n, 3) marks what is supported, `mass` (n) is lumped [kg], `stiffness` (n) the diagonal
    of the stiffness [N/m]. `balance` is the one thing that a partner must do.
    """

    program, version, gravity, analysis = "solid", "1.0", (0.0, 0.0, 0.0), "static"
    capabilities = "report,load,solve,reject,rehearsal,springs,dead_load"

    def __init__(self, x: np.ndarray, cells: np.ndarray, facets: dict[str, np.ndarray],
                 cell: str = "hex8", facet: str = "quad4") -> None:  # fmt: skip
        """Keep the mesh and stand still."""
        self.x, self.cells, self.facets, self.cell, self.facet = x, cells, facets, cell, facet
        self.held, self.mass = np.zeros(x.shape, dtype=bool), np.zeros(len(x))
        self.stiffness = np.zeros(len(x))
        self.u, self.v = np.zeros(x.shape), np.zeros(x.shape)  # of the trial [m, m/s]
        self.a = np.zeros(x.shape)  # [m/s2]
        self.accepted = self.u.copy()
        self.sets: dict[str, tuple[str, np.ndarray]] = {}  # role and nodes
        self.dead = np.zeros(x.shape)  # [N]
        self.springs: list[tuple[np.ndarray, np.ndarray, float]] = []  # nodes, weights, N/m
        self.old_load = np.zeros(x.shape)  # of the accepted state [N]
        self.load = self.old_load
        self.work = self.old_work = 0.0  # of loads [J]
        self.greeted = self.begun = False

    def balance(self, load: np.ndarray) -> int:
        """Set self.u (n, 3) in m in balance with load (n, 3) in N; supports hold.

        `self.springs` hold Σ weight u of their nodes where the accepted state has it. Returns the
        number of iterations, 1 or more; FaultError (exit code 2) where there is no balance.
        """
        raise NotImplementedError

    def elastic_energy(self) -> float:
        """Return the energy stored in the trial state [J]; 0 where a solver does not know it."""
        return 0.0

    def run(self, spec: str) -> int:
        """Serve talus-couple to the end; return the exit code."""
        return serve(spec, self.answer)

    def answer(self, request: Message) -> Values:
        """Return the fields of the reply to a request."""
        self.check_order(request)
        read: set[str] = set()
        self.take = lambda name: read.add(name) or request.fields.get(name)
        self.words = lambda name: (self.take(name) or b"").decode()
        reply = getattr(self, request.name.lower())(request)
        if unknown := set(request.fields) - read - PASSED_OVER:
            self.refuse("P012", f"the field '{min(unknown)}' is not known here")
        self.greeted |= request.name == "HELLO"
        self.begun |= request.name == "READY"
        return reply

    def refuse(self, code: str, message: str, hint: str = "manual/port.md") -> None:
        """Report a fault in the reply."""
        raise FaultError(code, message, hint, self.program, 4)

    def check_order(self, request: Message) -> None:
        """HELLO is first, READY precedes steps, and a verb needs its capability."""
        name, can = request.name, self.capabilities.split(",")
        if not self.greeted and name not in ("HELLO", "STOP", "ABORT"):
            self.refuse("P021", f"{name} before HELLO")
        if not hasattr(self, name.lower()) or NEEDS.get(name, can[0]) not in can:
            self.refuse("P427", f"{self.program} does not answer {name}", self.capabilities)
        if name in STEPS and not self.begun:
            self.refuse("P021", f"{name} before READY")

    def needed(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        """Return a required field of numbers; a shape of -1 is any."""
        value = self.take(name)
        if value is None:
            self.refuse("P009", f"the field '{name}' is missing")
        if isinstance(value, bytes):
            self.refuse("P011", f"the field '{name}' holds text, numbers were due")
        value, kind = np.asarray(value), "i" if name in INTEGERS else "f"
        if value.dtype.kind != kind:
            self.refuse("P011", f"the field '{name}' holds numbers of another kind")
        if value.ndim == 1 and len(shape) == 2 and shape[1] == 1:
            value = value[:, None]
        pairs = zip(shape, value.shape, strict=False)
        if value.ndim != len(shape) or any(w not in (-1, s) for w, s in pairs):
            self.refuse("P010", f"the field '{name}' is {value.shape}, {shape} is due")
        return value

    def hello(self, request: Message) -> Values:
        """Say who this is."""
        self.take(Field.RUN_ID), self.take(Field.RESTART)
        if int(self.needed(Field.PROTOCOL, (1,))[0]) != PROTOCOL:
            self.refuse("P005", "the partner uses another protocol")
        return {
            Field.PROGRAM: self.program, Field.VERSION: self.version, Field.DECK_HASH: "none",
            Field.CAPABILITIES: self.capabilities, Field.GRAVITY: np.array(self.gravity),
            Field.TIME: 0.0, Field.T_END: 0.0, Field.STEP_LIMIT: 0.0, Field.RANKS: 1,
            Field.ANALYSIS: self.analysis,
        }  # fmt: skip

    def describe(self, request: Message) -> Values:
        """Tell the mesh or a group of facets."""
        what, group = self.words(Field.WHAT), self.words(Field.GROUP)
        if what == "facets" and group in self.facets:
            rows = self.facets[group] + 1
            return {Field.CONNECTIVITY: rows, Field.KIND: np.full(len(rows), CELLS[self.facet])}
        if what == "groups":
            return {Field.NAMES: "\n".join(self.facets)}
        if what != "mesh":
            self.refuse("P301", f"nothing is known of {what} '{group}'", ", ".join(self.facets))
        count, corners = self.cells.shape
        nodes = self.cells + 1
        start = 1 + corners * np.arange(count + 1)
        mesh: Values = {
            Field.ID: np.arange(1, len(self.x) + 1), Field.X: self.x, Field.MASS_U: self.mass,
            Field.KIND: np.full(count, CELLS[self.cell]), Field.START: start,
            Field.NODE: nodes.ravel(),
        }  # fmt: skip
        return mesh | ({Field.CONNECTIVITY: nodes} if self.cell == "hex8" else {})

    def select(self, request: Message) -> Values:
        """Keep a set of nodes."""
        name, role = self.words(Field.SET), self.words(Field.ROLE)
        nodes = self.needed(Field.ID, (-1,)) - 1
        if role not in self.capabilities.split(",") or not name:
            self.refuse("P427", f"{self.program} has no role '{role}'", self.capabilities)
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(self.x):
            self.refuse("P302", "there is no such node", f"1 to {len(self.x)}")
        self.sets[name] = role, nodes.copy()
        return {Field.MASS: self.mass[nodes], Field.STIFFNESS: self.stiffness[nodes],
                Field.HELD: self.held[nodes].astype(int),
                Field.SPEED: self.v[nodes]}  # fmt: skip

    def set(self, request: Message) -> Values:
        """Take springs or the dead load of a set."""
        what = self.words(Field.WHAT)
        if what == "springs" and "springs" in self.capabilities.split(","):
            k = self.needed(Field.STIFFNESS, (-1,))
            node, weight = (np.atleast_2d(self.take(n)) for n in (Field.NODE, Field.WEIGHT))
            node, weight = node.reshape(len(k), -1) - 1, weight.reshape(len(k), -1)
            self.springs = [(n[w != 0.0], w[w != 0.0], s)
                            for n, w, s in zip(node, weight, k, strict=True)]  # fmt: skip
        elif what == "dead_load" and "dead_load" in self.capabilities.split(","):
            nodes = self.nodes_of(self.words(Field.SET))
            self.dead[nodes] = self.needed(Field.FORCE, (len(nodes), 3))
        else:
            self.refuse("P301", f"nothing is known of SET {what}", self.capabilities)
        return {Field.STEP_LIMIT: 0.0}

    def nodes_of(self, name: str) -> np.ndarray:
        """Return the nodes of a set."""
        if name not in self.sets:
            self.refuse("P302", f"no set '{name}' was selected", "SELECT it first")
        return self.sets[name][1]

    def ready(self, request: Message) -> Values:
        """Tell the accepted state; a rehearsal that ends leaves state and an empty ledger."""
        if not request.flag(Field.REHEARSAL):
            self.work = self.old_work = 0.0
        return self.state(0)

    def solve(self, request: Message) -> Values:
        """Solve from the accepted state to t1."""
        load = self.loads(request)
        iterations = self.step(load, request.t1 - request.t0)
        self.load = load
        return self.state(iterations)

    def loads(self, request: Message) -> np.ndarray:
        """Return dead loads and those of a request on all nodes (n, 3) [N]."""
        load = self.dead.copy()
        for name, (role, nodes) in self.sets.items():
            if role == "load" and f"{name}.{Field.FORCE}" in request.fields:
                force = self.needed(f"{name}.{Field.FORCE}", (len(nodes), 3))
                np.add.at(load, nodes, force)
        return load

    def step(self, load: np.ndarray, duration: float) -> int:
        """Go from the accepted state over a duration [s] to load (n, 3) [N]; return iterations."""
        iterations = self.balance(load)
        moved = self.u - self.accepted
        self.v = moved / duration if duration > 0.0 else np.zeros(self.x.shape)
        self.work = self.old_work + 0.5 * float(np.sum((self.old_load + load) * moved))
        return iterations

    def accept(self, request: Message) -> Values:
        """Keep the step."""
        self.accepted, self.old_load, self.old_work = self.u.copy(), self.load, self.work
        return {}

    def reject(self, request: Message) -> Values:
        """Go back to the accepted state."""
        self.u, self.v = self.accepted.copy(), np.zeros(self.x.shape)
        self.load, self.work = self.old_load, self.old_work
        return {}

    def write(self, request: Message) -> Values:
        """Have no output of its own."""
        return {Field.PATH: ""}

    def stop(self, request: Message) -> Values:
        """End."""
        return {}

    abort = stop

    def state(self, iterations: int) -> Values:
        """Tell motion of all sets, iterations and energies."""
        reply: Values = {Field.ITERATIONS: iterations, Field.SCALARS: self.scalars()}
        for name, (_, nodes) in self.sets.items():
            reply |= {f"{name}.{Field.U}": self.u[nodes], f"{name}.{Field.V}": self.v[nodes],
                      f"{name}.{Field.A}": self.a[nodes]}  # fmt: skip
        return reply

    def scalars(self) -> np.ndarray:
        """Return the table of scalars (19)."""
        scalars = np.zeros(SCALAR_COUNT)
        scalars[SCALARS["elastic"]] = self.elastic_energy()
        scalars[SCALARS["boundary"]] = self.work
        return scalars
