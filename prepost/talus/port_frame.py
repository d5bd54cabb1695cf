"""What the frames of both sides of the exchange port share: order of verbs, fields, faults.

`Solid` of talus.port_solid and `Grains` of talus.port_grains derive from `Partner`, whose methods
are named after the verbs.
"""

import sys
from collections.abc import Callable

import numpy as np

from talus.faults import FaultError
from talus.port import Message, Values, port_of, serve
from talus.port_names import PROTOCOL, Field

NEEDS = {"SOLVE": "solve", "ADVANCE": "advance", "REJECT": "reject"}  # of verbs that are here
STEPS = ("ADVANCE", "SOLVE", "FORCE", "KICK_DRIFT", "ACCEPT", "REJECT")
INTEGERS = {Field.ID, Field.NODE, Field.PROTOCOL}
PASSED_OVER = {Field.FINAL, Field.TRIAL, Field.TAG, Field.EARLY, Field.REHEARSAL, Field.FIELDS}


class Partner:
    """A partner of talus-couple; a method of the name of a verb answers it."""

    program, version, gravity = "partner", "1.0", (0.0, 0.0, 0.0)
    capabilities = "report"

    def __init__(self) -> None:
        """Wait to be greeted."""
        self.sets: dict[str, tuple[str, np.ndarray]] = {}  # role and rows of nodes or grains
        self.greeted = self.begun = False

    def run(self, spec: str) -> int:
        """Serve talus-couple to the end; return the exit code."""
        return serve(spec, self.answer)

    def answer(self, request: Message) -> Values:
        """Return the fields of the reply to a request."""
        self.check_order(request)
        read: set[str] = set()
        self.fields = request.fields
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
        answers = callable(getattr(self, name.lower(), None))
        if not answers or NEEDS.get(name, can[0]) not in can:
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

    def can(self, word: str) -> bool:
        """Return whether a capability is told."""
        return word in self.capabilities.split(",")

    def hello(self, request: Message) -> Values:
        """Say who this is."""
        self.take(Field.RUN_ID), self.take(Field.RESTART)
        if int(self.needed(Field.PROTOCOL, (1,))[0]) != PROTOCOL:
            self.refuse("P005", "the partner uses another protocol")
        return {
            Field.PROGRAM: self.program, Field.VERSION: self.version, Field.DECK_HASH: "none",
            Field.CAPABILITIES: self.capabilities, Field.GRAVITY: np.array(self.gravity),
            Field.TIME: 0.0, Field.T_END: 0.0, Field.STEP_LIMIT: 0.0, Field.RANKS: 1,
        }  # fmt: skip

    def rows_of(self, name: str) -> np.ndarray:
        """Return the rows of a set."""
        if name not in self.sets:
            self.refuse("P302", f"no set '{name}' was selected", "SELECT it first")
        return self.sets[name][1]

    def write(self, request: Message) -> Values:
        """Have no output of its own."""
        return {Field.PATH: ""}

    def stop(self, request: Message) -> Values:
        """End."""
        return {}

    abort = stop


def start(make: Callable[[], Partner]) -> int:
    """Make a partner and serve the port of the command line; return the exit code.

    A fault before the port is joined, as in its deck, is printed.
    """
    try:
        return make().run(port_of(sys.argv))
    except FaultError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
