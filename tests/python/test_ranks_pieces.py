"""Solids whose nodes are distributed to the ranks: answers, restarts, faults, memory."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus.mesh import Mesh, box, write_mesh
from talus.programs import find_program
from talus.verification import launcher

SAME = 1.0e-10  # of the largest of a kind; sums of ranks come in another order
ELASTIC = "young = 1.0e9, poisson = 0.3"
CONE = (
    "law = 'drucker_prager', young = 2.0e7, poisson = 0.3, cohesion = 1.2e4, friction_deg = 25.0, "
    "dilation_deg = 5.0, hardening = 1.0e5"
)
HEAD = """&run title = 'Cube', gravity = 3.0, 0.0, -9.81, t_end = END /
&mesh file = 'cube.h5' /
&material id = 's', density = 2000.0, MATERIAL /
&section group = 'all', material = 's', element = 'ELEMENT' /
&support group = 'z0', fix = 'x', 'y', 'z' /
&history every_time = EVERY /
&output every_time = EVERY /
&checkpoint every_time = EVERY, keep = 9 /
"""
LOADS = """&traction group = 'z1', value = 1.0e4, 0.0, -2.0e4, curve = 'up' /
&pressure group = 'y1', value = 1.0e4 /
&body_load group = 'core', force = 0.0, 5.0e3, 0.0 /
&point_load node = 300, force = 1.0e2, 0.0, 3.0e2 /
&curve id = 'up', times = 0.0, 1.0, values = 0.0, 1.0 /
"""
SPRINGS = "&spring group = 'x1', normal = 1.0e8, tangential = 1.0e7 /\n"
MOTION = """&motion group = 'edge', component = 'x', curve = 'm' /
&curve id = 'm', times = 0.0, 1.0, values = 0.0, 1.0e-3 /
"""
STRESS = "&initial_stress group = 'all', value = -1.0e4, -1.0e4, -1.0e4, 0.0, 0.0, 0.0 /\n"
ABSORBING = "&absorbing group = 'y1' /\n"
MOVED = (
    "&initial_displacement group = 'all', component = 'y', value = 0.0, "
    "gradient = 0.0, 0.0, 1.0e-4 /\n"
)
STATIC = "kind = 'static', solver = 'SOLVER', tolerance = 1.0e-13, dt = 0.5"
WAVES = "kind = 'explicit', dt = 2.0e-5"
DECKS = {  # end and interval, material, element, more groups, analysis
    "multigrid": (1.0, 0.5, ELASTIC, "hex8_full", SPRINGS, STATIC.replace("SOLVER", "multigrid")),
    "gradients": (1.0, 0.5, ELASTIC, "hex8_bbar", MOTION, STATIC.replace("SOLVER", "iterative")),
    "flow": (1.0, 0.5, CONE, "hex8_bbar", SPRINGS + STRESS,
             STATIC.replace("SOLVER", "multigrid")),
    "waves": (4e-3, 1e-3, ELASTIC, "hex8_bbar", ABSORBING + SPRINGS,
              f"{WAVES}, rayleigh_mass = 1.0, rayleigh_stiffness = 1.0e-6"),
    "one_point": (4e-3, 1e-3, ELASTIC, "hex8_one_point", MOVED + MOTION, WAVES),
    "yielding": (4e-3, 1e-3, CONE, "hex8_bbar", SPRINGS, WAVES),
}  # fmt: skip
# what a rank starts leaves its most memory [KiB] in a file of its own
WATCH = """import os, resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
open("peak." + os.environ.get("OMPI_COMM_WORLD_RANK", "0"), "w").write(str(most))
sys.exit(code)
"""


def cube(cells: int) -> Mesh:
    """Return a cube of hexahedra with groups."""
    mesh = box(np.zeros(3), np.ones(3), (cells, cells, cells))
    x = mesh.x
    middle = x[mesh.cells["hex8"]].mean(axis=1)
    mesh.volumes["core"] = np.flatnonzero((middle[:, 0] < 0.5) & (middle[:, 2] > 0.5))
    mesh.nodes["edge"] = np.flatnonzero((x[:, 0] > 1 - 1e-9) & (x[:, 2] > 1 - 1e-9))
    return mesh


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a cube and all decks."""
    folder = tmp_path_factory.mktemp("pieces")
    write_mesh(folder / "cube.h5", cube(6))
    for name, (end, every, material, element, more, analysis) in DECKS.items():
        words = {"END": str(end), "EVERY": str(every), "MATERIAL": material, "ELEMENT": element}
        text = HEAD
        for word, value in words.items():
            text = text.replace(word, value)
        (folder / f"{name}.nml").write_text(text + LOADS + more + f"&analysis {analysis} /\n")
    return folder


def run(folder: Path, deck: str, ranks: int, *words: str) -> subprocess.CompletedProcess:
    """Run a deck on ranks."""
    start = launcher(ranks) if ranks > 1 else []
    command = [*start, str(find_program("talus-fem")), f"{deck}.nml", "--threads=1", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def results(folder: Path, deck: str) -> dict[str, np.ndarray]:
    """Return all fields of all steps and all columns of the histories."""
    found = {}
    with h5py.File(folder / f"{deck}.h5") as file:
        file.visititems(
            lambda name, item: found.update({name: item[...]})
            if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" else None
        )  # fmt: skip
    for name in ("energy", "reactions"):
        table = np.loadtxt(folder / f"{deck}_{name}.csv", delimiter=",", skiprows=1)
        found[name] = table[:, 1:]
    return found


def difference(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> float:
    """Return the largest difference over the largest of a kind."""
    assert {k: v.shape for k, v in a.items()} == {k: v.shape for k, v in b.items()}
    kinds: dict[str, float] = {}
    for key, values in a.items():
        kind = key.split("/")[-1]
        kinds[kind] = max(kinds.get(kind, 1e-300), np.abs(values).max(initial=0.0))
    return max(
        np.abs(a[k] - b[k]).max(initial=0.0) / kinds[k.split("/")[-1]]
        for k in a if a[k].size
    )  # fmt: skip


@pytest.mark.parametrize("name", DECKS)
def test_ranks_with_pieces_agree_with_one(folder: Path, name: str) -> None:
    """Loads on facets, elements and nodes, springs, motions, dashpots, laws with a state."""
    assert run(folder, name, 1).returncode == 0
    alone = results(folder, name)
    assert max(np.abs(v).max() for k, v in alone.items() if k.endswith("/u")) > 1e-6
    for ranks in (2, 3):
        done = run(folder, name, ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        assert difference(alone, results(folder, name)) < SAME


@pytest.mark.parametrize("name", ["waves", "flow"])
def test_a_restart_repeats_the_bits(folder: Path, name: str, tmp_path: Path) -> None:
    """On as many ranks; on others the answers are the same."""
    for path in (folder / "cube.h5", folder / f"{name}.nml"):
        shutil.copy(path, tmp_path)
    assert run(tmp_path, name, 3).returncode == 0
    whole = results(tmp_path, name)
    (tmp_path / f"{name}.chk.1.h5").rename(tmp_path / "kept.h5")
    for ranks, limit in ((3, 0.0), (2, SAME), (1, SAME)):
        done = run(tmp_path, name, ranks, "--restart=kept.h5")
        assert done.returncode == 0, done.stdout + done.stderr
        assert difference(whole, results(tmp_path, name)) <= limit


FAULTS = {
    "&support group = 'z0', fix = 'x', 'y', 'z' /": "&support group = 'z0', fix = 'z' /",
    "node = 300": "node = 344",
    "group = 'core'": "group = 'care'",
    "young = 1.0e9": "young = 1.0e400",
}


@pytest.mark.parametrize("old", FAULTS)
def test_faults_are_those_of_one_rank(folder: Path, old: str) -> None:
    """Whoever finds them: the same words with the numbers of the whole mesh."""
    text = (folder / "multigrid.nml").read_text().replace(SPRINGS, "")
    assert old in text
    (folder / "wrong.nml").write_text(text.replace(old, FAULTS[old]))
    alone = run(folder, "wrong", 1)
    assert alone.returncode in (1, 2)
    for ranks in (2, 3):
        several = run(folder, "wrong", ranks)
        assert several.returncode == alone.returncode
        faults = several.stderr.split("-----")[0].strip()  # the launcher's words follow
        assert faults == alone.stderr.strip()


def test_another_mesh_is_refused_at_a_restart(folder: Path, tmp_path: Path) -> None:
    """One fault of rank 0, which reads the checkpoint."""
    write_mesh(tmp_path / "cube.h5", cube(5))
    text = (folder / "waves.nml").read_text().replace("node = 300", "node = 200")
    (tmp_path / "waves.nml").write_text(text)
    assert run(tmp_path, "waves", 2).returncode == 0
    shutil.copy(tmp_path / "waves.chk.h5", folder / "other.h5")
    done = run(folder, "waves", 2, "--restart=other.h5")
    assert done.returncode == 1
    assert "216 blocks of unknowns, the model 343" in done.stderr


def test_factors_follow_iterations_that_fail(tmp_path: Path) -> None:
    """Hourglass modes that nearly nothing holds stop conjugate gradients, which were chosen."""
    write_mesh(tmp_path / "cube.h5", cube(15))
    text = (
        HEAD.replace("END", "1.0").replace("EVERY", "1.0").replace("MATERIAL", ELASTIC)
        .replace("element = 'ELEMENT'", "element = 'hex8_one_point', hourglass = 1.0e-8")
    )  # fmt: skip
    text += "&point_load node = 3000, force = 1.0, 2.0, 3.0 /\n"
    text += "&limits allow = 'displacement_gradient' /\n"
    (tmp_path / "auto.nml").write_text(text + "&analysis kind = 'static' /\n")
    (tmp_path / "direct.nml").write_text(text + "&analysis kind = 'static', solver = 'direct' /\n")
    assert run(tmp_path, "direct", 1).returncode == 0
    done = run(tmp_path, "auto", 2)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "factors are made" in (tmp_path / "auto.log").read_text()
    assert difference(results(tmp_path, "direct"), results(tmp_path, "auto")) < 1e-7


def test_memory_falls_with_the_ranks(tmp_path: Path) -> None:
    """Beyond the program itself four ranks take little more than a quarter each."""
    write_mesh(tmp_path / "cube.h5", cube(40))
    text = HEAD.replace("END", "4.0e-5").replace("EVERY", "1.0").replace("MATERIAL", ELASTIC)
    text = text.replace("ELEMENT", "hex8_bbar") + f"&analysis {WAVES} /\n"
    (tmp_path / "large.nml").write_text(text)
    (tmp_path / "small.nml").write_text(text.replace("cube.h5", "few.h5"))
    write_mesh(tmp_path / "few.h5", cube(2))
    (tmp_path / "watch.py").write_text(WATCH)
    most = {}
    for deck, ranks in (("small", 2), ("large", 1), ("large", 4)):
        start = launcher(ranks) if ranks > 1 else []
        subprocess.run(
            [*start, sys.executable, "watch.py", str(find_program("talus-fem")), f"{deck}.nml",
             "--threads=1"], cwd=tmp_path, check=True, capture_output=True,
        )  # fmt: skip
        most[deck, ranks] = [int((tmp_path / f"peak.{r}").read_text()) / 1024 for r in range(ranks)]
    base = max(most["small", 2])
    alone = most["large", 1][0] - base
    shares = [(m - base) / alone for m in most["large", 4]]
    assert max(shares[1:]) < 0.36, json.dumps({str(k): v for k, v in most.items()})
    assert shares[0] < 0.7
