"""The port's hdf5 transport in Python, as the manual's page describes it: for partners that err.

`Message` is one message; `join` and `offer` open the two ends; `read` and `write` move messages.
"""

import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

# fmt: off
VERBS = [
    "HELLO", "DESCRIBE", "SELECT", "SET", "READY", "ADVANCE", "SOLVE", "FORCE", "KICK_DRIFT",
    "ACCEPT", "REJECT", "CHECKPOINT", "WRITE", "STOP", "ABORT",
]
WORDS = [
    "magic", "protocol", "sequence", "verb", "step", "t0", "t1", "status", "fields", "words",
    "checksum",
]
# fmt: on
MAGIC = int.from_bytes(b"TALUSMSG", "little")
KINDS = {"f": 1, "i": 2, "S": 3}
PATIENCE = 100.0


@dataclass
class Message:
    """Header values by name, fields by name: arrays as h5py sees them, or bytes for text."""

    verb: int
    sequence: int
    step: int = 0
    t0: float = 0.0
    t1: float = 0.0
    status: int = 0
    protocol: int = 1
    fields: dict[str, np.ndarray | bytes] = field(default_factory=dict)

    def header(self) -> np.ndarray:
        """Return the header's words with words and checksum as they should be."""
        data = [self.words_of(name) for name in self.fields]
        head = np.zeros(16, dtype="<i8")
        head[0] = np.array(MAGIC, dtype="<u8").view("<i8")
        head[1:5] = self.protocol, self.sequence, self.verb, self.step
        head[5:7] = np.array([self.t0, self.t1]).view("<i8")
        head[7:10] = self.status, len(self.fields), 16 + sum(len(words) for words in data)
        w = np.concatenate([head, *data]).view("<u8")
        s1 = w.sum(dtype="u8")
        s2 = (w * np.arange(1, w.size + 1, dtype="u8")).sum(dtype="u8")
        head[10] = (s1 ^ ((s2 << np.uint64(32)) | (s2 >> np.uint64(32)))).view("<i8")
        return head

    def words_of(self, name: str) -> np.ndarray:
        """Return description and data of a field as words."""
        value = self.fields[name]
        if isinstance(value, bytes):
            count, components, kind = len(value), 1, 3
            data = np.frombuffer(value + b"\0" * (-len(value) % 8), dtype="<i8")
        else:
            count = len(value)
            components = value.shape[1] if value.ndim == 2 else 1
            kind, data = KINDS[value.dtype.kind], np.ascontiguousarray(value).reshape(-1)
            data = data.view("<i8")
        head = np.frombuffer(name.encode().ljust(48), dtype="<i8")
        return np.concatenate([head, np.array([kind, components, count, len(data)]), data])


def write(stem: str, message: Message, ending: str, **wrong: int) -> None:
    """Write a message file STEM.ENDING.h5; `wrong` overrides header words by name."""
    path = Path(f"{stem}.{ending}.h5")
    head = dict(zip(WORDS, message.header(), strict=False)) | wrong
    with h5py.File(f"{path}.tmp", "w") as file:
        for name in WORDS:
            value = np.int64(head[name])
            file.attrs[name] = value.view(np.float64) if name in ("t0", "t1") else value
        group = file.create_group("fields")
        for name, value in message.fields.items():
            if isinstance(value, bytes):
                text = np.array(value, dtype=f"S{max(1, len(value))}")
                group[name] = text if value else h5py.Empty("S1")
            else:
                group[name] = value
        order = "".join(f"{name}\n" for name in message.fields).encode()
        file["order"] = np.array(order, dtype=f"S{len(order)}") if order else h5py.Empty("S1")
    os.replace(f"{path}.tmp", path)


def read(stem: str, sequence: int, ending: str) -> Message | None:
    """Wait for a message file, read and remove it; None when it does not come."""
    path = Path(f"{stem}.{sequence:08d}.{ending}.h5")
    limit = time.monotonic() + PATIENCE
    while not path.exists():
        if time.monotonic() > limit or (ending == "request" and not path.parent.exists()):
            return None
        time.sleep(0.001)
    with h5py.File(path) as file:
        a = file.attrs
        message = Message(int(a["verb"]), int(a["sequence"]), int(a["step"]), float(a["t0"]))
        message.t1, message.status = float(a["t1"]), int(a["status"])
        order = file["order"]
        names = [] if order.shape is None else order[()].decode().split()
        for name in names:
            data = file["fields"][name]
            text = data.dtype.kind == "S"
            value = b"" if data.shape is None else data[()]
            message.fields[name] = bytes(value) if text else value
    path.unlink()
    return message


def place() -> str:
    """Return boot id and process namespace, as the programs write them."""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return f"{boot}/{os.stat('/proc/self/ns/pid').st_ino}"


def lines(path: Path, *text: str) -> None:
    """Write a small text file under another name and rename it."""
    hidden = path.with_name(path.name + ".new")
    hidden.write_text("".join(f"{line}\n" for line in text))
    os.replace(hidden, path)


def join(stem: str) -> None:
    """Join a port that talus-couple offers."""
    limit = time.monotonic() + PATIENCE
    while not Path(f"{stem}.port").exists() and time.monotonic() < limit:
        time.sleep(0.01)
    Path(f"{stem}.port").unlink()
    lines(Path(f"{stem}.joined"), place(), str(os.getpid()))
    lines(Path(f"{stem}.beat"), "1")


def offer(stem: str) -> None:
    """Offer a port to a solver, as talus-couple does."""
    Path(stem).parent.mkdir(exist_ok=True)
    lines(Path(stem).parent / "couple.beat", "1")
    lines(Path(f"{stem}.port"), "talus-port 1", "test", place(), str(os.getpid()), "false")


def spec_of(arguments: list[str]) -> str:
    """Return the stem in --port=hdf5:STEM."""
    return next(a[len("--port=hdf5:") :] for a in arguments if a.startswith("--port=hdf5:"))


class Asker:
    """Asks a solver, one request after the other, and prints the faults that it reports."""

    def __init__(self, stem: str) -> None:
        """Offer the port."""
        self.stem, self.sequence = stem, 0
        offer(stem)

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request and return the reply; in names of fields `__` stands for a dot."""
        self.sequence += 1
        request = Message(VERBS.index(verb) + 1, self.sequence, 0, t0, t1)
        for name, value in fields.items():
            if isinstance(value, str):
                request.fields[name.replace("__", ".")] = value.encode()
            else:
                request.fields[name.replace("__", ".")] = np.atleast_1d(np.array(value))
        write(f"{self.stem}.{self.sequence:08d}", request, "request")
        reply = read(self.stem, self.sequence, "reply")
        if reply is None:
            sys.exit("no reply")
        if reply.status:
            text = {k: v.decode() for k, v in reply.fields.items()}
            print(f"error {text['error.code']}: {text['error.message']}")
            print(f"  {text['error.place']}\n  hint: {text['error.hint']}", flush=True)
        return reply

    def forge(self, verb: int) -> None:
        """Send a request with a verb that is none."""
        self.sequence += 1
        write(f"{self.stem}.{self.sequence:08d}", Message(verb, self.sequence), "request")
        sys.exit(0)

    def hello(self) -> Message:
        """Greet."""
        return self.ask("HELLO", run_id="test", restart="", protocol=1)
