"""Show the log of the grains once they have ended: their warnings are there."""

import time
from pathlib import Path

log = Path("grains.log")
until = time.monotonic() + 120.0
while time.monotonic() < until:
    if log.exists() and "talus-dem: finished" in log.read_text():
        break
    time.sleep(0.1)
print(log.read_text())
