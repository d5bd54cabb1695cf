"""What --check tells of the memory of solids and of coupled runs, against what runs take."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from talus.mesh import box, write_mesh
from talus.orders import converted
from talus.programs import find_program
from talus.verification import launcher, write_packing

OFF = 0.2  # of what a run takes
LINEAR = "young = 1.0e7, poisson = 0.3"
POLAR = (
    "law = 'micropolar', micro_inertia = 1.0e-7, lambda = 1.0e7, mu = 1.0e7, kappa = 7.0e7,"
    " alpha = 0.0, beta = 0.0, gamma = 10.0"
)
CONE = (
    "law = 'drucker_prager', young = 1.0e8, poisson = 0.25, friction_deg = 30.0,"
    " dilation_deg = 5.0, cohesion = 2.0e4"
)
SOLIDS = {  # cells a side, kind of the mesh, element, material, analysis
    "hex8": (16, "hex8", "hex8_bbar", LINEAR, "kind = 'static', solver = 'direct'"),
    "hex20": (9, "hex20", "hex20", LINEAR, "kind = 'static', solver = 'direct'"),
    "micropolar": (12, "hex8", "hex8/hex8", POLAR, "kind = 'static', solver = 'direct'"),
    "yielding": (13, "hex8", "hex8_bbar", CONE, "kind = 'static', solver = 'direct', dt = 0.5"),
    "multigrid": (20, "hex8", "hex8_bbar", LINEAR, "kind = 'static', solver = 'multigrid'"),
    "explicit": (24, "hex8", "hex8_bbar", LINEAR, "kind = 'explicit'"),
}
# what a rank starts leaves its most memory [KiB] in a file of its own
WATCH = """import os, resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
if "--check" not in sys.argv:
    open(f"peak.{os.getpid()}", "w").write(str(most))
sys.exit(code)
"""
ALONE = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
GRAINS = """&run       title = 'Spheres', gravity = 0.0, 0.0, 0.0 /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5 /
&particles file = 'pack.h5', material = 'quartz' /
&dynamics  dt = 1.0e-7 /
"""
COUPLED = """&run     title = 'Spheres and a block', t_end = 3.0e-7 /
&program side = 'grains', deck = 'grains.nml', threads = 1, launch = 'command',
         command = '{grains}' /
&program side = 'solid', deck = 'solid.nml', threads = 1, launch = 'command',
         command = '{solid}' /
&clock   exchange = 1.0e-7 /
"""
DIAMETER = 1.0e-3


def write_solid(folder: Path, element: str, material: str, analysis: str, end: str) -> None:
    """Write the deck of a clamped block of a mesh that is there."""
    (folder / "solid.nml").write_text(f"""&run title = 'Block', gravity = 0.0, 0.0, 0.0{end} /
&mesh     file = 'mesh.h5' /
&material id = 'm', density = 1800.0, {material} /
&section  group = 'all', material = 'm', element = '{element}' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&traction group = 'z1', value = 0.0, 0.0, 1.0e2 /
&analysis {analysis} /
""")


def told(words: list[str], folder: Path) -> np.ndarray:
    """Return what --check tells [MiB]: of one rank, or of the first and the most of the others."""
    out = subprocess.run(
        [*words, "--check"], cwd=folder, capture_output=True, text=True, check=True, env=ALONE
    ).stdout
    ranks = re.search(r"the first (\S+) MiB, the others (?:\S+ to )?(\S+) MiB", out)
    one = re.search(r"(\S+) MiB at most", out)
    return np.array([float(v) for v in (ranks.groups() if ranks else one.groups())])


def peaks(folder: Path) -> np.ndarray:
    """Return what was taken [MiB], the least first, and forget it."""
    files = list(folder.glob("peak.*"))
    values = sorted(int(p.read_text()) / 1024 for p in files)
    for path in files:
        path.unlink()
    return np.array(values)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", SOLIDS)
def test_check_tells_the_memory_of_a_solid(name: str, ranks: int, tmp_path: Path) -> None:
    """Factors of symmetric and general matrices, levels, explicit steps."""
    n, kind, element, material, analysis = SOLIDS[name]
    mesh = box(np.zeros(3), np.ones(3), (n, n, n))
    write_mesh(tmp_path / "mesh.h5", mesh if kind == "hex8" else converted(mesh, kind))
    end = "1.0e-3" if name == "explicit" else "1.0"
    write_solid(tmp_path, element, material, analysis, f", t_end = {end}")
    (tmp_path / "watch.py").write_text(WATCH)
    start = launcher(ranks) if ranks > 1 else []
    program = [str(find_program("talus-fem")), "solid.nml"]
    foretold = told([*start, *program], tmp_path)
    subprocess.run(
        [*start, sys.executable, "watch.py", *program],
        cwd=tmp_path, check=True, env=ALONE, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    assert np.abs(np.sort(foretold) / peaks(tmp_path) - 1).max() < OFF


def facets(folder: Path) -> str:
    """Write a block whose upper face carries ghosts under layers of spheres."""
    m, layers = 40, 6
    i = np.indices((layers, m, m)).reshape(3, -1).T[:, ::-1]
    x = (i + 0.5) * DIAMETER * np.array([1.0, 1.0, 1 - 1e-5])
    x[:, 2] -= 0.5 * DIAMETER
    kind = np.where(i[:, 2] == 0, 1, 0)
    ids = np.arange(1, len(x) + 1)
    write_packing(
        folder / "pack.h5", x, np.full(x.shape, 0.5 * DIAMETER), kind=kind, ids=ids,
        groups={"ghosts": ids[kind == 1]},
    )  # fmt: skip
    wide = m * DIAMETER
    write_mesh(
        folder / "mesh.h5", box(np.array([0, 0, -wide]), np.array([wide, wide, 0]), (14,) * 3)
    )
    write_solid(folder, "hex8_bbar", LINEAR, "kind = 'static'", "")
    return "&facets ghosts = 'ghosts', facets = 'z1' /"


def overlap(folder: Path) -> str:
    """Write a block with spheres in its middle."""
    wide, depth, h = 14, 2, 3.0 * DIAMETER
    n = 3 * (wide - 2 * depth) - 1
    x = depth * h + (np.indices((n, n, n)).reshape(3, -1).T + 1.0) * DIAMETER
    write_packing(folder / "pack.h5", x, np.full(x.shape, 0.5 * DIAMETER * (1 + 1e-5)))
    mesh = box(np.zeros(3), np.full(3, wide * h), (wide,) * 3)
    middle = mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * wide
    layer = 0.5 * wide - 0.5 - np.abs(middle).max(1)
    mesh.volumes.update(
        free=np.flatnonzero(layer > depth + 0.5),
        ghosts=np.flatnonzero(np.abs(layer - depth) < 0.5),
    )
    write_mesh(folder / "mesh.h5", mesh)
    write_solid(folder, "hex8_full", LINEAR, "kind = 'explicit'", "")
    return "&overlap free_elements = 'free', ghost_elements = 'ghosts', partition = 'ramp' /"


def most_of(process: subprocess.Popen) -> float:
    """Return the most memory of a process [MiB], looked at until it ends."""
    most = 0
    while process.poll() is None:
        found = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
        most = max(most, int(found[1]) if found else 0)
        try:
            process.wait(0.02)
        except subprocess.TimeoutExpired:
            continue
    assert process.returncode == 0
    return most / 1024


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("write", [facets, overlap])
def test_check_tells_the_memory_of_a_coupled_run(
    write: Callable[[Path], str], ranks: int, tmp_path: Path
) -> None:
    """The sum of all processes, with the solvers on one rank or two."""
    group = write(tmp_path)
    (tmp_path / "grains.nml").write_text(GRAINS)
    (tmp_path / "watch.py").write_text(WATCH)
    watch = [sys.executable, "watch.py"]
    start = " ".join([*launcher(ranks), *watch] if ranks > 1 else watch)
    commands = {
        side: f"{start} {find_program(program)}"
        for side, program in (("grains", "talus-dem"), ("solid", "talus-fem"))
    }
    (tmp_path / "coupled.nml").write_text(COUPLED.format(**commands) + group + "\n")
    words = [str(find_program("talus-couple")), "coupled.nml"]
    foretold = told(words, tmp_path)[-1]
    own = most_of(subprocess.Popen(words, cwd=tmp_path, env=ALONE, stdout=subprocess.DEVNULL))
    taken = peaks(tmp_path)
    assert len(taken) == 2 * ranks
    assert abs(foretold / (own + taken.sum()) - 1) < OFF, (foretold, own, taken)
