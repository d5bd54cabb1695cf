"""The asking end of the port for tests of solvers: starts one, asks, watches its signs of life."""

import os
import secrets
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.port import Message, offer, read_message, write_message
from talus.port_judge import of_verb
from talus.port_names import HEADER, HEADER_WORDS, PROTOCOL
from talus.port_shm import SharedEnd, checksum, is_whole

RUN = "port-test"  # run id
PATIENCE = 5.0  # time limits for a reply of a solver that lives
TICK = 0.25  # s between two looks at the solver


class LostError(Exception):
    """No reply will come; the text says why."""


class SolverAsker:
    """A solver that was started with a port of its own; use it in `with`."""

    def __init__(self, command: list[str], transport: str, time_limit: float) -> None:
        """Make the port and start the command with --port=SPEC behind it."""
        self.command, self.limit, self.sequence = command, time_limit, 0
        self.folder = Path(tempfile.mkdtemp(prefix="talus-port-test-"))
        self.log = self.folder / "output.txt"
        self.end: SharedEnd | None = None
        self.stem = str(self.folder / "port/solver")
        if transport == "shared_memory":
            spec = f"shm:/talus-{os.getpid()}-{secrets.token_hex(8)}-solver"
            self.end = SharedEnd.offer(spec, RUN)
        else:
            spec = f"hdf5:{self.stem}"
            offer(self.stem, RUN)
        try:
            with self.log.open("w") as log:
                self.process = subprocess.Popen([*command, f"--port={spec}"], stdout=log,
                                                stderr=subprocess.STDOUT)  # fmt: skip
        except OSError as fault:
            self.leave()
            raise FaultError("E575", f"cannot start {command[0]}: {fault.strerror}",
                             "the command of the solver stands behind --") from fault  # fmt: skip

    def __enter__(self) -> "SolverAsker":
        """Return itself."""
        return self

    def __exit__(self, *rest: object) -> None:
        """End the solver, remove the port."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.leave()

    def leave(self) -> None:
        """Leave the port, as a talus-couple that has died; what is printed stays for the caller."""
        if self.end:
            self.end.close()
        self.end = None
        shutil.rmtree(self.folder, ignore_errors=True)

    def output(self) -> str:
        """Return the last lines that the solver printed."""
        text = self.log.read_text(errors="replace") if self.log.exists() else ""
        return "\n".join(text.splitlines()[-12:])

    def request(self, verb: str, t0: float, t1: float, fields: dict[str, object]) -> Message:
        """Return the next request."""
        self.sequence += 1
        request = Message(of_verb(verb), self.sequence, 0, t0, t1)
        request.put(fields)
        return request

    def send(self, request: Message, **wrong: int) -> None:
        """Send a request; `wrong` puts other values into words of its header."""
        if self.end is None:
            words = {name: value for name, value in wrong.items() if name != "sequence"}
            request.sequence = wrong.get("sequence", request.sequence)
            write_message(self.stem, request, "request", self.sequence, **words)
            return
        request.sequence = wrong.pop("sequence", request.sequence)
        words = request.words(checksum)
        for name, value in wrong.items():
            words[HEADER[name]] = value
        try:
            self.end.push(words)
        except FaultError as fault:
            raise LostError(self.ended() or fault.message) from fault

    def receive(self) -> Message:
        """Wait for the reply; LostError when none comes."""
        silent, seen = time.monotonic(), None
        end = silent + PATIENCE * self.limit
        while True:
            reply = self.arrived()
            if reply is not None:
                return reply
            signs = self.signs()
            if signs != seen:
                silent, seen = time.monotonic(), signs
            if self.process.poll() is not None:
                raise LostError(self.ended())
            if time.monotonic() > end:
                raise LostError(f"no reply within {PATIENCE * self.limit:g} s, yet it lives")
            if time.monotonic() - silent > self.limit:
                raise LostError(f"no reply and no sign of life for {self.limit:g} s: its heartbeat "
                                "stood still and it used no CPU time")  # fmt: skip

    def arrived(self) -> Message | None:
        """Return the reply when it comes within a moment."""
        try:
            if self.end is None:
                self.look_who_joined()
                return read_message(self.stem, self.sequence, "reply", lambda: False)
            words = self.end.pull(TICK)
        except FaultError as fault:
            if fault.code == "E534":
                raise LostError("the checksum of the reply is not that of its content") from fault
            raise LostError(self.ended() or fault.message) from fault
        if words is None:
            return None
        if len(words) < HEADER_WORDS or not is_whole(words):
            raise LostError("the checksum of the reply is not that of its content")
        try:
            return Message.of_words(words)
        except FaultError as fault:
            raise LostError(fault.message) from fault

    def look_who_joined(self) -> None:
        """Raise LostError where somebody has joined the files without the run id."""
        joined = Path(f"{self.stem}.joined")
        if joined.exists() and joined.read_text(errors="replace").splitlines()[2:] != [RUN]:
            raise LostError("P027: who has joined this port does not know the run id")

    def signs(self) -> tuple[int | str, ...]:
        """Return heartbeat and CPU time of the solver."""
        beat: int | str = 0
        if self.end is not None:
            beat = self.end.partner_beat()
        elif Path(f"{self.stem}.beat").exists():
            beat = Path(f"{self.stem}.beat").read_text(errors="replace")
        try:
            stat = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return (beat,)
        return beat, *stat[11:15]

    def ended(self) -> str:
        """Say how the solver ended; empty while it has not."""
        try:
            code = self.process.wait(2.0)
        except subprocess.TimeoutExpired:
            return ""
        how = f"ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return f"the solver {how} and did not answer"

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0,
            **fields: object) -> tuple[Message, Message]:  # fmt: skip
        """Send a request; return it and the reply. In names of fields `__` stands for a dot."""
        named = {name.replace("__", "."): value for name, value in fields.items()}
        request = self.request(verb, t0, t1, named)
        self.send(request)
        return request, self.receive()

    def hello(self, restart: str = "", protocol: int = PROTOCOL) -> tuple[Message, Message]:
        """Greet."""
        return self.ask("HELLO", run_id=RUN, restart=restart, protocol=protocol)

    def exit_code(self) -> int | None:
        """Wait for the end and return the exit code; None when the solver stays."""
        try:
            return self.process.wait(self.limit)
        except subprocess.TimeoutExpired:
            return None


def rows(reply: Message, name: str) -> np.ndarray:
    """Return a field of a reply as numbers, empty when it is not there."""
    return np.asarray(reply.fields.get(name, np.zeros(0)))
