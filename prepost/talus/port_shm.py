"""An end of the exchange port in shared memory (manual/port.md), by libtalus_port.

The library moves messages and looks whether the other side lives; what is in a message is `Message`
of talus.port. Messages are arrays of words, of which fields are views.
"""

import ctypes
import ctypes.util
import os
from functools import cache
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.port_names import HEADER

NAME = "libtalus_port.so"
LOST = -1


def find_library() -> str:
    """Return the path of libtalus_port beside the programs, in the checkout or on the system."""
    folders = [Path(os.environ["TALUS_BIN"]).parent / "lib"] if "TALUS_BIN" in os.environ else []
    folders += [folder / "build/lib" for folder in Path(__file__).resolve().parents]
    for folder in folders:
        if (folder / NAME).is_file():
            return str((folder / NAME).resolve())
    if found := ctypes.util.find_library("talus_port"):
        return found
    raise FaultError("E571", f"{NAME} was not found", "build it (make) or set TALUS_BIN", "", 4)


@cache
def library() -> ctypes.CDLL:
    """Return the library with the types of what is called here (libport/talus_port.h)."""
    lib = ctypes.CDLL(find_library())
    port, text, words = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
    long, integer = ctypes.c_int64, ctypes.c_int
    for name, result, arguments in (
        ("open", port, (text,)), ("offer", port, (text, text, long)), ("why", text, (port,)),
        ("beat", None, (port,)), ("close", None, (port,)), ("partner", integer, (port,)),
        ("incoming", long, (port, ctypes.c_double)), ("partner_beat", long, (port,)),
        ("take", integer, (port, words, long)), ("push", integer, (port, words, long)),
        ("checksum", ctypes.c_uint64, (words, long)), ("run_id", text, (port,)),
    ):  # fmt: skip
        function = getattr(lib, f"talus_port_{name}")
        function.restype, function.argtypes = result, arguments
    return lib


def checksum(words: np.ndarray) -> int:
    """Return the checksum of a message (n words): word 10 counts as 0."""
    return library().talus_port_checksum(words.ctypes.data, len(words))


class SharedEnd:
    """One end of a segment: `SharedEnd(spec)` joins as a solver, `SharedEnd.offer` makes it."""

    def __init__(self, spec: str, *, run_id: str = "") -> None:
        """Join shm:/NAME or attach:FILE, or make shm:/NAME when a run id is given."""
        self.lib = library()
        if run_id:
            name = spec.removeprefix("shm:").encode()
            self.port = self.lib.talus_port_offer(name, run_id.encode(), 0)
        else:
            self.port = self.lib.talus_port_open(spec.encode())
        if why := self.why():
            self.close()
            raise FaultError("E572", why, "is talus-couple running on this host?", spec, 4)

    @classmethod
    def offer(cls, spec: str, run_id: str) -> "SharedEnd":
        """Make the segment, as talus-couple does."""
        return cls(spec, run_id=run_id)

    def why(self) -> str:
        """Return why the last call failed, empty when it did not."""
        return self.lib.talus_port_why(self.port).decode()

    def pull(self, limit: float = -1.0) -> np.ndarray | None:
        """Wait for a message and return its words (n); None after `limit` s, E572 when lost."""
        count = self.lib.talus_port_incoming(self.port, limit)
        if count == 0:
            return None
        words = np.empty(max(count, 0), dtype="<i8")
        if count < 0 or self.lib.talus_port_take(self.port, words.ctypes.data, count) == LOST:
            raise FaultError("E572", self.why(), "the log of the coupled run has the reason",
                             "port", 4)  # fmt: skip
        return words

    def push(self, words: np.ndarray) -> None:
        """Send words (n); E572 when the other side is gone."""
        words = np.ascontiguousarray(words)
        if self.lib.talus_port_push(self.port, words.ctypes.data, len(words)) == LOST:
            raise FaultError("E572", self.why(), "the log of the coupled run has the reason",
                             "port", 4)  # fmt: skip

    def beat(self) -> None:
        """Let the heartbeat move."""
        self.lib.talus_port_beat(self.port)

    def partner(self) -> int:
        """Return the process number of the other side, 0 while it has not joined."""
        return self.lib.talus_port_partner(self.port)

    def partner_beat(self) -> int:
        """Return the heartbeat of the other side."""
        return self.lib.talus_port_partner_beat(self.port)

    def close(self) -> None:
        """Leave the port."""
        if self.port:
            self.lib.talus_port_close(self.port)
        self.port = None


def is_whole(words: np.ndarray) -> bool:
    """Return whether the checksum in a message is that of its words."""
    return len(words) > HEADER["checksum"] and int(
        words[HEADER["checksum"]].view("<u8")
    ) == checksum(words)
