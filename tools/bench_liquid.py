"""The liquid's share of a step, `make bench`: beds of ellipsoids under water.

Cases: wet_NAME of a bed NAME. The bed fills with water up to two bricks above it, bricks are four
diameters of the largest grain, the top is drained; exchanges of 4 steps and of 1. The share is that
of talus-dem's own timer `liquid`, on one thread, so that other work on the machine takes from both
alike; the rate is that of all of a step.
"""

import json
import os
import statistics
import subprocess
from pathlib import Path

import bench_beds as beds
import numpy as np

from talus.packing import read_packing

NAMES = ("ellipsoids_2760", "ellipsoids_20000")
CASES = tuple(f"wet_{name}" for name in NAMES)
DEFAULT = ("wet_ellipsoids_20000",)
STEPS = {"ellipsoids_2760": 2000, "ellipsoids_20000": 400}
EXCHANGES = (4, 1)  # steps
ALLOWED = {4: 0.10, 1: 0.30}  # share that was asked for
BRICK = 4.0  # over the diameter of a sphere of the volume of the largest grain
LIQUID = """&fluid id = 'water', density = 1000.0, viscosity = 1.0e-3, bulk_modulus = 2.2e9 /
&pore_grid fluid = 'water', lower = 0.0, 0.0, 0.0, upper = {x:.9g}, {y:.9g}, {z:.9g}, size = {size},
           exchange = {exchange} /
&drain side = 'z1', pressure = 0.0 /
"""


def deck(folder: Path, bed: beds.Bed, exchange: int) -> str:
    """Write the deck of a bed with a liquid; return its name."""
    grains = read_packing(folder / f"{bed.name}.h5")
    largest = 2.0 * float(np.cbrt(grains.axes.prod(axis=1).max()))
    top = float((grains.x[:, 2] + grains.axes.max(axis=1)).max()) + 2.0 * BRICK * largest
    text = beds.deck(bed, f"{bed.name}.h5", STEPS[bed.name] * beds.DT)
    text += LIQUID.format(x=bed.box[0], y=bed.box[1], z=top, size=BRICK, exchange=exchange)
    name = f"{bed.name}_wet_{exchange}"
    (folder / f"{name}.nml").write_text(text)
    return name


def timed(binary: Path, folder: Path, name: str) -> tuple[float, float, dict]:
    """Return the liquid's share of the steps, CPU time [s] and the summary of a run."""
    before = os.times()
    done = subprocess.run([str(binary), f"{name}.nml", "--threads=1"], cwd=folder,
                          capture_output=True, text=True)  # fmt: skip
    after = os.times()
    if done.returncode:
        raise SystemExit(f"bench: {folder / name}.nml ended with {done.returncode}\n{done.stderr}")
    summary = json.loads((folder / f"{name}_summary.json").read_text())
    timers = summary["timers"]
    share = timers["liquid"] / (timers["liquid"] + timers["steps"])
    cpu = after.children_user + after.children_system
    return share, cpu - before.children_user - before.children_system, summary


def run(binary: Path, out: Path, cases: list[str], repeats: int, threads: int) -> list[dict]:
    """Return the rows of bench.csv, medians of the repeats."""
    rows = []
    for case in cases:
        bed = beds.BEDS[case.removeprefix("wet_")]
        beds.settle(binary, out / "beds", bed, threads)
        for exchange in EXCHANGES:
            name = deck(out / "beds", bed, exchange)
            found = [timed(binary, out / "beds", name) for _ in range(repeats)]
            share = statistics.median(one[0] for one in found)
            steps = bed.grains * found[0][2]["steps"]
            rate = statistics.median(one[2]["grain_steps_per_s"] for one in found)
            cpu = steps / statistics.median(one[1] for one in found)
            rows.append({"code": f"talus m={exchange}", "case": case, "grains": bed.grains,
                         "cores": 1, "grain_steps_per_s": round(rate),
                         "contacts_per_s": round(rate * found[0][2]["contacts"] / bed.grains),
                         "max_rss_mb": 0.0, "ratio_to_lammps": "",
                         "grain_steps_per_cpu_s": round(cpu),
                         "liquid_share": round(share, 3)})  # fmt: skip
            print(f"bench: {case}, exchange of {exchange}: liquid {100.0 * share:.1f} % of a step "
                  f"(asked {100.0 * ALLOWED[exchange]:.0f} %)", flush=True)  # fmt: skip
    return rows
