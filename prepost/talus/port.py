"""The exchange port in Python (manual/port.md): for solvers written in Python.

`serve(port_of(sys.argv), answer)` joins the port that talus-couple offers, in shared memory or
files, and answers its requests; `Solid` of talus.port_solid is the frame of a solid. Below are the
parts: `Message`, `write_message`, `read_message`, `join`, `offer`, `spec_of`.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.crc64 import crc64
from talus.faults import FaultError
from talus.port_names import (
    FIELD_WORDS,
    HEADER,
    HEADER_WORDS,
    KINDS,
    MAGIC,
    NAME_LENGTH,
    PROTOCOL,
    STATUS,
    VERBS,
    Field,
)

REALS = ("t0", "t1", "waited")  # words of the header that are no integers
VERB_NAMES = {number: name for name, number in VERBS.items()}
KIND_OF = {"f": KINDS["real"], "i": KINDS["integer"]}
PATIENCE = 100.0  # s for a message whose sender cannot be watched
SLICE = 0.25  # s between two heartbeats
Values = dict[str, object]  # fields by name: arrays of reals or integers, numbers, texts


@dataclass
class Message:
    """Header values by name, fields by name: arrays as read by h5py, or bytes for text."""

    verb: int
    sequence: int
    step: int = 0
    t0: float = 0.0
    t1: float = 0.0
    status: int = 0
    protocol: int = PROTOCOL
    fields: dict[str, np.ndarray | bytes] = field(default_factory=dict)
    waited: int = 0  # bits of a real

    @property
    def name(self) -> str:
        """Return the verb's name."""
        return VERB_NAMES.get(self.verb, f"verb {self.verb}")

    def text(self, name: str, otherwise: str = "") -> str:
        """Return a field of text."""
        value = self.fields.get(name)
        return value.decode() if isinstance(value, bytes) else otherwise

    def flag(self, name: str) -> bool:
        """Return whether an optional field is there and is 1."""
        return name in self.fields and int(np.ravel(self.fields[name])[0]) == 1

    def put(self, values: Values) -> None:
        """Add fields: integers stay integers, other numbers become reals, str becomes bytes."""
        for name, value in values.items():
            if isinstance(value, str):
                value = value.encode()
            if not isinstance(value, bytes):
                value = np.atleast_1d(np.asarray(value))
                value = value.astype("<i8" if value.dtype.kind in "iub" else "<f8")
            self.fields[name] = value

    def header(self) -> np.ndarray:
        """Return the header's words with words and checksum as they should be."""
        return self.words()[:HEADER_WORDS]

    def words(self, checksum: Callable[[np.ndarray], int] = crc64) -> np.ndarray:
        """Return the whole message as words; `checksum` is that of words with word 10 as 0."""
        data = [self.words_of(name) for name in self.fields]
        head = np.zeros(HEADER_WORDS, dtype="<i8")
        head[HEADER["magic"]] = np.frombuffer(MAGIC, dtype="<i8")[0]
        head[1:5] = self.protocol, self.sequence, self.verb, self.step
        head[5:7] = np.array([self.t0, self.t1]).view("<i8")
        size = HEADER_WORDS + sum(len(words) for words in data)
        head[7:10] = self.status, len(self.fields), size
        head[HEADER["waited"]] = self.waited
        words = np.concatenate([head, *data])
        words[HEADER["checksum"]] = np.uint64(checksum(words)).view("<i8")
        return words

    @classmethod
    def of_words(cls, words: np.ndarray) -> "Message":
        """Return a message whose fields are views of words (n); E570 where they are not whole."""
        reals = words.view("<f8")
        integers = {name: int(words[k]) for name, k in HEADER.items() if k < len(words)}
        if len(words) < HEADER_WORDS or words[0] != np.frombuffer(MAGIC, dtype="<i8")[0]:
            raise damaged(0, "it has no header of Talus")
        known = ("verb", "sequence", "step", "status", "protocol", "waited")
        message = cls(**{name: integers[name] for name in known})
        message.t0, message.t1 = float(reals[HEADER["t0"]]), float(reals[HEADER["t1"]])
        if integers["words"] != len(words):
            raise damaged(message.sequence, f"it tells of {integers['words']} words and has "
                          f"{len(words)}")  # fmt: skip
        place = HEADER_WORDS
        for _ in range(integers["fields"]):
            name, value, place = field_at(words, place, message.sequence)
            message.fields[name] = value
        if place != len(words):
            raise damaged(message.sequence, "its fields do not fill it")
        return message

    def words_of(self, name: str) -> np.ndarray:
        """Return description and data of a field as words."""
        value = self.fields[name]
        if isinstance(value, bytes):
            count, components, kind = len(value), 1, KINDS["text"]
            data = np.frombuffer(value + b"\0" * (-len(value) % 8), dtype="<i8")
        else:
            count = len(value)
            components = value.shape[1] if value.ndim == 2 else 1
            kind, data = KIND_OF[value.dtype.kind], np.ascontiguousarray(value).reshape(-1)
            data = data.view("<i8")
        head = np.zeros(FIELD_WORDS, dtype="<i8")
        head[:6] = np.frombuffer(name.encode().ljust(NAME_LENGTH), dtype="<i8")
        head[6:] = kind, components, count, len(data)
        return np.concatenate([head, data])


def damaged(sequence: int, why: str) -> FaultError:
    """Return the fault of a message that cannot be read."""
    hint = "the partner does not follow the page, or memory was damaged"
    return FaultError("E570", f"message {sequence} of the partner: {why}", hint, "port", 4)


def field_at(words: np.ndarray, place: int, sequence: int) -> tuple[str, np.ndarray | bytes, int]:
    """Return name and value of the field at a place, the value as a view, and the place behind."""
    begin = place + FIELD_WORDS
    if begin > len(words):
        raise damaged(sequence, "a description is cut off")
    name = words[place : place + 6].tobytes().decode("ascii", "replace").rstrip()
    kind, components, count, size = (int(word) for word in words[place + 6 : begin])
    text = kind == KINDS["text"]
    wanted = -(-count // 8) if text else components * count
    if kind not in KINDS.values() or min(components, count, size) < 0 or size != wanted:
        raise damaged(sequence, f"the description of the field '{name}' is wrong")
    if begin + size > len(words):
        raise damaged(sequence, f"the field '{name}' is cut off")
    data = words[begin : begin + size]
    if text:
        return name, data.tobytes()[:count], begin + size
    value = data.view("<f8") if kind == KINDS["real"] else data
    return name, value if components == 1 else value.reshape(count, components), begin + size


def write_message(
    stem: str, message: Message, ending: str, sequence: int = 0, **wrong: int
) -> None:
    """Write STEM.SEQUENCE.ENDING.h5; `wrong` overrides words of the header by name.

    The file has the number of the message, unless another is given.
    """
    import h5py  # a partner in shared memory needs numpy alone

    path = Path(f"{stem}.{sequence or message.sequence:08d}.{ending}.h5")
    head = dict(zip(HEADER, message.header(), strict=False)) | wrong
    with h5py.File(f"{path}.tmp", "w") as file:
        for name in HEADER:
            value = np.int64(head[name])
            file.attrs[name] = value.view(np.float64) if name in REALS else value
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


def read_message(
    stem: str, sequence: int, ending: str, alive: Callable[[], bool] | None = None
) -> Message | None:
    """Wait for a message file, read and remove it; None when it does not arrive.

    The wait ends when `alive`, checked every quarter of a second, is false, else after PATIENCE. A
    message whose length or checksum is not that of its content raises E534 (exit code 4).
    """
    import h5py  # a partner in shared memory needs numpy alone

    path = Path(f"{stem}.{sequence:08d}.{ending}.h5")
    limit = time.monotonic() + (SLICE if alive else PATIENCE)
    while not path.exists():
        if time.monotonic() > limit:
            if not (alive and alive()):
                return None
            limit = time.monotonic() + SLICE
        if ending == "request" and not path.parent.exists():
            return None
        time.sleep(0.001)
    with h5py.File(path) as file:
        a = file.attrs
        message = Message(int(a["verb"]), int(a["sequence"]), int(a["step"]), float(a["t0"]))
        message.t1, message.status = float(a["t1"]), int(a["status"])
        message.protocol = int(a["protocol"])
        message.waited = int(np.array(a.get("waited", 0)).view("<i8"))
        order = file["order"]
        names = [] if order.shape is None else order[()].decode().split()
        for name in names:
            data = file["fields"][name]
            text = data.dtype.kind == "S"
            value = b"" if data.shape is None else data[()]
            message.fields[name] = bytes(value) if text else value
        seen = [int(a["words"]), int(a["checksum"])]
    head = message.header()
    if seen != [head[HEADER["words"]], head[HEADER["checksum"]]]:
        raise FaultError("E534", f"message {sequence} of the partner is damaged: its checksum is "
                         "not that of its content", "look at the disk or the memory of the host",
                         str(path), 4)  # fmt: skip
    path.unlink()
    return message


def place() -> str:
    """Return boot id and process namespace, as the programs write them."""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return f"{boot}/{os.stat('/proc/self/ns/pid').st_ino}"


def write_lines(path: Path, *text: str) -> None:
    """Write a small text file under another name and rename it."""
    hidden = path.with_name(path.name + ".new")
    hidden.write_text("".join(f"{line}\n" for line in text))
    os.replace(hidden, path)


def join(stem: str) -> list[str]:
    """Join a port that talus-couple offers, with its run id; return the lines of its offer."""
    limit = time.monotonic() + PATIENCE
    offer_file = Path(f"{stem}.port")
    while not offer_file.exists() and time.monotonic() < limit:
        time.sleep(0.01)
    text = offer_file.read_text().splitlines()
    offer_file.unlink()
    write_lines(Path(f"{stem}.joined"), place(), str(os.getpid()), text[1])
    write_lines(Path(f"{stem}.beat"), "1")
    return text


def offer(stem: str, run_id: str = "test") -> None:
    """Offer a port to a solver, as talus-couple does."""
    Path(stem).parent.mkdir(exist_ok=True)
    write_lines(Path(stem).parent / "couple.beat", "1")
    write_lines(Path(f"{stem}.port"), "talus-port 1", run_id, place(), str(os.getpid()), "false")


def spec_of(arguments: list[str]) -> str:
    """Return the stem in --port=hdf5:STEM."""
    return next(a[len("--port=hdf5:") :] for a in arguments if a.startswith("--port=hdf5:"))


def port_of(arguments: list[str]) -> str:
    """Return SPEC of --port=SPEC; E573 where there is none."""
    for argument in arguments:
        if argument.startswith("--port="):
            return argument.removeprefix("--port=")
    raise FaultError("E573", "no --port=SPEC was given", "talus-couple starts this program with it")


def due(request: Message | None, sequence: int) -> Message | None:
    """Return a request if it is the one that is due; E570 otherwise."""
    if request and (request.sequence != sequence or request.protocol != PROTOCOL):
        text = f"message {sequence} of protocol {PROTOCOL} is due"
        raise damaged(request.sequence, text)
    return request


class FileEnd:
    """The solver's end of a port in files."""

    def __init__(self, stem: str) -> None:
        """Join."""
        self.stem, self.beats, self.waits, self.sequence = stem, 1, False, 0
        self.offered = join(stem)

    def beat(self, state: str = "works") -> None:
        """Let the heartbeat move."""
        self.beats, self.waits = self.beats + 1, state == "waits"
        with suppress(FileNotFoundError):
            write_lines(Path(f"{self.stem}.beat"), str(self.beats), state)

    def alive(self) -> bool:
        """Beat; return whether talus-couple still runs, where that is known."""
        self.beat("waits")
        return Path(self.stem).parent.exists() and (
            self.offered[2] != place() or Path(f"/proc/{self.offered[3]}").exists()
        )

    def receive(self) -> Message | None:
        """Wait for the next request; None when the partner has gone."""
        self.sequence += 1
        request = read_message(self.stem, self.sequence, "request", self.alive)
        if request is not None and self.waits:
            self.beat()
        return due(request, self.sequence)

    def send(self, reply: Message) -> None:
        """Send the reply."""
        write_message(self.stem, reply, "reply")

    def close(self) -> None:
        """Leave; the files are talus-couple's."""


class MemoryEnd:
    """The solver's end of a port in shared memory."""

    def __init__(self, spec: str) -> None:
        """Join."""
        from talus.port_shm import SharedEnd, checksum  # where the library is

        self.end, self.checksum = SharedEnd(spec), checksum
        self.beat, self.close, self.sequence = self.end.beat, self.end.close, 0

    def receive(self) -> Message | None:
        """Wait for the next request; None when the partner has gone. Its fields are views."""
        try:
            words = self.end.pull()
        except FaultError as fault:
            print(fault, file=sys.stderr)
            return None
        self.sequence += 1
        seen = int(words[HEADER["checksum"]].view("<u8")) if len(words) >= HEADER_WORDS else -1
        if seen != self.checksum(words):
            raise damaged(self.sequence, "its checksum is not that of its content")
        return due(Message.of_words(words), self.sequence)

    def send(self, reply: Message) -> None:
        """Send the reply."""
        self.end.push(reply.words(self.checksum))


def open_end(spec: str) -> FileEnd | MemoryEnd:
    """Join a port: shm:/NAME, hdf5:FOLDER/SIDE, attach:FILE, or the stem of files."""
    if spec.startswith("attach:"):
        offer_file, limit = Path(spec.removeprefix("attach:")), time.monotonic() + 6 * PATIENCE
        while not offer_file.exists() and time.monotonic() < limit:
            time.sleep(0.01)
        spec = offer_file.read_text().splitlines()[0]
    if spec.startswith("shm:"):
        return MemoryEnd(spec)
    end = FileEnd(spec.removeprefix("hdf5:"))
    for number in (signal.SIGINT, signal.SIGTERM):  # they are talus-couple's
        with suppress(ValueError):  # not in the main thread
            signal.signal(number, signal.SIG_IGN)
    return end


def put_fault(reply: Message, fault: FaultError) -> None:
    """Make a reply the report of a fault."""
    reply.status, reply.fields = fault.exit_code, {}
    reply.put({Field.ERROR_CODE: fault.code, Field.ERROR_MESSAGE: fault.message,
               Field.ERROR_PLACE: fault.place, Field.ERROR_HINT: fault.hint})  # fmt: skip


class Heart:
    """Lets the heartbeat of an end go on while a request is worked on, from a thread of its own.

    With `with heart:` around the work the end beats every SLICE, for `longest` s at most: a request
    that has not ended by then counts as a hang. Calls that keep the interpreter to themselves for
    long let no thread run; then processor time is the sign of life.
    """

    def __init__(self, end: FileEnd | MemoryEnd, longest: float) -> None:
        """Start the thread."""
        self.end, self.longest = end, longest
        self.since: float | None = None  # when the work began [s], None between requests
        self.lock, self.closed = threading.Lock(), threading.Event()
        self.thread = threading.Thread(target=self.go_on, daemon=True)
        self.thread.start()

    def go_on(self) -> None:
        """Beat while there is work."""
        while not self.closed.wait(SLICE):
            with self.lock:
                if self.since is not None and time.monotonic() < self.since + self.longest:
                    self.end.beat()

    def __enter__(self) -> None:
        """Begin to work."""
        with self.lock:
            self.since = time.monotonic()

    def __exit__(self, *why: object) -> None:
        """End: no beat comes after this."""
        with self.lock:
            self.since = None

    def stop(self) -> None:
        """End the thread."""
        self.closed.set()
        self.thread.join()


def serve(spec: str, answer: Callable[[Message], Values], longest: float = 3600.0) -> int:
    """Answer the requests of talus-couple until STOP or ABORT; return the exit code.

    `spec` is that of --port=SPEC (`port_of`) or the stem of files. `answer` receives a request and
    returns the fields of its reply; a FaultError that it raises is the reply. Meanwhile the
    heartbeat goes on, for `longest` s of a request at most.
    """
    end = open_end(spec)
    heart = Heart(end, longest)
    try:
        return serve_end(end, answer, heart)
    finally:
        heart.stop()
        end.close()


def serve_end(end: FileEnd | MemoryEnd, answer: Callable[[Message], Values], heart: Heart) -> int:
    """Answer what arrives at an end; a message that cannot be read ends the service (code 4)."""
    code = STATUS["system"]
    while (request := next_request(end)) is not None:
        reply = Message(request.verb, request.sequence, request.step, request.t0, request.t1)
        try:
            with heart:
                reply.put(answer(request))
        except FaultError as fault:
            put_fault(reply, fault)
        end.send(reply)
        if request.name == "STOP":
            code = STATUS["stopped"] if request.flag(Field.EARLY) else STATUS["good"]
        if request.name in ("STOP", "ABORT"):
            break
    return code


def next_request(end: FileEnd | MemoryEnd) -> Message | None:
    """Return the next request; None, with the reason printed, where there is none."""
    try:
        return end.receive()
    except FaultError as fault:
        print(fault, file=sys.stderr)
        return None
