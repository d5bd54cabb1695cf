"""Solids of `make bench`: a clamped cube under gravity, static and explicit, beside CalculiX.

Cases: static_KIND_N (whole runs: direct, iterative, multigrid), assembly and explicit rows over the
number of elements, states and tangents of micromorphic points, and a million elements by
iterations. Displacements are compared with those that CalculiX and FEniCSx print for the same mesh,
so that the same problem is timed.
"""

import json
import math
import os
import re
import statistics
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import bench_calculix as calculix

from talus.compare import difference as apart
from talus.compare import extent
from talus.verification import launcher

CONSTANTS = (210.0e9, 0.3, 7800.0)  # E [Pa], nu, density [kg/m3]
GRAVITY = (3.0, 0.0, -9.81)  # m/s2
LONG = 60.0  # s; what is slower is run once
POLL = 0.005  # s between two samples of the memory of a process

# displacement of the corner (1, 1, 1) [m], as CalculiX and FEniCSx print it
CORNER = {
    ("hex8", 10): (3.232744e-7, 2.153866e-9, -2.646318e-7),
    ("hex8", 30): (3.269809e-7, 1.457892e-9, -2.656953e-7),
    ("hex8", 40): (3.272992e-7, 1.414591e-9, -2.658192e-7),
    ("hex20", 20): (3.273882e-7, 1.352583e-9, -2.657668e-7),
}
STATIC = {
    "static_hex8_10": ("hex8", 10),
    "static_hex8_30": ("hex8", 30),
    "static_hex8_40": ("hex8", 40),
    "static_hex20_20": ("hex20", 20),
}
LARGE = "static_hex8_60"  # without factors, which would take 14 GB
SOLVERS = ("direct", "iterative", "multigrid")
SIZES = (22, 46, 100)  # elements along an edge: 1e4, 1e5 and 1e6
POLAR_SIZES = (8, 22)
QUICK_SIZES = (10,)
EXPLICIT = {
    "explicit_hex8_full": ("hex8", "hex8_full", 1.2e7, 0.5),
    "explicit_hex8_one_point": ("hex8", "hex8_one_point", 1.2e7, 0.5),
    "explicit_hex20_hex8": ("hex20", "hex20/hex8", 1.2e6, 0.1),
}  # kind, formulation, element-steps of a run, step over (edge / wave speed)
WAVE = 6020.0  # m/s, of compression
CCX_STEPS = (20, 140)  # of the two runs whose difference is CalculiX's rate
POINTS = "micromorphic_points"
CASES = (*STATIC, LARGE, "assembly", *EXPLICIT, POINTS, "solid_million")
ASKED_FOR = ("static_hex8_10", LARGE, "solid_million")
DEFAULT = tuple(case for case in CASES if case not in ASKED_FOR)
QUICK = ("static_hex8_10", "assembly", *EXPLICIT, POINTS)

MATERIALS = {
    False: "law = 'linear_elastic', young = 210.0e9, poisson = 0.3",
    True: "law = 'micropolar', young = 210.0e9, poisson = 0.3, l_t = 0.02, l_b = 0.02, "
    "coupling = 0.5, polar_ratio = 1.0, micro_inertia = 1.0e-3",
}
DECK = """&run title = 'Bench: cube', gravity = 3.0, 0.0, -9.81{t_end} /
&mesh file = '{mesh}' /
&material id = 'steel', {material}, density = 7800.0 /
&section group = 'all', material = 'steel', element = '{element}' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&analysis {analysis} /
"""


@dataclass
class Row:
    """Repeats of one code on one case."""

    code: str
    case: str
    elements: int
    cores: int
    work: float  # elements, times steps
    wall: list[float] = field(default_factory=list)  # s
    cpu: list[float] = field(default_factory=list)  # s
    memory: float = 0.0  # MB
    difference: float | None = None  # of the corner's displacement, relative, worst component
    residual: float | None = None

    def as_dict(self, ratio: float | None) -> dict:
        """Return the row of bench.csv; `ratio` is the speed over that of CalculiX."""
        wall, cpu = statistics.median(self.wall), statistics.median(self.cpu)
        return {
            "code": self.code, "case": self.case, "grains": self.elements, "cores": self.cores,
            "grain_steps_per_s": round(self.work / max(wall, 1.0e-9)), "contacts_per_s": "",
            "max_rss_mb": round(self.memory, 1), "ratio_to_lammps": "",
            "grain_steps_per_cpu_s": round(self.work / max(cpu, 1.0e-9)),
            "seconds": round(wall, 3), "ratio_to_calculix": round(ratio, 3) if ratio else "",
            "difference": "" if self.difference is None else f"{self.difference:.1e}",
            "residual": "" if self.residual is None else f"{self.residual:.1e}",
        }  # fmt: skip


@dataclass
class Run:
    """What one run took and said."""

    wall: float  # s
    cpu: float  # s
    memory: float  # MB
    said: str


def run(command: list[str], folder: Path, cores: int = 1, threads: int = 0) -> Run:
    """Run a command in a folder, pinned to the first cores; follow its largest resident size.

    As many threads as cores, unless ranks have some each.
    """
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER",
             "CCX_NPROC_STIFFNESS")  # fmt: skip
    environment = dict(os.environ, **dict.fromkeys(names, str(threads or cores)))
    pinned = ["taskset", "-c", ",".join(map(str, range(cores))), *command]
    said, peak = folder / "bench.out", 0.0
    start = time.monotonic()
    with said.open("w") as out:
        child = subprocess.Popen(pinned, cwd=folder, env=environment, stdout=out, stderr=out)
        status = Path(f"/proc/{child.pid}/status")
        while True:
            ended, code, usage = os.wait4(child.pid, os.WNOHANG)
            if ended:
                break
            found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
            peak = max(peak, float(found[1]) / 1024.0 if found else 0.0)
            time.sleep(POLL)
    wall = time.monotonic() - start
    child.returncode = os.waitstatus_to_exitcode(code)
    if child.returncode:
        tail = said.read_text()[-2000:]
        raise SystemExit(f"bench: {' '.join(command)} ended with {child.returncode}\n{tail}")
    return Run(wall, usage.ru_utime + usage.ru_stime, peak, said.read_text())


def write_cube(folder: Path, kind: str, n: int) -> str:
    """Write a unit cube of n^3 elements with the group z0, unless it is there; return its name."""
    import numpy as np

    from talus.mesh import Mesh, structured, write_mesh
    from talus.orders import converted

    path = folder / f"{kind}_{n}.h5"
    if not path.exists():
        line = np.linspace(0.0, 1.0, n + 1)
        x, hex8 = structured((line, line, line))
        mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), kind)
        mesh.nodes["z0"] = np.flatnonzero(mesh.x[:, 2] < 1.0e-9)
        write_mesh(path, mesh)
    return path.name


def talus_corner(path: Path) -> list[float]:
    """Read the displacement of the corner [m] from the last step of a run."""
    import h5py
    import numpy as np

    with h5py.File(path) as file:
        x = file["mesh/x"][:]
        last = file["steps"][sorted(file["steps"])[-1]]
        return [float(value) for value in last["u"][int(np.argmax(x.sum(axis=1)))]]


def difference(found: list[float], wanted: tuple[float, ...] | None) -> float | None:
    """Return the largest difference, relative to the largest component."""
    if wanted is None:
        return None
    return apart(found, wanted) / extent(wanted)


class Bench:
    """The programs, their folder, and how often they are run."""

    def __init__(self, binaries: Path, out: Path, repeats: int, cores: list[int], quick: bool):
        """Make the folder."""
        self.fem, self.folder = str(binaries / "talus-fem"), out / "solid"
        self.units = binaries.parent / "unit"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.repeats, self.cores, self.quick = repeats, cores, quick
        self.peer = calculix.installed()

    def deck(self, name: str, mesh: str, element: str, analysis: str, t_end: float = 0.0,
             output: bool = False) -> None:  # fmt: skip
        """Write a deck of talus-fem."""
        text = DECK.format(
            mesh=mesh, material=MATERIALS["/" in element], element=element, analysis=analysis,
            t_end=f", t_end = {t_end!r}" if t_end > 0.0 else "",
        )  # fmt: skip
        text += "&output every_time = 1.0 /\n" if output else ""
        (self.folder / f"{name}.nml").write_text(text)

    def talus(self, name: str, cores: int, ranks: bool = False) -> tuple[Run, dict]:
        """Run talus-fem with threads or ranks; return what it took (of ranks no memory)."""
        command = [self.fem, f"{name}.nml", f"--threads={1 if ranks else cores}"]
        if ranks:
            done = run([*launcher(cores), *command], self.folder, cores, threads=1)
            done.memory = 0.0
        else:
            done = run(command, self.folder, cores)
        return done, json.loads((self.folder / f"{name}_summary.json").read_text())

    def model(self, mesh: str) -> str:
        """Write the model for CalculiX; return its name."""
        name = mesh.replace(".h5", ".model")
        calculix.write_model(self.folder / name, self.folder / mesh, CONSTANTS)
        return name

    def static(self, case: str, solvers: tuple[str, ...] = SOLVERS) -> list[Row]:
        """Whole static runs of both codes, by factors and by iterations, in turns.

        CalculiX has no multigrid: its iterative solver stands beside ours.
        """
        kind, n = STATIC.get(case, ("hex8", 60 if case == LARGE else SIZES[-1]))
        element = {"hex8": "hex8_full"}.get(kind, kind)
        mesh = write_cube(self.folder, kind, n)
        peers = calculix.SOLVERS if self.peer and case != "solid_million" else {}
        for solver in solvers:
            name = f"{case}_{solver}"
            self.deck(name, mesh, element, f"kind = 'static', solver = '{solver}'", output=True)
            if solver in peers:
                text = calculix.static(self.model(mesh), GRAVITY, solver)
                (self.folder / f"{name}_ccx.inp").write_text(text)
        rows = [
            Row(code, f"{case}_{solver}", n**3, cores, float(n**3))
            for cores in self.cores
            for solver in solvers
            for code in ("talus", "talus_ranks", "calculix")
            if (code != "talus_ranks" or cores > 1) and (code != "calculix" or solver in peers)
        ]
        for _ in range(self.repeats):
            for row in rows:
                if not row.wall or max(row.wall) < LONG:
                    self.static_once(row, CORNER.get((kind, n)))
        return rows

    def static_once(self, row: Row, wanted: tuple[float, ...] | None) -> None:
        """Add one static run to a row."""
        if row.code != "calculix":
            done, summary = self.talus(row.case, row.cores, row.code == "talus_ranks")
            row.residual = summary["health"].get("residual")
            corner = talus_corner(self.folder / f"{row.case}.h5")
        else:
            done = run([self.peer or "", f"{row.case}_ccx"], self.folder, row.cores)
            corner = calculix.corner(self.folder / f"{row.case}_ccx.dat")
        row.difference = difference(corner, wanted)
        row.wall.append(done.wall)
        row.cpu.append(done.cpu)
        row.memory = max(row.memory, done.memory)

    def assembly(self) -> list[Row]:
        """Pattern, stiffness, mass and weight; nothing is solved (rest satisfies the tolerance)."""
        rows = []
        for n in QUICK_SIZES if self.quick else SIZES:
            name, mesh = f"assembly_hex8_{n}", write_cube(self.folder, "hex8", n)
            self.deck(name, mesh, "hex8_full", "kind = 'relaxation', tolerance = 1.0")
            for cores in self.cores:
                row = Row("talus", name, n**3, cores, float(n**3))
                for _ in range(self.repeats):
                    done, summary = self.talus(name, cores)
                    row.wall.append(summary["timers"]["assembly"])
                    row.memory = max(row.memory, done.memory)
                row.cpu = row.wall
                rows.append(row)
        return rows

    def points(self) -> list[Row]:
        """States and tangents of micromorphic points, as the test of their speed prints them."""
        rows: dict[str, Row] = {}
        test = self.units / "test_fem_mm_speed"
        if not test.exists():
            print(f"  no {test}: make unit-one T={test.name}", flush=True)
            return []
        for _ in range(self.repeats):
            said = run([str(test)], self.folder).said
            lines = re.findall(r"^(micromorphic_\w+) (\d+) points +(\S+) s", said, re.M)
            for name, count, seconds in lines:
                row = rows.setdefault(name, Row("talus", name, int(count), 1, float(count)))
                row.wall.append(float(seconds))
                row.cpu.append(float(seconds))
        return list(rows.values())

    def explicit(self, case: str) -> list[Row]:
        """Central differences over the number of elements, with CalculiX on the smallest mesh."""
        kind, element, work, courant = EXPLICIT[case]
        sizes = QUICK_SIZES if self.quick else POLAR_SIZES if "/" in element else SIZES
        rows = []
        for n in sizes:
            name, mesh, dt = f"{case}_{n}", write_cube(self.folder, kind, n), courant / (n * WAVE)
            steps = max(10 if self.quick else 40, round((0.1 if self.quick else 1.0) * work / n**3))
            for stem, end in ((name, steps), (f"{name}_base", 1)):
                self.deck(stem, mesh, element, f"kind = 'explicit', dt = {dt!r}", end * dt)
            peer = self.peer and element == "hex8_full" and n == sizes[0]
            if peer:
                model = self.model(mesh)
                for end in CCX_STEPS:
                    text = calculix.explicit(model, GRAVITY, dt, end / (n * WAVE))
                    (self.folder / f"{name}_{end}.inp").write_text(text)
            own = [
                Row(code, name, n**3, cores, float(n**3 * steps))
                for cores in self.cores
                for code in ("talus", *(["calculix"] if peer else []))
            ]
            for _ in range(self.repeats):
                for row in own:
                    (self.talus_explicit if row.code == "talus" else self.ccx_explicit)(row)
            rows += own
        return rows

    def talus_explicit(self, row: Row) -> None:
        """Add one run: wall time of its steps, CPU time without that of setting up."""
        base = self.talus(f"{row.case}_base", row.cores)[0]
        done, summary = self.talus(row.case, row.cores)
        row.wall.append(summary["timers"]["steps"])
        row.cpu.append(done.cpu - base.cpu)
        row.memory = max(row.memory, done.memory)

    def ccx_explicit(self, row: Row) -> None:
        """Add the difference of a long and a short run of CalculiX."""
        n = round(row.elements ** (1.0 / 3.0))
        done, steps = [], []
        for end in CCX_STEPS:
            done.append(run([self.peer or "", f"{row.case}_{end}"], self.folder, row.cores))
            dt = calculix.explicit_step(done[-1].said)
            steps.append(math.ceil(end / (n * WAVE) / dt))
        row.work = float(row.elements * (steps[1] - steps[0]))
        row.wall.append(done[1].wall - done[0].wall)
        row.cpu.append(done[1].cpu - done[0].cpu)
        row.memory = max(row.memory, done[1].memory)


def rows_of(bench: Bench, case: str) -> list[dict]:
    """Return the rows of bench.csv of one case; ratios are to CalculiX with as many cores."""
    if case in STATIC:
        found = bench.static(case)
    elif case == "assembly":
        found = bench.assembly()
    elif case == POINTS:
        found = bench.points()
    elif case in (LARGE, "solid_million"):
        found = bench.static(case, ("iterative", "multigrid"))
    else:
        found = bench.explicit(case)
    speed = {
        (row.case, row.cores): row.work / statistics.median(row.wall)
        for row in found
        if row.code == "calculix"
    }
    rows = []
    for row in found:
        peer = speed.get((row.case.replace("multigrid", "iterative"), row.cores))
        ratio = row.work / statistics.median(row.wall) / peer if peer else None
        rows.append(row.as_dict(ratio))
        print("  " + say(rows[-1]), flush=True)
    return rows


def say(row: dict) -> str:
    """Return a row in words."""
    text = (
        f"{row['code']}, {row['case']} on {row['cores']}: {row['seconds']} s, "
        f"{row['grain_steps_per_s'] / 1e6:.3g} million element-steps/s, "
        f"{row['grain_steps_per_cpu_s'] / 1e6:.3g} by CPU time, {row['max_rss_mb']:.0f} MB"
    )
    if row["difference"]:
        text += f", corner off by {row['difference']}"
    return text


def bench_solid(
    binaries: Path, out: Path, cases: list[str], cores: list[int], repeats: int, quick: bool
) -> list[dict]:
    """Run cases; return their rows."""
    bench = Bench(binaries, out, repeats, cores, quick)
    rows = []
    for case in cases:
        print(f"{case}:", flush=True)
        rows += rows_of(bench, case)
    return rows


def bench_port(units: Path) -> dict:
    """Return what the port's own test prints about an exchange of 1000 ghosts."""
    test = units / "test_talus_port"
    if not test.exists():
        return {}
    done = subprocess.run([str(test)], capture_output=True, text=True)
    return {"lines": [line for line in done.stdout.splitlines() if " us" in line]}
