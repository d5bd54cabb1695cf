"""A partner of a solver on ranks: it asks, and keeps what comes back for a comparison."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from talus.compare import difference
from talus.programs import find_program
from talus.verification import launcher

sys.path.insert(0, str(Path(__file__).parents[1] / "errors/base/port"))
from port import Asker, Message  # noqa: E402

SAME = 1.0e-11  # sums of the ranks' parts, in another order
LONG = 60.0  # for a solver to end [s]
Script = list[dict[str, np.ndarray]]


class Partner(Asker):
    """Asks, and takes no fault for an answer."""

    def ask(self, verb: str, t0: float = 0.0, t1: float = 0.0, **fields: object) -> Message:
        """Send a request and return the reply."""
        reply = super().ask(verb, t0, t1, **fields)
        assert reply.status == 0, reply.fields
        return reply

    def numbers(self, *words: object, **fields: object) -> dict[str, np.ndarray]:
        """Send a request and return the arrays of numbers of the reply."""
        found = self.ask(*words, **fields).fields.items()
        return {k: v for k, v in found if not isinstance(v, bytes)}

    def fault(self, verb: str, **fields: object) -> dict[str, bytes]:
        """Send a request that is refused; return the fields of the fault."""
        reply = super().ask(verb, **fields)
        assert reply.status != 0
        return reply.fields


def talk(
    program: str, folder: Path, ranks: int, script: Callable[[Partner], object], code: int = 0
) -> object:
    """Start a program on deck.nml in a folder and let the script ask; return what it returns.

    The program is to end with the exit code.
    """
    here = Path.cwd()
    os.chdir(folder)
    try:
        asker = Partner("meeting/side")
        command = [*launcher(ranks), str(find_program(program)), "deck.nml", "--threads=1",
                   "--port=hdf5:meeting/side"]  # fmt: skip
        with (folder / "out.txt").open("w") as out:
            process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)
        try:
            asker.hello()
            replies = script(asker)
            Asker.ask(asker, "STOP")
            assert process.wait(LONG) == code, (folder / "out.txt").read_text()
        finally:
            process.kill()
            process.wait()
    finally:
        os.chdir(here)
    return replies


def compare(one: Script, several: Script) -> None:
    """Every number of every reply, over the largest of its name; whole numbers are equal."""
    assert [list(a) for a in one] == [list(a) for a in several]
    for k, (a, b) in enumerate(zip(one, several, strict=True)):
        for name, value in a.items():
            if value.dtype.kind == "i":
                assert np.array_equal(value, b[name]), (k, name)
                continue
            part = slice(9) if name == "scalars" else slice(None)
            scale = max(np.abs(value[part]).max(initial=0.0), 1e-300)
            assert difference(value[part], b[name][part]) <= SAME * scale, (k, name)
