"""Kill, stop and signal the programs of a coupled run; nothing may hang or stay behind.

Usage: run.py BIN SCRATCH
20 kills of a solver at random moments, a solver that is stopped (SIGSTOP), SIGTERM to talus-couple
and a restart, stop of talus-couple itself by SIGKILL, a second run in the folder of a first one.
Prints 'N passed, M failed'.
"""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.verification import write_packing

PITCH = 5.0e-3
TRIES = 20
PROGRAMS = {"talus-dem": "grains", "talus-fem": "solid"}

GRAINS = """&run       title = 'Grains on a cube', gravity = 0.0, 0.0, -9.81 /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = 0.05 /
&particles file = 'packing.h5', material = 'quartz' /
&dynamics  dt = 5.0e-6 /
&history   every_time = 1.0e-3 /
"""
SOLID = """&run      title = 'Cube', gravity = 0.0, 0.0, -9.81 /
&mesh     file = 'block.h5' /
&material id = 'soil', density = 1500.0, young = 1.0e7, poisson = 0.3 /
&section  group = 'all', material = 'soil' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&analysis kind = 'static' /
"""
COUPLED = """&run        title = 'Faults', t_end = {t_end} /
&program    side = 'grains', deck = 'grains.nml', threads = 1 /
&program    side = 'solid', deck = 'solid.nml', threads = 1 /
&port       time_limit = 3.0, transport = '{transport}' /
&clock      exchange = 5.0e-5 /
&facets     ghosts = 'floor', facets = 'z1' /
&checkpoint every_time = 2.0e-3 /
"""


def make_model(
    folder: Path, t_end: float, transport: str = "shared_memory", *, surface: bool = False
) -> None:
    """Write packing, mesh and decks: 16 ghosts on a cube, 18 grains falling on them.

    With a surface there are no ghosts: the grains fall on the facets of the cube.
    """
    folder.mkdir(parents=True)
    a = (np.arange(4) + 0.5) * PITCH
    b = (np.arange(3) + 1.0) * PITCH
    flat = [] if surface else [(x, y, 0.0) for x in a for y in a]
    low = 0.5 if surface else 0.72
    free = [(x, y, (low + 1.02 * k) * PITCH) for k in range(2) for x in b for y in b]
    x = np.array(flat + free)
    kind = np.array([1] * len(flat) + [0] * len(free), dtype=np.int32)
    v = np.zeros_like(x)
    v[len(flat) :, 2] = -0.2
    axes = np.full((len(x), 3), 0.49 * PITCH)
    groups = {} if surface else {"floor": np.arange(1, len(flat) + 1)}
    write_packing(folder / "packing.h5", x, axes, kind=kind, v=v, groups=groups)
    edge = 4 * PITCH
    cube = meshes.box(np.array([0.0, 0.0, -edge]), np.array([edge, edge, 0.0]), (2, 2, 2))
    meshes.write_mesh(folder / "block.h5", cube)
    (folder / "grains.nml").write_text(GRAINS)
    (folder / "solid.nml").write_text(SOLID)
    deck = COUPLED.format(t_end=t_end, transport=transport)
    if surface:
        deck = deck.replace("ghosts = 'floor'", "surface = 'quartz', interface = 'none'")
    (folder / "coupled.nml").write_text(deck)


def children(pid: int) -> dict[str, int]:
    """Return the solvers that talus-couple has started, by program."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = entry.read_text()
        except OSError:
            continue
        name = text[text.index("(") + 1 : text.rindex(")")]
        if int(text[text.rindex(")") + 2 :].split()[1]) == pid:
            found[name] = int(entry.parent.name)
    return found


def alive(pid: int) -> bool:
    """Tell whether a process is there and no zombie."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return text[text.rindex(")") + 2] not in "ZX"


class Run:
    """One coupled run under way."""

    def __init__(self, binaries: Path, folder: Path, *options: str) -> None:
        """Start it."""
        self.log = (folder / "seen.txt").open("w+")
        command = [str(binaries / "talus-couple"), "coupled.nml", *options]
        self.process = subprocess.Popen(
            command, cwd=folder, stdout=self.log, stderr=subprocess.STDOUT
        )
        self.pid = self.process.pid
        self.solvers: dict[str, int] = {}

    def wait_for_solvers(self) -> None:
        """Wait until both solvers are there."""
        limit = time.monotonic() + 60.0
        while len(self.solvers) < 2 and time.monotonic() < limit:
            self.solvers = {k: v for k, v in children(self.pid).items() if k in PROGRAMS}
            time.sleep(0.01)
        if len(self.solvers) < 2:
            raise SystemExit(f"no two solvers within 60 s: {self.end(1.0)}")

    def end(self, limit: float = 60.0) -> tuple[int, str]:
        """Return exit code and output; a run that hangs is killed and has code -1."""
        try:
            code = self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            code = -1
        self.log.seek(0)
        return code, self.log.read()

    def left_behind(self) -> list[str]:
        """Return processes and segments that outlived the run."""
        for _ in range(100):
            stray = [f"process {name}" for name, pid in self.solvers.items() if alive(pid)]
            segments = list(Path("/dev/shm").glob(f"talus-{self.pid}-*"))
            if not stray and not segments:
                return []
            time.sleep(0.05)
        return stray + [str(path) for path in segments]


class Tally:
    """Counts checks."""

    def __init__(self) -> None:
        """Begin at zero."""
        self.passed = self.failed = 0

    def check(self, name: str, good: bool, seen: str = "") -> None:
        """Count one check."""
        self.passed += good
        self.failed += not good
        if not good:
            print(f"FAILED: {name}\n{seen[-1500:]}")


def judge_failure(tally: Tally, name: str, run: Run, program: str) -> None:
    """A run that lost a solver: exit code 4, one message that names it, nothing left behind."""
    code, text = run.end()
    tally.check(f"{name}: exit code 4, not {code}", code == 4, text)
    faults = re.findall(r"^error ([A-Z]\d{3}): (.*)$", text, re.MULTILINE)
    one = len(faults) == 1 and faults[0][1].startswith(program)
    tally.check(f"{name}: one message that names {program}: {faults}", one, text)
    left = run.left_behind()
    tally.check(f"{name}: nothing left behind: {left}", not left)


def kills(tally: Tally, binaries: Path, scratch: Path) -> None:
    """Kill a solver at a random moment, sometimes during set-up."""
    rng = random.Random(3)
    for k in range(TRIES):
        folder = scratch / f"kill{k:02d}"
        make_model(folder, 2.0, "hdf5" if k % 5 == 4 else "shared_memory")
        run = Run(binaries, folder)
        run.wait_for_solvers()
        program = rng.choice(sorted(PROGRAMS))
        wait = rng.uniform(0.0, 0.2 if k % 2 else 1.5)
        time.sleep(wait)
        os.kill(run.solvers[program], signal.SIGKILL)
        judge_failure(tally, f"kill {k} of {program} after {wait:.2f} s", run, program)


def stopped_solver(tally: Tally, binaries: Path, scratch: Path) -> None:
    """A stopped solver is a hang, found after the time limit."""
    for program, side in PROGRAMS.items():
        folder = scratch / f"stop_{side}"
        make_model(folder, 2.0)
        run = Run(binaries, folder)
        run.wait_for_solvers()
        time.sleep(1.0)
        os.kill(run.solvers[program], signal.SIGSTOP)
        judge_failure(tally, f"SIGSTOP of {program}", run, program)


def killed_coupler(tally: Tally, binaries: Path, scratch: Path) -> None:
    """When talus-couple itself is killed, both solvers leave."""
    folder = scratch / "kill_couple"
    make_model(folder, 2.0)
    run = Run(binaries, folder)
    run.wait_for_solvers()
    time.sleep(1.0)
    os.kill(run.pid, signal.SIGKILL)
    run.end()
    left = run.left_behind()
    tally.check(f"kill of talus-couple: nothing left behind: {left}", not left)


def restarts(tally: Tally, binaries: Path, scratch: Path) -> None:
    """SIGTERM gives exit code 3; the restarted run ends as one that was never stopped."""
    whole, parts = scratch / "whole", scratch / "parts"
    for folder in (whole, parts):
        make_model(folder, 0.05)
    code, text = Run(binaries, whole).end(300.0)
    tally.check(f"whole run: exit code 0, not {code}", code == 0, text)
    run = Run(binaries, parts)
    run.wait_for_solvers()
    audit = parts / "coupled_audit.csv"
    while run.process.poll() is None and not (audit.exists() and audit.stat().st_size > 5000):
        time.sleep(0.02)
    run.process.send_signal(signal.SIGTERM)
    code, text = run.end()
    tally.check(f"SIGTERM: exit code 3, not {code}", code == 3, text)
    tally.check("SIGTERM: manifest written", (parts / "coupled.manifest").exists(), text)
    left = run.left_behind()
    tally.check(f"SIGTERM: nothing left behind: {left}", not left)
    code, text = Run(binaries, parts, "--restart=auto").end(300.0)
    tally.check(f"restart: exit code 0, not {code}", code == 0, text)
    for name in ("coupled_audit.csv", "grains_energy.csv"):
        same = (whole / name).read_bytes() == (parts / name).read_bytes()
        tally.check(f"restart: {name} is that of the whole run", same)


def second_run(tally: Tally, binaries: Path, scratch: Path) -> None:
    """Refuse a run whose files another one writes; take the locks over once it was killed."""
    folder = scratch / "second"
    make_model(folder, 2.0)
    first = Run(binaries, folder)
    first.wait_for_solvers()
    audit = folder / "coupled_audit.csv"
    limit = time.monotonic() + 20.0
    while time.monotonic() < limit and not (audit.exists() and audit.stat().st_size > 0):
        time.sleep(0.02)
    for program, deck in (
        ("talus-couple", "coupled.nml"),
        ("talus-dem", "grains.nml"),
        ("talus-fem", "solid.nml"),
    ):
        if program == "talus-dem":
            text = GRAINS.replace("&run ", "&run t_end = 1.0e-4,")
            (folder / deck).write_text(text)
        done = subprocess.run(
            [str(binaries / program), deck], cwd=folder, capture_output=True, text=True, timeout=60
        )
        said = done.stdout + done.stderr
        tally.check(f"second {program}: exit 4, not {done.returncode}", done.returncode == 4, said)
        holder = first.pid if program == "talus-couple" else first.solvers[program]
        named = "error S014" in said and f"process {holder} on host" in said
        tally.check(f"second {program}: the holder {holder} is named", named, said)
    tally.check("the first run goes on", first.process.poll() is None)
    first.process.kill()
    first.end()
    left = first.left_behind()
    tally.check(f"first run killed: nothing left behind: {left}", not left)
    (folder / "grains.nml").write_text(GRAINS)
    (folder / "coupled.nml").write_text(
        COUPLED.format(t_end=1.0e-3, transport="shared_memory").replace("2.0e-3", "1.0e-3")
    )
    code, text = Run(binaries, folder).end()
    tally.check(f"locks of dead runs are taken over: exit 0, not {code}", code == 0, text)
    locks = [path.name for path in folder.glob("*.lock")]
    tally.check(f"no lock stays: {locks}", not locks)


def main() -> int:
    """Run all faults; return 1 if any check failed."""
    binaries, scratch = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    shutil.rmtree(scratch, ignore_errors=True)
    tally = Tally()
    second_run(tally, binaries, scratch)
    restarts(tally, binaries, scratch)
    stopped_solver(tally, binaries, scratch)
    killed_coupler(tally, binaries, scratch)
    kills(tally, binaries, scratch)
    print(f"{tally.passed} passed, {tally.failed} failed")
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
