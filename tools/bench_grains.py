"""Grains of `make bench`: Talus beside LAMMPS and LIGGGHTS on the same beds.

First every code makes CHECK steps from the same bed: contacts between grains and kinetic energy
must agree, so that the same work is timed. Then the codes take turns, with one and two cores; beds
of other shapes take turns with the bed of ellipsoids that they are put beside, and copies with
their original.
"""

import json
import os
import re
import statistics
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import bench_beds as beds
import bench_peers as peers

CHECK = 50  # steps after which the codes are compared
BASE = 1  # steps of the run whose CPU time is taken off
CONTACTS_AGREE, KINETIC_AGREE = 0.02, 0.2  # relative; LAMMPS damps by another law
WARM = 20  # steps that the peers make before the timed ones
STEPS = {
    "spheres_2000": 2000,
    "spheres_10000": 4000,
    "spheres_20000": 2000,
    "spheres_50000": 1000,
    "spheres_1000000": 100,
    "ellipsoids_2760": 6000,
    "ellipsoids_20000": 1000,
    "ellipsoids_1000000": 100,
    "poly_ellipsoids_2760": 4000,
    "superquadrics_2760": 2000,
    "poly_ellipsoids_20000": 700,
    "superquadrics_20000": 400,
}
QUICK = ("spheres_2000", "ellipsoids_2760", "poly_ellipsoids_2760", "superquadrics_2760")


@dataclass
class Timing:
    """Repeats of one code on one bed with some cores."""

    code: str
    case: str
    grains: int
    cores: int
    wall: list[float] = field(default_factory=list)  # grain-steps a second
    cpu: list[float] = field(default_factory=list)  # grain-steps a second of CPU time
    contacts: int = 0
    memory: float = 0.0  # MB, all processes


def environment(cores: int) -> dict[str, str]:
    """Return the variables of a run."""
    return dict(
        os.environ, OMP_NUM_THREADS=str(cores), OMP_PROC_BIND="close", OMP_PLACES="cores",
        OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
    )  # fmt: skip


def measured(command: list[str], folder: Path, cores: int) -> tuple[str, float]:
    """Run a command in a folder; return what it said and its CPU time [s]."""
    before = os.times()
    threads = 1 if "mpirun" in command else cores
    done = subprocess.run(
        command, cwd=folder, env=environment(threads), capture_output=True, text=True
    )
    after = os.times()
    if done.returncode:
        said = f"{done.stdout[-2000:]}{done.stderr}"
        raise SystemExit(f"bench: {' '.join(command)} ended with {done.returncode}\n{said}")
    cpu = after.children_user + after.children_system
    cpu -= before.children_user + before.children_system
    return done.stdout, cpu


def peak_memory(command: list[str], folder: Path, cores: int, program: str) -> float:
    """Run a command and return the largest resident size of its processes of a program [MB]."""
    threads = 1 if "mpirun" in command else cores
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    own, binary = str(folder), os.path.realpath(program)
    peaks: dict[str, float] = {}
    with subprocess.Popen(command, cwd=folder, env=environment(threads), **quiet) as running:
        while running.poll() is None:
            for path in Path("/proc").glob("[0-9]*"):
                try:
                    if os.readlink(path / "exe") != binary or os.readlink(path / "cwd") != own:
                        continue
                    found = re.search(r"VmHWM:\s+(\d+) kB", (path / "status").read_text())
                except OSError:
                    continue
                if found:
                    peaks[path.name] = float(found[1]) / 1024.0
            time.sleep(0.02)
    return sum(peaks.values())


class Bench:
    """One bed: its files, the codes that can take it, and what they did."""

    def __init__(self, binary: Path, out: Path, bed: beds.Bed, threads: int):
        """Settle the bed if need be and write all input."""
        self.binary, self.bed, self.folder = binary, bed, out / "beds"
        self.settled = beds.settle(binary, self.folder, bed, threads)
        self.steps = STEPS[bed.name]
        self.codes = {"talus": str(binary)}
        if bed.shape == "spheres" and not bed.source:
            self.codes |= peers.installed()
        for code in self.codes:
            for kind, runs in (("base", [BASE]), ("check", [CHECK]), ("time", [WARM, self.steps])):
                self._write(code, kind, runs)

    def _write(self, code: str, kind: str, runs: list[int]) -> None:
        """Write the input of a code for a check or a timed run."""
        if code != "talus":
            data = peers.export(self.folder, self.bed)
            text = peers.INPUTS[code](self.bed, data, runs)
        else:
            t_end = runs[-1] * beds.DT
            text = beds.deck(self.bed, f"{self.bed.name}.h5", t_end)
            if kind == "check" and self.bed.grains <= 100000:
                text += f"&output every_time = {t_end:.9g} /\n"
        (self.folder / self.file(code, kind)).write_text(text)

    def file(self, code: str, kind: str) -> str:
        """Name of an input file."""
        return f"{self.bed.name}_{kind}.{'nml' if code == 'talus' else code}"

    def command(self, code: str, kind: str, cores: int) -> list[str]:
        """Command line of a run."""
        if code != "talus":
            return peers.command(self.codes[code], self.file(code, kind), cores)
        cpus = ",".join(map(str, range(cores)))
        return ["taskset", "-c", cpus, self.codes[code], self.file(code, kind),
                f"--threads={cores}"]  # fmt: skip

    def summary(self, kind: str) -> dict:
        """Return the summary of Talus' last run."""
        return json.loads((self.folder / f"{self.bed.name}_{kind}_summary.json").read_text())

    def check(self) -> dict[str, tuple[float, float]]:
        """Run CHECK steps with every code; return contacts between grains and kinetic energy."""
        found = {}
        for code in self.codes:
            said, _ = measured(self.command(code, "check", 1), self.folder, 1)
            if code == "talus":
                summary = self.summary("check")
                touches = beds.coordination(self.folder / f"{self.bed.name}_check.h5")
                between = touches - summary["contacts"]
                found[code] = (between, summary["energy"]["kinetic_J"])
            else:
                step, kinetic, between = peers.states(said)[-1]
                found[code] = (between, kinetic)
        return found

    def base(self, timing: Timing) -> float:
        """Return the CPU time of a run that does little more than set up [s]."""
        command = self.command(timing.code, "base", timing.cores)
        return measured(command, self.folder, timing.cores)[1]

    def time(self, timing: Timing, base: float) -> None:
        """Add one repeat to a timing; `base` is the CPU time of setting up [s]."""
        code = timing.code
        said, cpu = measured(self.command(code, "time", timing.cores), self.folder, timing.cores)
        if code == "talus":
            summary = self.summary("time")
            seconds = summary["timers"]["steps"]
            timing.contacts = summary["contacts"]
        else:
            seconds = peers.loops(said)[-1]
        timing.wall.append(self.bed.grains * self.steps / seconds)
        steps = self.steps - BASE + (0 if code == "talus" else WARM)
        timing.cpu.append(self.bed.grains * steps / max(cpu - base, 1.0e-9))

    def memory(self, code: str, cores: int) -> float:
        """Peak memory of a code [MB], from a run of its own."""
        command = self.command(code, "time", cores)
        return peak_memory(command, self.folder, cores, self.codes[code])


def disagreement(found: dict[str, tuple[float, float]]) -> list[str]:
    """Return a line for every code whose contacts or kinetic energy differ from Talus'."""
    ours, lines = found["talus"], []
    limits = (("contacts", CONTACTS_AGREE), ("kinetic energy", KINETIC_AGREE))
    for code, theirs in found.items():
        for k, (what, limit) in enumerate(limits):
            ratio = theirs[k] / ours[k]
            if abs(ratio - 1.0) > limit:
                lines.append(f"{code}: {what} after {CHECK} steps is {ratio:.3f} of Talus'")
    return lines


def together(names: list[str]) -> list[list[str]]:
    """Return the beds by groups that are timed in turns."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(beds.BEDS[name].beside or beds.BEDS[name].source or name, []).append(name)
    return list(groups.values())


def run(
    binary: Path, out: Path, names: list[str], cores: list[int], repeats: int, threads: int
) -> tuple[list[Timing], list[dict]]:
    """Time all codes on the beds; return the timings and what the checks found."""
    timings, checks = [], []
    for group in together(names):
        benches = [prepared(binary, out, name, threads, checks) for name in group]
        own = [
            (bench, Timing(code, bench.bed.name, bench.bed.grains, n))
            for n in cores
            for bench in benches
            for code in bench.codes
        ]
        bases = [bench.base(timing) for bench, timing in own]
        for _ in range(repeats):
            for (bench, timing), base in zip(own, bases, strict=True):
                bench.time(timing, base)
        contacts = {t.case: t.contacts for _, t in own if t.code == "talus"}
        for bench, timing in own:
            timing.memory = bench.memory(timing.code, timing.cores)
            timing.contacts = contacts[timing.case]
            print(
                f"  {timing.code} on {timing.cores}, {timing.case}: "
                f"{statistics.median(timing.wall) / 1e6:.3f} million grain-steps/s, "
                f"{statistics.median(timing.cpu) / 1e6:.3f} by CPU time, {timing.memory:.0f} MB",
                flush=True,
            )
        timings += [timing for _, timing in own]
    return timings, checks


def prepared(binary: Path, out: Path, name: str, threads: int, checks: list[dict]) -> Bench:
    """Settle a bed and compare the codes on it; add what was found to the checks."""
    bench = Bench(binary, out, beds.BEDS[name], threads)
    print(beds.say(bench.settled), flush=True)
    if len(bench.codes) > 1:
        found = bench.check()
        for code, (contacts, kinetic) in found.items():
            print(f"  {code}: {contacts:.0f} contacts between grains, {kinetic:.4g} J kinetic")
            checks.append({"case": name, "code": code, "contacts": contacts, "kinetic_J": kinetic})
        for line in disagreement(found):
            print(f"  NOT THE SAME WORK: {line}")
    return bench
