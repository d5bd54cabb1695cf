"""A solid at the exchange port that is no part of Talus: a rigid plate on a spring.

Usage: partner.py plate.toml --port=hdf5:FOLDER/SIDE (talus-couple puts both behind the command)
The plate moves up and down alone. Its mesh is one hex8: four nodes on the ground, four on the
plate, whose upper face is the facet group `top`. It has no mass: SOLVE gives u = force/stiffness.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.port import Message, Values, serve, spec_of
from talus.port_names import CELLS, SCALAR_COUNT, SCALARS, Field

CAPABILITIES = "report,load,solve,reject,rehearsal"


class Plate:
    """State of the plate, and an answer to each verb that it knows."""

    def __init__(self, edge: float, depth: float, stiffness: float) -> None:
        """Make the mesh (node numbers from 1) and stand still."""
        a = 0.5 * edge
        square = np.array([[-a, -a], [a, -a], [a, a], [-a, a]])
        levels = [np.column_stack([square, np.full(4, z)]) for z in (-depth, 0.0)]
        self.x = np.vstack(levels)
        self.stiffness = stiffness
        self.sets: dict[str, np.ndarray] = {}  # nodes of each set, from 0
        self.loaded: list[str] = []
        self.height = self.trial = self.rate = 0.0  # accepted and tried [m], of the trial [m/s]

    def answer(self, request: Message) -> Values:
        """Return the fields of the reply to a request."""
        return getattr(self, request.name.lower(), self.refuse)(request)

    def refuse(self, request: Message) -> Values:
        """Say that this verb is not among the capabilities."""
        raise FaultError("P301", f"the plate has no {request.name}", CAPABILITIES, "", 4)

    def hello(self, request: Message) -> Values:
        """Say who this is."""
        return {
            Field.PROGRAM: "plate", Field.VERSION: "1.0 of another make", Field.DECK_HASH: "none",
            Field.CAPABILITIES: CAPABILITIES, Field.GRAVITY: np.zeros(3), Field.TIME: 0.0,
            Field.T_END: 0.0, Field.STEP_LIMIT: 0.0, Field.RANKS: 1, Field.ANALYSIS: "static",
        }  # fmt: skip

    def describe(self, request: Message) -> Values:
        """Tell the mesh or the facets of `top`."""
        what = request.text(Field.WHAT)
        if what == "facets" and request.text(Field.GROUP) == "top":
            return {Field.CONNECTIVITY: np.array([[5, 6, 7, 8]]), Field.KIND: CELLS["quad4"]}
        if what != "mesh":
            raise FaultError("P301", f"the plate cannot describe {what}", "mesh, facets of 'top'")
        nodes = np.arange(1, 9)
        return {
            Field.ID: nodes, Field.X: self.x, Field.MASS_U: np.zeros(8), Field.KIND: CELLS["hex8"],
            Field.START: np.array([1, 9]), Field.NODE: nodes, Field.CONNECTIVITY: nodes[None],
        }  # fmt: skip

    def select(self, request: Message) -> Values:
        """Keep a set of nodes."""
        name, nodes = request.text(Field.SET), np.ravel(request.fields[Field.ID]) - 1
        self.sets[name] = nodes
        if request.text(Field.ROLE) == "load":
            self.loaded.append(name)
        held = np.ones((len(nodes), 3), dtype=int)
        held[nodes >= 4, 2] = 0
        return {
            Field.MASS: np.zeros(len(nodes)), Field.HELD: held,
            Field.STIFFNESS: np.full(len(nodes), self.stiffness / 4.0),
            Field.SPEED: np.zeros((len(nodes), 3)),
        }  # fmt: skip

    def ready(self, request: Message) -> Values:
        """Tell the state before the first step."""
        return self.state(0)

    def solve(self, request: Message) -> Values:
        """Put the plate where the spring bears the forces on its nodes."""
        force = 0.0
        for name in self.loaded:
            nodal = request.fields.get(f"{name}.{Field.FORCE}", np.zeros((0, 3)))
            force += nodal[self.sets[name] >= 4, 2].sum()
        self.trial = force / self.stiffness
        self.rate = (self.trial - self.height) / (request.t1 - request.t0)
        return self.state(1)

    def accept(self, request: Message) -> Values:
        """Keep the step."""
        self.height = self.trial
        return {}

    def reject(self, request: Message) -> Values:
        """Forget it."""
        self.trial, self.rate = self.height, 0.0
        return {}

    def stop(self, request: Message) -> Values:
        """End: there are no files to close."""
        return {}

    abort = stop

    def state(self, iterations: int) -> Values:
        """Tell motion of all sets, iterations and scalars."""
        scalars = np.zeros(SCALAR_COUNT)
        scalars[SCALARS["elastic"]] = 0.5 * self.stiffness * self.trial**2
        scalars[SCALARS["boundary"]] = scalars[SCALARS["elastic"]]
        reply: Values = {Field.ITERATIONS: iterations, Field.SCALARS: scalars}
        for name, nodes in self.sets.items():
            up = np.outer(nodes >= 4, [0.0, 0.0, 1.0])
            reply |= {f"{name}.{Field.U}": self.trial * up, f"{name}.{Field.V}": self.rate * up,
                      f"{name}.{Field.A}": 0.0 * up}  # fmt: skip
        return reply


if __name__ == "__main__":
    deck = tomllib.loads(Path(sys.argv[1]).read_text())
    sys.exit(serve(spec_of(sys.argv), Plate(**deck).answer))
