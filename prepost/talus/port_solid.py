"""The frame of a static solid at the exchange port (manual/own-solver.md).

A partner derives from `Solid`, gives its mesh and a `balance`; order of verbs, sets, springs, dead
loads, trial and accepted state, energies and faults are here.
"""

import numpy as np

from talus.port import Message, Values
from talus.port_checkpoint import State
from talus.port_frame import Partner
from talus.port_names import CELLS, SCALAR_COUNT, SCALARS, Field


class Solid(Partner):
    """A solid with nodes x (n, 3) in m, cells (e, k) and facets by name, node numbers from 0.

    `held` (n, 3) marks what is supported, `mass` (n) is lumped [kg], `stiffness` (n) the diagonal
    of the stiffness [N/m]. `balance` is the one thing that a partner must do.
    """

    program, analysis = "solid", "static"
    capabilities = "report,load,solve,reject,rehearsal,springs,dead_load"

    def __init__(self, x: np.ndarray, cells: np.ndarray, facets: dict[str, np.ndarray],
                 cell: str = "hex8", facet: str = "quad4") -> None:  # fmt: skip
        """Keep the mesh and stand still."""
        super().__init__()
        self.x, self.cells, self.facets, self.cell, self.facet = x, cells, facets, cell, facet
        self.held, self.mass = np.zeros(x.shape, dtype=bool), np.zeros(len(x))
        self.stiffness = np.zeros(len(x))
        self.u, self.v = np.zeros(x.shape), np.zeros(x.shape)  # of the trial [m, m/s]
        self.a = np.zeros(x.shape)  # [m/s2]
        self.accepted = self.u.copy()
        self.dead = np.zeros(x.shape)  # [N]
        self.springs: list[tuple[np.ndarray, np.ndarray, float]] = []  # nodes, weights, N/m
        self.old_load = np.zeros(x.shape)  # of the accepted state [N]
        self.load = self.old_load
        self.work = self.old_work = 0.0  # of loads [J]

    def balance(self, load: np.ndarray) -> int:
        """Set self.u (n, 3) in m in balance with load (n, 3) in N; supports hold.

        `self.springs` hold Σ weight u of their nodes where the accepted state has it. Returns the
        number of iterations, 1 or more; FaultError (exit code 2) where there is no balance.
        """
        raise NotImplementedError

    def elastic_energy(self) -> float:
        """Return the energy stored in the trial state [J]; 0 where a solver does not know it."""
        return 0.0

    def hello(self, request: Message) -> Values:
        """Say who this is."""
        return super().hello(request) | {Field.ANALYSIS: self.analysis}

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
        if not self.can(role) or not name:
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
        if what == "springs" and self.can("springs"):
            k = self.needed(Field.STIFFNESS, (-1,))
            node, weight = (np.atleast_2d(self.take(n)) for n in (Field.NODE, Field.WEIGHT))
            node, weight = node.reshape(len(k), -1) - 1, weight.reshape(len(k), -1)
            self.springs = [(n[w != 0.0], w[w != 0.0], s)
                            for n, w, s in zip(node, weight, k, strict=True)]  # fmt: skip
        elif what == "dead_load" and self.can("dead_load"):
            nodes = self.rows_of(self.words(Field.SET))
            self.dead[nodes] = self.needed(Field.FORCE, (len(nodes), 3))
        else:
            self.refuse("P301", f"nothing is known of SET {what}", self.capabilities)
        return {Field.STEP_LIMIT: 0.0}

    def ready(self, request: Message) -> Values:
        """Tell the accepted state; a rehearsal that ends leaves state and an empty ledger."""
        if not (request.flag(Field.REHEARSAL) or self.resumed):
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

    def accepted_state(self) -> State:
        """Return what a checkpoint holds; a solid with a history of its own adds it."""
        return {"u": self.accepted, "v": self.v, "a": self.a, "load": self.old_load,
                "dead": self.dead, "work": np.array(self.old_work)}  # fmt: skip

    def take_state(self, state: State) -> None:
        """Go on from what `accepted_state` returned."""
        wrong = [name for name in ("u", "v", "a", "load", "dead")
                 if state[name].shape != self.x.shape]  # fmt: skip
        if wrong:
            raise ValueError(f"it has {len(state[wrong[0]])} nodes, {len(self.x)} are due")
        self.accepted, self.v, self.a = state["u"], state["v"], state["a"]
        self.old_load, self.dead = state["load"], state["dead"]
        self.u, self.load = self.accepted.copy(), self.old_load
        self.work = self.old_work = float(state["work"])

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
