"""What the frames of both sides of the exchange port share: order of verbs, fields, faults.

`Solid` of talus.port_solid and `Grains` of talus.port_grains derive from `Partner`, whose methods
are named after the verbs.
"""

import sys
from collections.abc import Callable

import numpy as np

from talus.faults import FaultError
from talus.port import Message, Values, port_of, serve
from talus.port_checkpoint import (
    State,
    find_checkpoint,
    hash_of,
    read_checkpoint,
    write_checkpoint,
)
from talus.port_names import PROTOCOL, Field

NEEDS = {"SOLVE": "solve", "ADVANCE": "advance", "REJECT": "reject",
         "CHECKPOINT": "checkpoint"}  # of verbs that are here  # fmt: skip
STEPS = ("ADVANCE", "SOLVE", "FORCE", "KICK_DRIFT", "ACCEPT", "REJECT")
INTEGERS = {Field.ID, Field.NODE, Field.PROTOCOL}
PASSED_OVER = {Field.FINAL, Field.TRIAL, Field.TAG, Field.EARLY, Field.REHEARSAL, Field.FIELDS}


class Partner:
    """A partner of talus-couple; a method of the name of a verb answers it."""

    program, version, gravity = "partner", "1.0", (0.0, 0.0, 0.0)
    capabilities = "report"
    longest = 3600.0  # s of work on one request after which its heartbeat stops

    def __init__(self) -> None:
        """Wait to be greeted."""
        self.sets: dict[str, tuple[str, np.ndarray]] = {}  # role and rows of nodes or grains
        self.greeted = self.begun = False
        self.time = self.start_time = 0.0  # of the accepted state, and where the run begins [s]
        self.trial_time = 0.0  # of what was not accepted yet [s]
        self.resumed = False  # a checkpoint was read, and READY has not begun the run from it

    def run(self, spec: str) -> int:
        """Serve talus-couple to the end; return the exit code."""
        return serve(spec, self.answer, self.longest)

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
        self.keep_time(request)
        return reply

    def keep_time(self, request: Message) -> None:
        """Follow the time of the trial and of the accepted state; READY begins the run."""
        name = request.name
        if name in ("SOLVE", "ADVANCE"):
            self.trial_time = request.t1
        elif name == "KICK_DRIFT":
            self.trial_time += float(np.ravel(request.fields.get(Field.DRIFT, 0.0))[0])
        elif name == "ACCEPT":
            self.time = self.trial_time
        elif name == "REJECT":
            self.trial_time = self.time
        elif name == "READY":
            self.begun = True
            if not request.flag(Field.REHEARSAL):
                self.time = self.trial_time = self.start_time
                self.resumed = False

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
        self.take(Field.RUN_ID)
        restart = self.words(Field.RESTART)
        if int(self.needed(Field.PROTOCOL, (1,))[0]) != PROTOCOL:
            self.refuse("P005", "the partner uses another protocol")
        if restart:
            self.resume(restart)
        return {
            Field.PROGRAM: self.program, Field.VERSION: self.version, Field.DECK_HASH: "none",
            Field.CAPABILITIES: self.capabilities, Field.GRAVITY: np.array(self.gravity),
            Field.TIME: self.time, Field.T_END: 0.0, Field.STEP_LIMIT: 0.0, Field.RANKS: 1,
        }  # fmt: skip

    def resume(self, restart: str) -> None:
        """Take the state of a checkpoint, which was told to be possible (P427)."""
        if not self.can("checkpoint"):
            self.refuse("P427", f"{self.program} writes no checkpoints", self.capabilities)
        path = find_checkpoint(self.program, restart)
        if path is None:
            return
        self.time, state = read_checkpoint(self.program, path)
        self.start_time, self.resumed = self.time, True
        try:
            self.take_state(state)
        except (KeyError, ValueError) as fault:
            text = f"its state does not fit this {self.program}: {fault}"
            hint = "go on with the same mesh and model"
            raise FaultError("E670", text, hint, str(path), 4) from fault

    def checkpoint(self, request: Message) -> Values:
        """Write the accepted state."""
        tag = request.text(Field.TAG)
        path = write_checkpoint(self.program, tag, self.time, self.accepted_state())
        return {Field.PATH: str(path), Field.HASH: hash_of(path)}

    def accepted_state(self) -> State:
        """Return all that the next step needs, by name."""
        raise NotImplementedError

    def take_state(self, state: State) -> None:
        """Go on from what `accepted_state` returned."""
        raise NotImplementedError

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
