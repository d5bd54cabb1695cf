"""Inputs and table of the speed comparison; nothing here asserts a time."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import bench_beds  # noqa: E402
import bench_calculix  # noqa: E402
import bench_grains  # noqa: E402
import bench_peers  # noqa: E402
import bench_solid  # noqa: E402
import bench_table  # noqa: E402

from talus.forms import Forms, bounding_radii, volumes  # noqa: E402


def test_constants_are_those_of_the_deck() -> None:
    """LAMMPS' constants give Talus' stiffness and damping, LIGGGHTS' restitution its damping."""
    found = bench_peers.constants()
    modulus = bench_beds.YOUNG / (2.0 * (1.0 - bench_beds.POISSON**2))  # E*
    assert found["kn"] == pytest.approx(4.0 / 3.0 * modulus)
    shear = bench_beds.YOUNG / (4.0 * (1.0 + bench_beds.POISSON) * (2.0 - bench_beds.POISSON))  # G*
    assert found["kt"] == pytest.approx(8.0 * shear)
    mass = 2.0 / 3.0 * math.pi * bench_beds.DENSITY * bench_beds.SPHERE**3
    touch = math.sqrt(0.5 * bench_beds.SPHERE * bench_peers.OVERLAP * bench_beds.SPHERE)
    wanted = 2.0 * bench_beds.DAMPING_RATIO * math.sqrt(mass * 2.0 * modulus * touch)
    assert found["gn"] * mass * touch == pytest.approx(wanted)
    wanted = 2.0 * bench_beds.DAMPING_RATIO * math.sqrt(mass * 8.0 * shear * touch)
    assert found["gt"] * mass * touch == pytest.approx(wanted)
    log = math.log(found["restitution"])
    beta = -log / math.sqrt(log**2 + math.pi**2)
    assert math.sqrt(5.0 / 6.0) * beta == pytest.approx(bench_beds.DAMPING_RATIO)


@pytest.mark.parametrize("code", sorted(bench_peers.INPUTS))
def test_inputs_hold_the_bed(code: str) -> None:
    """Step, gravity and the far walls of the deck stand in the peers' inputs."""
    bed = bench_beds.BEDS["spheres_10000"]
    text = bench_peers.INPUTS[code](bed, "bed.data", [20, 100])
    assert f"timestep {bench_beds.DT}" in text
    assert f"gravity {bench_beds.GRAVITY} vector 0 0 -1" in text
    assert f"{bed.box[0]:.9g}" in text
    assert text.endswith("run 20\nrun 100\n")
    assert "{" not in text


def test_lattice_does_not_overlap() -> None:
    """Grains start inside the box, free of one another."""
    for name in ("spheres_2000", "ellipsoids_2760"):
        bed = bench_beds.BEDS[name]
        packing = bench_beds.loose(bed)
        radius = packing.axes.max(axis=1)
        assert packing.count == bed.grains
        assert (packing.x - radius[:, None]).min() >= 0.0
        assert (packing.x[:, :2] + radius[:, None]).max() <= bed.box[0]
        some = slice(0, 400)
        distance = np.linalg.norm(packing.x[some, None] - packing.x[None, some], axis=2)
        distance[np.diag_indices(400)] = np.inf
        assert (distance > radius[some, None] + radius[None, some]).all()


@pytest.mark.parametrize("shape", ["poly_ellipsoids", "superquadrics"])
def test_shapes_are_exchanged(shape: str) -> None:
    """As many grains of the same volume fall into the same box, free of one another."""
    bed = bench_beds.BEDS[f"{shape}_2760"]
    packing = bench_beds.loose(bed)
    assert bed.box == bench_beds.BEDS[bed.beside].box
    assert packing.formed
    volume = volumes(packing.axes, packing.skew, packing.exponent)
    wanted = 4.0 / 3.0 * math.pi * math.prod(bench_beds.ELLIPSOID)
    assert volume == pytest.approx(np.full(bed.grains, wanted), rel=1e-12)
    radius = bounding_radii(Forms(packing.axes, packing.skew, packing.exponent))
    assert (packing.x - radius[:, None]).min() >= 0.0
    assert (packing.x[:, :2] + radius[:, None]).max() <= bed.box[0]
    some = slice(0, 400)
    distance = np.linalg.norm(packing.x[some, None] - packing.x[None, some], axis=2)
    distance[np.diag_indices(400)] = np.inf
    assert (distance > radius[some, None] + radius[None, some]).all()


def test_shapes_take_turns() -> None:
    """Beds of other shapes are timed in turns with their ellipsoids."""
    names = ["spheres_2000", "ellipsoids_2760", "superquadrics_20000", "poly_ellipsoids_2760"]
    assert bench_grains.together(names) == [
        ["spheres_2000"], ["ellipsoids_2760", "poly_ellipsoids_2760"], ["superquadrics_20000"],
    ]  # fmt: skip


def test_states_and_loops() -> None:
    """Rows of the peers' logs are understood; every contact is counted by both grains."""
    said = (
        "   Step Atoms KinEng c_spin c_touches\n"
        "       0    10000 5.26e-09 3.49e-09        45664\n"
        "Loop time of 0.25 on 1 procs for 50 steps with 10000 atoms\n"
        "      50    10000  6.0e-08 4.0e-08   45320\n"
        "Loop time of 1.5 on 1 procs for 50 steps with 10000 atoms, finish time Sat\n"
    )
    assert bench_peers.loops(said) == [0.25, 1.5]
    assert bench_peers.states(said)[-1] == (50, pytest.approx(1e-7), 22660.0)


def test_table(tmp_path: Path) -> None:
    """Ratios stand beside the same bed and cores, ellipsoids beside LAMMPS' spheres."""

    def timing(code: str, case: str, cores: int, *rates: float) -> bench_grains.Timing:
        return bench_grains.Timing(code, case, 10, cores, list(rates), list(rates), 20, 5.0)

    rows = bench_table.table([
        timing("talus", "spheres_10000", 1, 9.0, 6.0, 100.0),
        timing("lammps", "spheres_10000", 1, 4.0, 4.5, 5.0),
        timing("lammps", "spheres_50000", 1, 3.0),
        timing("talus", "spheres_50000", 1, 6.0),
        timing("talus", "ellipsoids_2760", 1, 2.25),
        timing("talus", "ellipsoids_2760", 2, 4.0),
        timing("talus", "superquadrics_2760", 2, 1.0, 3.0),
        timing("talus", "ellipsoids_20000", 2, 4.0),
        timing("talus", "ellipsoids_1000000", 2, 3.0),
    ])  # fmt: skip
    assert [row["ratio_to_lammps"] for row in rows] == [2.0, 1.0, 1.0, 2.0, 0.5, *[""] * 4]
    assert [row["ratio_to_ellipsoids"] for row in rows] == [*[""] * 6, 0.5, "", ""]
    assert [row["ratio_to_copied"] for row in rows] == [*[""] * 8, 0.75]
    assert rows[0]["contacts_per_s"] == 18
    head = {"machine": "test", "date": "2000-01-01", "version": "0", "repeats": 3, "load": 0.0}
    bench_table.write(tmp_path / "bench.csv", rows, head)
    again, read = bench_table.read(tmp_path / "bench.csv")
    assert read == {key: str(value) for key, value in head.items()}
    assert [float(row["grain_steps_per_s"]) for row in again] == [9, 4, 3, 6, 2, 4, 2, 4, 3]
    assert bench_table.markdown(again, read).count("\n| ") == 10
    bench_table.figure(tmp_path / "bench.png", again, read)
    assert (tmp_path / "bench.png").stat().st_size > 1000


@pytest.mark.parametrize("kind", ["hex8", "hex20"])
def test_model_of_calculix_is_the_mesh(tmp_path: Path, kind: str) -> None:
    """Nodes, elements, base and the corner of the cube stand in the model; the step names it."""
    mesh = bench_solid.write_cube(tmp_path, kind, 2)
    bench_calculix.write_model(tmp_path / "m", tmp_path / mesh, bench_solid.CONSTANTS)
    text = (tmp_path / "m").read_text()
    cells = text.split("ELSET=CUBE\n")[1].split("*NSET")[0].replace(",\n", ",").splitlines()
    assert len(cells) == 8
    assert all(len(line.split(",")) == 1 + int(kind[3:]) for line in cells)
    nodes = dict(
        (int(k), [float(v) for v in xyz])
        for k, *xyz in (line.split(",") for line in text.split("*ELEMENT")[0].splitlines()[1:])
    )
    corner = int(text.split("NSET=CORNER\n")[1].split()[0])
    assert nodes[corner] == [1.0, 1.0, 1.0]
    base = [int(line[:-1]) for line in text.split("NSET=BASE\n")[1].split("*")[0].split()]
    assert sorted(base) == [k for k, x in nodes.items() if x[2] == 0.0]
    deck = bench_calculix.static("m", bench_solid.GRAVITY, "iterative")
    load = deck.split("CUBE, GRAV, ")[1].splitlines()[0].split(", ")
    size, *way = (float(value) for value in load)
    assert [size * value for value in way] == pytest.approx(bench_solid.GRAVITY)


def test_what_calculix_prints(tmp_path: Path) -> None:
    """The corner's displacement and the step are found among other lines."""
    (tmp_path / "a.dat").write_text(
        "\n displacements (vx,vy,vz) for set CORNER and time  0.1000000E+01\n\n"
        "      9261  3.262305E-07  1.565238E-09 -2.654282E-07\n"
    )
    assert bench_calculix.corner(tmp_path / "a.dat") == [3.262305e-7, 1.565238e-9, -2.654282e-7]
    said = "initial stable time increment:6.3e-06\n SELECTED time increment:6.369308e-06\n"
    assert bench_calculix.explicit_step(said) == 6.369308e-6


def test_rows_of_solids(tmp_path: Path) -> None:
    """Rows of solids share the columns; the table of the manual shows them apart."""
    row = bench_solid.Row("talus", "static_hex8_10_direct", 1000, 1, 1000.0, [2.0], [1.0], 5.0)
    row.difference = bench_solid.difference([1.0, 0.0, 2.0], (1.0, 0.0, 2.002))
    rows = [row.as_dict(1.5)]
    head = {"machine": "test", "date": "2000-01-01", "version": "0", "repeats": 3, "load": 0.0}
    bench_table.write(tmp_path / "bench.csv", rows, head)
    again, read = bench_table.read(tmp_path / "bench.csv")
    assert float(again[0]["grain_steps_per_s"]) == 500.0
    assert again[0]["difference"] == "1.0e-03"
    assert again[0]["contacts_per_s"] == again[0]["residual"] == ""
    text = bench_table.markdown(again, read)
    assert text.count("\n| ") == 2
    assert "1.0e-03" in text
    bench_table.figure(tmp_path / "bench.png", again, read)
