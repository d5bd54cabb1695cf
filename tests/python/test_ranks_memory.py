"""What --check on ranks tells of memory, against what a run takes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from talus.programs import find_program
from talus.verification import launcher, write_packing

DECK = """&run       title = 'Near-spheres on a lattice', t_end = 1.2e-4 /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = 0.1 /
&particles file = 'pack.h5', material = 'quartz' /
&dynamics  dt = 1.0e-6 /
&output    every_time = 4.0e-5, fields = 'contacts' /
&checkpoint every_time = 4.0e-5 /
"""
# ru_maxrss of the program that a rank starts
WATCH = """import os, resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print("rank", os.environ["OMPI_COMM_WORLD_RANK"], most, flush=True)
sys.exit(code)
"""
OFF = 0.15  # foretold over measured: lists are made anew at other times
SIDE = 32
# freed arrays go back to the system at once; else what stays in pieces scatters by a sixth and more
RETURNED = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}


def test_check_foretells_the_memory_of_ranks(tmp_path: Path) -> None:
    """First rank and the others, 32 768 grains, two of which reach over the border in each row."""
    rng = np.random.default_rng(1)
    axes = np.meshgrid(*3 * [np.arange(SIDE)])
    x = 1.995e-3 * np.column_stack([a.ravel() for a in axes]) + rng.uniform(
        -5e-6, 5e-6, (SIDE**3, 3)
    )
    write_packing(
        tmp_path / "pack.h5", x, np.tile([1.01e-3, 1.0e-3, 0.99e-3], (len(x), 1)),
        v=rng.normal(scale=0.05, size=x.shape),
    )  # fmt: skip
    (tmp_path / "deck.nml").write_text(DECK)
    (tmp_path / "watch.py").write_text(WATCH)
    program = str(find_program("talus-dem"))
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "check": True,
               "env": dict(os.environ, OMP_NUM_THREADS="1", **RETURNED)}  # fmt: skip
    told = subprocess.run([*launcher(2), program, "--check", "deck.nml"], **options).stdout
    first, other = (
        float(v) for v in re.search(r"the first (\S+) MiB, the others (\S+) MiB", told).groups()
    )
    least, _, most = re.search(r"holds (\d+)( to )?(\d*) free", told).groups()
    assert int(least) + int(most or least) == SIDE**3
    assert SIDE**2 <= float(re.search(r"grains, (\d+)", told)[1]) <= 3 * SIDE**2
    watched = [*launcher(2), sys.executable, "watch.py", program, "deck.nml"]
    found = re.findall(r"^rank (\d) (\d+)$", subprocess.run(watched, **options).stdout, re.M)
    used = {rank: int(kib) / 1024 for rank, kib in found}
    rebuilds = re.search(r"(\d+) list rebuilds", (tmp_path / "deck.log").read_text())
    assert int(rebuilds[1]) > 0
    assert abs(first / used["0"] - 1) < OFF
    assert abs(other / used["1"] - 1) < OFF
