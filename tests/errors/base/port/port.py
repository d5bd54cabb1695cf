"""Ends of the port's hdf5 transport for partners that err; messages are those of talus.port."""

import sys

from talus.port import (
    Message,
    join,
    offer,
    place,
    read_message,
    spec_of,
    write_lines,
    write_message,
)
from talus.port_names import PROTOCOL, VERBS, Field

__all__ = ["Asker", "Message", "VERBS", "join", "offer", "place",
           "read", "spec_of", "write", "write_lines"]  # fmt: skip
read, write = read_message, write_message


class Asker:
    """Asks a solver, one request after the other, and prints the faults that it reports."""

    def __init__(self, stem: str) -> None:
        """Offer the port."""
        self.stem, self.sequence = stem, 0
        offer(stem)

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request and return the reply; in names of fields `__` stands for a dot."""
        self.sequence += 1
        request = Message(VERBS[verb], self.sequence, 0, t0, t1)
        request.put({name.replace("__", "."): value for name, value in fields.items()})
        write(self.stem, request, "request")
        reply = read(self.stem, self.sequence, "reply")
        if reply is None:
            sys.exit("no reply")
        if reply.status:
            text = {k: v.decode() for k, v in reply.fields.items()}
            print(f"error {text[Field.ERROR_CODE]}: {text[Field.ERROR_MESSAGE]}")
            print(f"  {text[Field.ERROR_PLACE]}\n  hint: {text[Field.ERROR_HINT]}", flush=True)
        return reply

    def forge(self, verb: int) -> None:
        """Send a request with a verb that is none."""
        self.sequence += 1
        write(self.stem, Message(verb, self.sequence), "request")
        sys.exit(0)

    def hello(self) -> Message:
        """Greet."""
        return self.ask("HELLO", run_id="test", restart="", protocol=PROTOCOL)
