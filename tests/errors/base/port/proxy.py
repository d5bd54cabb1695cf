"""A solver's stand-in: hands every request on to the true solver, and spoils one reply.

Usage: proxy.py PROGRAM VERB DEED FIELD DECK OPTIONS (the last two come from talus-couple)
VERB may be DESCRIBE/WHAT.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import port


def spoil(reply: port.Message, deed: str, name: str) -> dict[str, int]:
    """Change a reply; return header words that are to be wrong."""
    value = reply.fields.get(name)
    if deed == "drop":
        del reply.fields[name]
    elif deed == "shorten":
        reply.fields[name] = value[:-1]
    elif deed == "kind":
        reply.fields[name] = np.zeros(value.shape, dtype=np.int64)
    elif deed == "text":
        reply.fields[name] = b"0.0.1"
    elif deed == "large":
        reply.fields[name] = np.full(value.shape, 2**40)
    elif deed == "nan":
        reply.fields[name] = np.full(value.shape, np.nan)
    elif deed == "other":
        reply.fields[name] = np.full_like(value, 99)
    elif deed == "add":
        reply.fields[name] = np.zeros(1)
    elif deed == "fault":
        reply.status = 4
        reply.fields = {f"error.{k}": b"x" for k in ("code", "message", "place", "hint")}
    elif deed == "sequence":
        reply.sequence += 1
    elif deed == "verb":
        reply.verb = 3
    elif deed in ("checksum", "magic", "words"):
        return {deed: 1}
    elif deed == "protocol":
        reply.protocol = 99
    return {}


def wait_in_vain(stem: str, state: str) -> int:
    """Say that we wait, or work, until talus-couple has gone."""
    for beat in range(1000, 4000):
        if not Path(stem).parent.exists():
            break
        port.write_lines(Path(f"{stem}.beat"), str(beat), state)
        time.sleep(0.1)
    return 4


def main() -> int:
    """Serve until STOP or ABORT, or until the deed ends it."""
    program, verb, deed, name = sys.argv[1:5]
    deck, *options = sys.argv[5:]
    outer = port.spec_of(options)
    if verb == "START":
        if deed == "exit":
            print("what the stand-in says", flush=True)
            return int(name)
        if deed == "stray":
            port.write_lines(Path(f"{outer}.joined"), port.place(), str(os.getpid()), name)
        time.sleep(600.0)
    inner = outer + "-inner/side"
    port.join(outer)
    port.offer(inner)
    options = [o for o in options if not o.startswith("--port=")] + [f"--port=hdf5:{inner}"]
    solver = subprocess.Popen([f"{os.environ['TALUS_BIN']}/{program}", deck, *options])
    sequence = 0
    while True:
        sequence += 1
        request = port.read(outer, sequence, "request")
        if request is None:
            solver.kill()
            return 4
        port.write(inner, request, "request")
        reply = port.read(inner, sequence, "reply")
        asked = request.name
        if "/" in verb and "what" in request.fields:
            asked += "/" + request.fields["what"].decode()
        wrong: dict[str, int] = {}
        if asked == verb and deed == "hang":
            time.sleep(600.0)
        if asked == verb and deed == "lose":
            return wait_in_vain(outer, "waits")
        if asked == verb and deed == "work":
            return wait_in_vain(outer, "works")
        if asked == verb and deed == "unfold":
            shutil.rmtree(Path(outer).parent)
            time.sleep(600.0)
        if asked == verb and deed == "garbage":
            Path(f"{outer}.{sequence:08d}.reply.h5").write_text("no HDF5 at all")
            continue
        if asked == verb:
            wrong = spoil(reply, deed, name)
        port.write(outer, reply, "reply", sequence, **wrong)
        if asked == verb and deed == "twice":
            port.write(outer, reply, "reply", sequence + 1)
        if asked in ("STOP", "ABORT"):
            solver.wait(20.0)
            if asked == verb and deed == "stay":
                time.sleep(600.0)
            return int(name) if asked == verb and deed == "exit" else solver.returncode


if __name__ == "__main__":
    sys.exit(main())
