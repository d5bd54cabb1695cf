"""The readers of the manual's page on files, on files that a small coupled run writes.

Each is compared with what the files must hold: positions that were written, balances, laws of the
run; or with the reader of the package, which shares no line with it.
"""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sphere_tile import STRESS, sphere_tile

from talus import mesh, packing, verification

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("TALUS_BIN", ROOT / "build/bin"))
PAGE = (ROOT / "manual/files.md").read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.M | re.S)
LIBRARIES = {"h5py", "numpy", "csv", "json"}
LONGEST = 20
CORNERS = 0.035 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
PLACES = np.vstack([np.column_stack([CORNERS, np.full(4, z)]) for z in (0.03, 0.01)])
AXES = np.vstack([np.tile([0.1, 0.1, 0.01], (4, 1)), np.full((4, 3), 0.01)])
END, EXCHANGE, GRAVITY = 0.004, 2.0e-4, 9.8
FLOOR = """solid floor
facet normal 0 0 1
outer loop
vertex -0.1 -0.1 0
vertex 0.1 -0.1 0
vertex 0.1 0.1 0
endloop
endfacet
endsolid floor
"""
DECKS = {
    "coupled": f"""&run title = 'Cube on four grains', t_end = {END} /
&program side = 'grains', deck = 'grains.nml' /
&program side = 'solid', deck = 'solid.nml' /
&clock exchange = {EXCHANGE}, scheme = 'average' /
&facets ghosts = 'ghosts', facets = 'z0', interface = 'none', initial = 'none' /
&checkpoint every_time = 2.0e-3 /
""",
    "grains": f"""&run title = 'Four grains', gravity = 0.0, 0.0, -{GRAVITY} /
&material id = 'grain', density = 23.9, young = 1.0e9, poisson = 0.25 /
&contact between = 'grain', 'grain', law = 'linear', friction = 0.0,
  normal_stiffness = 2450.0, tangential_stiffness = 2450.0 /
&particles file = 'pack.h5', material = 'grain' /
&surface id = 'floor', file = 'floor.stl', material = 'grain' /
&dynamics dt = 2.0e-5 /
&history every_time = 1.0e-3 /
&output every_time = 2.0e-3, fields = 'contacts', packing = 'settled.h5' /
&measure id = 'all', region = 'box', lower = -0.06, -0.06, 0.0, upper = 0.06, 0.06, 0.05,
  every_time = 2.0e-3 /
&grid id = 'map', lower = -0.06, -0.06, 0.0, upper = 0.06, 0.06, 0.06, cells = 4, 4, 2,
  width = 4.0e-2, every_time = 2.0e-3 /
""",
    "solid": f"""&run title = 'Cube of 1 kg', gravity = 0.0, 0.0, -{GRAVITY} /
&mesh file = 'cube.h5' /
&material id = 'cube', density = 1000.0, young = 1.0e9, poisson = 0.25 /
&section group = 'all', material = 'cube' /
&analysis kind = 'newmark' /
&history every_time = 1.0e-3 /
&output every_time = 2.0e-3 /
""",
}


def readers() -> dict:
    """Return the functions of the page by name."""
    names: dict = {}
    for block in BLOCKS:
        exec(block, names)  # noqa: S102
    return names


READ = readers()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run a cube of finite elements on four ghosts, with a free grain under each, on a floor."""
    folder = tmp_path_factory.mktemp("files")
    verification.write_packing(folder / "pack.h5", PLACES, AXES, kind=np.repeat([1, 0], 4),
                               groups={"ghosts": np.arange(1, 5)})  # fmt: skip
    cube = mesh.box(np.array([-0.05, -0.05, 0.03]), np.array([0.05, 0.05, 0.13]), (2, 2, 2))
    mesh.write_mesh(folder / "cube.h5", cube)
    (folder / "floor.stl").write_text(FLOOR)
    for name, text in DECKS.items():
        (folder / f"{name}.nml").write_text(text)
    subprocess.run([BIN / "talus-couple", "coupled.nml"], cwd=folder, check=True,
                   capture_output=True, timeout=120)  # fmt: skip
    return folder


def test_short_and_plain() -> None:
    """No reader has more than 20 lines, and all are made from four libraries."""
    assert len(BLOCKS) == 9
    for block in BLOCKS:
        tree = ast.parse(block)
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno - node.lineno < LONGEST, node.name
            else:
                assert {name.name.split(".")[0] for name in node.names} <= LIBRARIES


def test_checksum(run: Path) -> None:
    """Checksums of packings, meshes and checkpoints are right, a changed byte is seen."""
    for name in ("settled.h5", "cube.h5", "coupled.x20.chk.h5"):
        said, found = READ["read_checksum"](run / name)
        assert said == found
    data = bytearray((run / "settled.h5").read_bytes())
    data[-1] ^= 1
    (run / "changed.h5").write_bytes(data)
    said, found = READ["read_checksum"](run / "changed.h5")
    assert said != found and READ["read_checksum"](run / "grains.h5") is None


def test_packing(run: Path) -> None:
    """Places, shapes, groups and contacts are those written, and those that the run ended with."""
    first, last = (READ["read_packing"](run / name) for name in ("pack.h5", "settled.h5"))
    assert np.array_equal(first["grains/x"], PLACES) and np.array_equal(first["grains/axes"], AXES)
    assert first["groups/ghosts"].tolist() == [1, 2, 3, 4]
    _, steps = READ["read_fields"](run / "grains.h5")
    pairs = {tuple(sorted(pair)) for pair in last["contacts/ids"].tolist()}
    told = {tuple(sorted(pair)) for pair in steps[-1]["contacts/ids"].tolist() if min(pair) > 0}
    assert pairs == told and (1, 5) in pairs
    assert np.array_equal(last["grains/x"], steps[-1]["grains/x"])


def test_packing_as_text(run: Path) -> None:
    """The text form has the same numbers, groups and shapes."""
    shaped = packing.make_packing(PLACES, AXES, groups={"a": np.array([1, 3]), "b": np.array([3])})
    shaped.skew[2], shaped.exponent[4] = [0.1, -0.2, 0.0], 4.0
    packing.write_text(run / "shaped.txt", shaped)
    read = READ["read_packing_text"](run / "shaped.txt")
    assert np.array_equal(read["x"], PLACES) and np.array_equal(read["axes"], AXES)
    assert np.array_equal(read["skew"], shaped.skew)
    assert np.array_equal(read["exponent"], shaped.exponent)
    assert (read["groups"][1], read["groups"][2], read["groups"][3]) == (["a"], [], ["a", "b"])


def test_mesh(run: Path) -> None:
    """Nodes, elements and groups give the volume of the cube and the area of its lower face."""
    x, cells, groups = READ["read_mesh"](run / "cube.h5")
    edges = x[cells["hex8"]][:, [1, 3, 4]] - x[cells["hex8"]][:, :1]
    assert np.linalg.det(edges).sum() == pytest.approx(1.0e-3)
    face = x[groups["facet_groups"]["z0"]["quad4"]]
    area = np.linalg.norm(np.cross(face[:, 1] - face[:, 0], face[:, 3] - face[:, 0]), axis=1)
    assert area.sum() == pytest.approx(0.01) and face[..., 2] == pytest.approx(0.03)
    assert len(groups["volume_groups"]["all"]) == 8


def test_histories(run: Path) -> None:
    """The audit closes, gravity has done its work, and one of several bodies can be taken out."""
    audit, units = READ["read_history"](run / "coupled_audit.csv")
    assert units["solid_kinetic"] == "J" and audit["time"][-1] == pytest.approx(END)
    assert len(audit["time"]) == round(END / EXCHANGE)
    momentum = -GRAVITY * END  # of 1 kg; the grains below bear next to nothing so early
    assert audit["momentum_z"][-1] == pytest.approx(momentum, rel=0.05)
    table, _ = READ["read_history"](run / "grains_surfaces.csv")
    floor = READ["of_body"](table, "surface", 1.0)
    assert floor["time"].tolist() == pytest.approx([0.0, 1e-3, 2e-3, 3e-3, 4e-3])
    assert floor["force_z"][-1] < 0.0


def test_fields(run: Path) -> None:
    """Fields of grains, surfaces, solid and grid have the steps and values of the run."""
    _, steps = READ["read_fields"](run / "grains.h5")
    assert [step["time"] for step in steps] == pytest.approx([0.0, 2e-3, 4e-3])
    assert np.array_equal(steps[0]["grains/x"], PLACES) and len(steps[0]["surfaces/triangles"]) == 1
    for step in verification.field_steps(run / "grains.h5"):
        mine = steps.pop(0)
        assert all(np.array_equal(mine[f"grains/{k}"], v) for k, v in step.grains.items())
    nodes, solid = READ["read_fields"](run / "solid.h5")
    fall = -0.5 * GRAVITY * END**2
    assert len(nodes["x"]) == 27 and solid[-1]["u"][:, 2] == pytest.approx(fall, rel=0.05)
    grid, maps = READ["read_fields"](run / "grains_grid_map.h5")
    assert grid["hex8"].shape == (32, 8) and maps[-1]["density"].shape == (32,)


def test_summaries_logs_manifests(run: Path) -> None:
    """Summary and log say how the run ended, the manifest names files that are there."""
    facts = READ["read_summary"](run / "coupled_summary.json")
    assert facts["exit_code"] == 0 and facts["errors"] == []
    program, end = READ["read_end"](run / "coupled.log")
    assert program == "talus-couple" and end.startswith("finished, exit 0")
    time, step, parts = READ["read_manifest"](run / "coupled.manifest")
    assert (time, step) == (pytest.approx(END), 20) and set(parts) == {"grains", "solid", "couple"}
    assert all((run / name).exists() for _, name in parts.values())


def test_facts_of_a_tile(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A tile tells its stress, and the friction it was made with."""
    facts = READ["read_facts"](sphere_tile(tmp_path_factory), "tile")
    assert facts["making_friction"] == 0.2
    assert np.trace(facts["stress"]) / 3.0 == pytest.approx(STRESS, rel=0.02)


def test_overlap_and_weights(run: Path) -> None:
    """Weights of a lattice lie between 0 and 1, one for each contact and each point."""
    sys.path.insert(0, str(ROOT / "verification/couple"))
    import overlap_cell as cell

    region = cell.slab(2, 2, 4, 1, 2)
    pack, h = cell.lattice("cubic", region.shape, np.array([0.31, 0.23, 0.17]), 0)
    overlap = cell.Overlap(pack, np.full(3, h), region, False, pack.moduli())
    overlap.write(run / "o.h5", "ramp")
    given, facts = READ["read_overlap"](run / "o.h5")
    subprocess.run([BIN / "talus-couple", "o.h5", "--weights"], cwd=run, check=True,
                   capture_output=True, timeout=60)  # fmt: skip
    made, _ = READ["read_overlap"](run / "o_weights.h5")
    assert facts["d_max"] > 0.0
    assert made["w"].shape == (len(given["contacts/pair"]),)
    assert made["beta"].shape == (len(given["points/element"]),)
    assert made["w"].min() >= 0.0 and made["w"].max() <= 1.0
