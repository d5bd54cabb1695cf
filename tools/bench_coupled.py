"""Many grains inside a solid: decks, a coupled run and what its coupling takes.

A block of hexahedra has a pit, open above. Spheres fill it on a lattice; those on its four walls
and its floor are ghosts on its facets, the others fall and press upon them. All bodies have the
constants of bench_beds.py. Written are pit.h5, mesh.h5, grains.nml, solid.nml and coupled.nml.

Printed are the timers of the three programs, how long the grains waited for the coupling (of the
time of the exchanges), the most memory of each program and the processor time of all. What of that
the coupling takes in talus-dem, in its ledger and in exact sums, a profile tells (manual, Ranks).

Usage: bench_coupled.py --out FOLDER [--wide 111] [--deep 79] [--exchanges 100] [--steps 10]
       [--bin build/bin] [--check | --run]
"""

import argparse
import json
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))
sys.path.insert(0, str(ROOT / "tools"))

from bench_beds import DAMPING_RATIO, DENSITY, DT, FRICTION, GRAVITY, POISSON, YOUNG  # noqa: E402

from talus.mesh import Mesh, boundary_faces, structured, write_mesh  # noqa: E402
from talus.verification import write_packing  # noqa: E402

RADIUS = 1.0e-3  # m
POLL = 0.05  # s between two looks at the memory
PRESSED = 1.0e-3  # overlap of neighbours on the lattice over their diameter
BLOCK = (52, 52, 45)  # elements of the block
PIT = (30, 30, 24)  # of them taken out from the middle of its top
GRAINS = f"""&run title = 'Grains in a pit', gravity = 0.0, 0.0, -{GRAVITY} /
&material id = 'grain', density = {DENSITY}, young = {YOUNG}, poisson = {POISSON} /
&contact between = 'grain', 'grain', law = 'hertz_mindlin', friction = {FRICTION},
         damping_ratio = {DAMPING_RATIO} /
&particles file = 'pit.h5', material = 'grain' /
&dynamics dt = {DT} /
"""
SOLID = f"""&run title = 'Block with a pit', gravity = 0.0, 0.0, -{GRAVITY} /
&mesh file = 'mesh.h5' /
&material id = 'm', density = 1800.0, young = 1.0e8, poisson = 0.3 /
&section group = 'all', material = 'm', element = 'hex8_bbar' /
&support group = 'outside', fix = 'x', 'y', 'z' /
&analysis kind = 'static', solver = 'multigrid' /
"""
COUPLED = """&run title = 'Grains in a pit', t_end = {end:.9g} /
&program side = 'grains', deck = 'grains.nml', threads = 1 /
&program side = 'solid', deck = 'solid.nml', threads = 1 /
&clock exchange = {exchange:.9g} /
&facets ghosts = 'ghosts', facets = 'pit' /
"""


def lattice(folder: Path, wide: int, deep: int) -> tuple[float, float]:
    """Write the packing of `wide` intervals aside and `deep` downwards; return both lengths [m]."""
    pitch = 2.0 * RADIUS * (1.0 - PRESSED)
    i = np.indices((deep + 1, wide + 1, wide + 1)).reshape(3, -1).T[:, ::-1]
    on_wall = ((i[:, :2] == 0) | (i[:, :2] == wide)).any(1) | (i[:, 2] == 0)
    x = i * pitch - pitch * np.array([wide, wide, deep]) / [2.0, 2.0, 1.0]
    ids = np.arange(1, len(i) + 1)
    write_packing(
        folder / "pit.h5", x, np.full(x.shape, RADIUS), kind=on_wall.astype(int), ids=ids,
        groups={"ghosts": ids[on_wall]},
    )  # fmt: skip
    print(f"{len(i)} grains, {on_wall.sum()} of them ghosts")
    return wide * pitch, deep * pitch


def block(folder: Path, wide: float, deep: float) -> None:
    """Write the mesh around a pit of that width and depth [m], whose rim lies at z = 0."""
    lines, sides = [], np.array([wide, wide, deep])
    for d, (cells, hole) in enumerate(zip(BLOCK, PIT, strict=True)):
        first = -(cells - hole) // 2 if d < 2 else hole - cells
        lines.append((first + np.arange(cells + 1)) * sides[d] / hole)
        lines[d] -= sides[d] / [2.0, 2.0, 1.0][d]
    keep = np.ones(BLOCK, bool)
    low = [(a - b) // 2 for a, b in zip(BLOCK, PIT, strict=True)]
    keep[low[0] : low[0] + PIT[0], low[1] : low[1] + PIT[1], BLOCK[2] - PIT[2] :] = False
    x, hex8 = structured(tuple(lines), keep)
    faces = np.array([nodes for _, nodes in boundary_faces(hex8).values()])
    near = 1.0e-9 * wide
    inside = (np.abs(x[:, :2]) <= 0.5 * wide + near).all(1) & (x[:, 2] >= -deep - near)
    outer = (np.abs(x[:, :2]) > x[:, :2].max(0) - near).any(1) | (x[:, 2] < x[:, 2].min() + near)
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    mesh.facets["pit"] = faces[inside[faces].all(1)]
    mesh.nodes["outside"] = np.flatnonzero(outer)
    write_mesh(folder / "mesh.h5", mesh)
    print(f"{len(hex8)} elements, {len(x)} nodes, {len(mesh.facets['pit'])} facets of the pit")


def write(options: argparse.Namespace) -> None:
    """Write packing, mesh and decks."""
    options.out.mkdir(parents=True, exist_ok=True)
    block(options.out, *lattice(options.out, options.wide, options.deep))
    exchange = options.steps * DT
    (options.out / "grains.nml").write_text(GRAINS)
    (options.out / "solid.nml").write_text(SOLID)
    coupled = COUPLED.format(end=options.exchanges * exchange, exchange=exchange)
    (options.out / "coupled.nml").write_text(coupled)


def report(folder: Path) -> None:
    """Print what the run took, from the summaries of the three programs."""
    parts = {n: json.loads((folder / f"{n}_summary.json").read_text())
             for n in ("coupled", "grains", "solid")}  # fmt: skip
    for name, page in parts.items():
        print(name, {key: round(value, 2) for key, value in page["timers"].items()})
    print(f"grains waited {100.0 * parts['coupled']['coupling_overhead']:.2f} % of the exchanges")


def peaks(process: subprocess.Popen) -> dict[str, float]:
    """Return the most memory of a process and of its children [MiB], looked at until it ends."""
    most: dict[str, float] = {}
    while process.poll() is None:
        time.sleep(POLL)
        try:
            below = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            for pid in (str(process.pid), *below):
                page = Path(f"/proc/{pid}/status").read_text()
                name, peak = (re.search(rf"{key}:\s+(\S+)", page) for key in ("Name", "VmHWM"))
                own = "talus-couple" if pid == str(process.pid) else name[1]  # it starts anew
                if peak and own != "exe":  # not yet the program that it becomes
                    most[own] = int(peak[1]) / 1024.0
        except FileNotFoundError:
            continue
    return most


def main() -> int:
    """Write the decks, and run or check them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--wide", type=int, default=111, help="intervals of grains aside")
    parser.add_argument("--deep", type=int, default=79, help="intervals of grains downwards")
    parser.add_argument("--exchanges", type=int, default=100)
    parser.add_argument("--steps", type=int, default=10, help="of the grains, an exchange")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="tell the memory")
    what.add_argument("--run", action="store_true")
    options = parser.parse_args()
    write(options)
    if not (options.check or options.run):
        return 0
    words = [str((options.bin / "talus-couple").resolve()), "coupled.nml"]
    run = subprocess.Popen(words + ["--check"] * options.check, cwd=options.out)
    most = peaks(run)
    if options.run and run.returncode == 0:
        report(options.out)
        print({name: round(value) for name, value in most.items()},
              f"{sum(most.values()):.0f} MiB at most")  # fmt: skip
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"{used.ru_utime + used.ru_stime:.0f} s of processor time in all")
    return run.returncode


if __name__ == "__main__":
    sys.exit(main())
