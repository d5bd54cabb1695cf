"""Run a command and note its wall time and the seconds of processors that it and its children took.

Usage: cost.py NAME COMMAND ...; a row of cost.csv: name, wall [s], processors [s].
"""

import csv
import resource
import subprocess
import sys
import time
from pathlib import Path

begun = time.monotonic()
code = subprocess.run(sys.argv[2:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with Path("cost.csv").open("a", newline="") as file:
    row = [sys.argv[1], time.monotonic() - begun, used.ru_utime + used.ru_stime]
    csv.writer(file).writerow(row)
sys.exit(code)
