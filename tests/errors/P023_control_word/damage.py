"""Start a solver, and put zeros where it counts its replies in the shared memory."""

import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

WRITTEN = {"requests": 960, "replies": 1152}  # offsets in the segment (manual/port.md)
MANY = 12  # replies that are left alone

program, *arguments = sys.argv[1:]
name = next(a for a in arguments if a.startswith("--port=shm:"))[len("--port=shm:") :]
with Path(f"/dev/shm{name}").open("r+b") as file:
    memory = mmap.mmap(file.fileno(), 0)
solver = subprocess.Popen([f"{os.environ['TALUS_BIN']}/{program}", *arguments])
at = WRITTEN["replies"]
while solver.poll() is None:
    if int.from_bytes(memory[at : at + 4], "little") >= MANY:
        for _ in range(100):
            memory[at : at + 8] = bytes(8)
            time.sleep(0.001)
        break
    time.sleep(0.001)
sys.exit(solver.wait())
