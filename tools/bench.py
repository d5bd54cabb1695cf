"""Measure speed, beside other codes that apt offers: grains, solids, the port.

Usage: bench.py [--bin build/bin] [--out build/bench] [--cases NAME ...] [--cores 1 2]
                [--repeats 3] [--quick] [--accept]
       (make bench CASES='spheres_10000 ellipsoids_2760' QUICK=1 ACCEPT=1)

Cases are the beds of bench_beds.py, settled once, those with a liquid (bench_liquid.py) and those
of bench_solid.py; `solid` means all of these but solid_million, which needs some minutes. Writes
OUT/bench.csv, bench.png and
bench.json; --accept also writes manual/speed.csv, which the manual shows. Figures are medians.
Machines are shared and noisy: compare figures of one run only; the rate by CPU time is safer
where others load the machine.

One bed alone, talus-dem only (beds: build/bench/beds/NAME.{h5,nml}, made by bench_beds.py):
    cd build/bench/beds && taskset -c 0 talus-dem spheres_10000.nml --threads=1 --output=/tmp
runs 1000 steps without output (t_end in the deck decides); the rate is grain_steps_per_s of the
summary, wall time of the steps alone. NAME: spheres_10000, spheres_50000, ellipsoids_2760,
ellipsoids_20000, poly_ellipsoids_2760, superquadrics_2760, ... `perf stat -e task-clock` gives CPU
time where the machine is shared.
"""

import argparse
import datetime
import json
import os
import platform
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))
sys.path.insert(0, str(ROOT / "tools"))

import bench_beds  # noqa: E402
import bench_grains  # noqa: E402
import bench_liquid  # noqa: E402
import bench_solid  # noqa: E402
import bench_table  # noqa: E402

DEFAULT = [name for name in bench_beds.BEDS if name != "spheres_2000"]
DEFAULT += bench_liquid.DEFAULT
CHOICES = [*bench_beds.BEDS, *bench_liquid.CASES, "solid", *bench_solid.CASES]


def machine() -> str:
    """Return processor, cores and system in one line."""
    cpu = platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = names[0].split(":", 1)[1].strip() if names else cpu
    return f"{cpu}, {os.cpu_count()} cores, {platform.system()} {platform.release().split('-')[0]}"


def arguments() -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--out", type=Path, default=ROOT / "build/bench")
    parser.add_argument("--cases", nargs="+", choices=CHOICES)
    parser.add_argument("--cores", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="small beds, one repeat")
    parser.add_argument("--accept", action="store_true", help="show this run in the manual")
    return parser.parse_args()


def solid_cases(cases: list[str], quick: bool) -> list[str]:
    """Return the cases of solids, `solid` written out."""
    whole = bench_solid.QUICK if quick else bench_solid.DEFAULT
    named = [name for case in cases for name in (whole if case == "solid" else [case])]
    return [name for name in dict.fromkeys(named) if name in bench_solid.CASES]


def main() -> int:
    """Run what was requested and write table, figure and record."""
    options = arguments()
    binaries, out = options.bin.resolve(), options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    repeats = 1 if options.quick else options.repeats
    cases = options.cases or [*(bench_grains.QUICK if options.quick else DEFAULT), "solid"]
    cores = [n for n in options.cores if n <= (os.cpu_count() or 1)]
    load = os.getloadavg()[0]
    if load > 0.5:
        print(f"bench: the machine is not quiet (load {load:.1f}): wall times will be off")
    head = {
        "machine": machine(),
        "date": datetime.date.today().isoformat(),
        "version": (ROOT / "VERSION").read_text().strip(),
        "load": round(load, 2),
        "repeats": repeats,
    }
    result: dict[str, object] = dict(head)
    grains = [name for name in cases if name in bench_beds.BEDS]
    rows: list[dict] = []
    if grains:
        binary = binaries / "talus-dem"
        timings, checks = bench_grains.run(binary, out, grains, cores, repeats, max(cores))
        rows = bench_table.table(timings)
        result |= {"grains": list(rows), "same_work": checks}
    wet = [name for name in cases if name in bench_liquid.CASES]
    if wet:
        found = bench_liquid.run(binaries / "talus-dem", out, wet, repeats, max(cores))
        result |= {"liquid": found}
        rows += found
    solids = solid_cases(cases, options.quick)
    if solids:
        found = bench_solid.bench_solid(binaries, out, solids, cores, repeats, options.quick)
        result |= {"solids": found, "port": bench_solid.bench_port(binaries.parent / "unit")}
        rows += found
    bench_table.write(out / "bench.csv", rows, head)
    bench_table.figure(out / "bench.png", rows, head)
    if options.accept:
        shutil.copyfile(out / "bench.csv", ROOT / "manual/speed.csv")
    (out / "bench.json").write_text(json.dumps(result, indent=2) + "\n")
    print(f"bench: bench.csv, bench.png, bench.json in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
