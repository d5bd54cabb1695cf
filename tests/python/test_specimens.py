"""Element tests: boxes found by their forces, strains, stresses, angles; figures and the report."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import boundary_plots, gallery, histories, inertia, reports, specimens
from talus.cli import main
from talus.faults import FaultError

HEAD = "time [s],wall [-],x [m],y [m],z [m],force_x [N],force_y [N],force_z [N],work [J]"
TIMES = np.linspace(0.0, 1.0, 101)


def write_walls(path: Path, order: tuple[int, ...] = (4, 0, 2, 1, 3, 5)) -> None:
    """Write a box 1 x 2 x 4 m in a strange order: z shortens to exp(-1), x widens by exp(0.4).

    100 Pa aside; axially 100 Pa and a hump of 200 Pa at a strain of 0.5.
    """
    lines = [HEAD]
    for t in TIMES:
        length = np.array([np.exp(0.4 * t), 2.0, 4.0 * np.exp(-t)])
        stress = np.array([100.0, 100.0, 100.0 + 200.0 * np.exp(-((t - 0.5) ** 2) / 0.02)])
        for number, wall in enumerate(order):
            axis, upper = divmod(wall, 2)
            x, force = np.full(3, 7.0), np.zeros(3)
            x[axis] = -1.0 + upper * length[axis]
            force[axis] = (2 * upper - 1) * stress[axis] * length.prod() / length[axis]
            values = [t, number + 1, *x, *force, 0.0]
            lines.append(",".join(f"{v:.17g}" for v in values))
    path.write_text("\n".join(lines) + "\n")


def write_grains(path: Path) -> None:
    """Write a field file whose free grains have a volume of 4 m3, and a fixed one."""
    edge = (3.0 / np.pi) ** (1.0 / 3.0)
    with h5py.File(path, "w") as file:
        step = file.create_group("steps/000000/grains")
        step["axes"] = np.array([[edge, edge, edge], [9.0, 9.0, 9.0]])
        step["kind"] = np.array([0, 1])


def test_curves(tmp_path: Path) -> None:
    """Lengths, stresses, strains and void ratio of a box known in closed form."""
    write_walls(tmp_path / "run_walls.csv")
    test = specimens.read_specimen(tmp_path / "run_walls.csv")
    assert test.name == "run"
    assert test.void_ratio is None
    assert test.length[0] == pytest.approx([1.0, 2.0, 4.0])
    assert test.axial_strain == pytest.approx(TIMES)
    assert test.volumetric_strain == pytest.approx(0.6 * TIMES, abs=1e-12)
    assert test.lateral == pytest.approx(np.full(101, 100.0))
    assert test.axial[50] == pytest.approx(300.0)
    assert test.pressure[50] == pytest.approx(500.0 / 3.0)
    assert test.friction_angle[50] == pytest.approx(30.0)
    side = specimens.read_specimen(tmp_path / "run_walls.csv", "x")
    assert side.axial_strain == pytest.approx(-0.4 * TIMES, abs=1e-12)
    write_grains(tmp_path / "run.h5")
    test = specimens.read_specimen(tmp_path / "run_walls.csv")
    assert test.void_ratio == pytest.approx(8.0 * np.exp(-0.6 * TIMES) / 4.0 - 1.0)


def test_angles(tmp_path: Path) -> None:
    """The peak lies at the hump, a little below its top; means want the whole range."""
    write_walls(tmp_path / "run_walls.csv")
    test = specimens.read_specimen(tmp_path / "run_walls.csv")
    angle, strain = specimens.peak_angle(test)
    assert 29.8 < angle < 30.0 + 1e-9
    assert strain == pytest.approx(0.5, abs=0.006)
    assert specimens.mean_over(test, test.lateral, 0.2, 0.4) == pytest.approx(100.0)
    assert np.isnan(specimens.mean_over(test, test.lateral, 0.8, 1.2))


def test_angles_in_words(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The figure says the angles; its table is read as a history."""
    write_walls(tmp_path / "run_walls.csv")
    table = tmp_path / "curves.csv"
    words = ["specimen", str(tmp_path / "run_walls.csv"), "-o", str(tmp_path / "a.png")]
    assert main(["plot", *words, "--csv", str(table)]) == 0
    # 100 Pa on all sides in the last fifth, but for the foot of the hump
    assert "friction angle 30.0 deg at its peak" in (said := capsys.readouterr().out)
    assert "0.1 deg in the last fifth" in said
    rows = histories.read(table)
    assert rows["axial_strain"] == pytest.approx(TIMES, abs=1e-8)
    assert rows["friction_angle"][50] == pytest.approx(30.0)


@pytest.mark.parametrize(("speed", "colour"), [(2.0e-3, "green"), (1.2e-2, "amber")])
def test_fast(speed: float, colour: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The inertial number stands beside the angle; a test that is too fast makes amber."""
    write_walls(tmp_path / "run_walls.csv")
    path = tmp_path / "run_walls.csv"
    assert np.isnan(inertia.inertial_number(path, specimens.read_test(path)))
    rows = "".join(f"{t},{v}\n" for t, v in ((0.0, 0.5), (0.5, speed), (1.0, speed)))
    (tmp_path / "run_measure_all.csv").write_text(f"time [s],inertial_number [-]\n{rows}")
    assert main(["plot", "specimen", str(path), "-o", str(tmp_path / "a.png")]) == 0
    said = capsys.readouterr().out
    assert f"inertial number {speed:.1e}" in said and ("too fast" in said) == (colour == "amber")
    text = '{"program": "talus-dem", "exit_code": 0, "health": {"verdict": "green"}}'
    (tmp_path / "run_summary.json").write_text(text)
    test = specimens.read_test(path)
    assert not inertia.sheared(test)  # 0.6 of volume a unit of axial strain: compressed
    test.length[:, 0] *= np.exp(0.2 * TIMES)
    assert inertia.sheared(test)
    light = inertia.judged(reports.runs_of(tmp_path)[0].light, (path, test))
    assert light.colour == colour and ("Shear more slowly" in " ".join(light.cure)) == (
        colour == "amber"
    )
    assert inertia.lines({"run": (path, test)})[0].startswith("run: friction angle 30.0 deg")


def test_reactions(tmp_path: Path) -> None:
    """Reactions are drawn, those that are zero left out; nothing to draw is a fault."""
    path = tmp_path / "solid_reactions.csv"
    path.write_text("time [s],foot x [N],foot z [N]\n0,0,0\n1,0,5\n")
    (axis,) = boundary_plots.reactions(path).axes
    assert [line.get_label() for line in axis.lines] == ["foot z"]
    assert axis.lines[0].get_ydata().tolist() == [0.0, 5.0]
    (tmp_path / "solid.nml").write_text(
        "&curve id = 'down', times = 0.0, 2.0, values = 0.0, 1.0 /\n"
        "&motion group = 'foot', component = 'z', curve = 'down', scale = -4.0e-3 /\n"
        "&motion group = 'head', component = 'z', curve = 'down', scale = -4.0e-3 /\n"
    )
    _, axis = boundary_plots.reactions(path).axes
    (line,) = axis.lines
    assert line.get_xdata().tolist() == [0.0, -2.0] and line.get_ydata().tolist() == [0.0, 5.0]
    path.write_text("time [s],foot x [N]\n0,0\n")
    with pytest.raises(FaultError, match="no reactions"):
        boundary_plots.reactions(path)


def test_no_box(tmp_path: Path) -> None:
    """Other numbers of walls, and walls that nobody pushed, are refused."""
    path = tmp_path / "run_walls.csv"
    write_walls(path, (0, 1, 2, 3, 4))
    with pytest.raises(FaultError, match="E558"):
        specimens.read_specimen(path)
    write_walls(path, (0, 1, 2, 3, 3, 5))
    with pytest.raises(FaultError, match="E558"):
        specimens.read_specimen(path)


def test_figures(tmp_path: Path) -> None:
    """Plot, table, folder and report show the specimen; a damaged history is named."""
    write_walls(tmp_path / "run_walls.csv")
    write_grains(tmp_path / "run.h5")
    png, table = tmp_path / "out" / "s.png", tmp_path / "out" / "s.csv"
    walls = str(tmp_path / "run_walls.csv")
    words = [
        "plot",
        "specimen",
        f"{walls}=one",
        f"{walls}=two",
        "-o",
        str(png),
        "--csv",
        str(table),
    ]
    assert main(words) == 0
    assert png.read_bytes().startswith(b"\x89PNG")
    rows = table.read_text().splitlines()
    assert len(rows) == 203
    assert rows[0].startswith("test,time [s],axial_strain [-]")
    assert float(rows[51].split(",")[-1]) == pytest.approx(30.0)
    assert main(["plot", "specimen", walls, walls]) == 1
    names = [one.name for one in gallery.exhibits(tmp_path)]
    assert names == ["run_specimen.png"]
    page = reports.build(tmp_path, "")
    assert "run_specimen.png" in page
    (tmp_path / "bed_measure_all.csv").write_text("nothing\n")
    page = reports.build(tmp_path, "")
    assert "E545" in page
    assert main(["plot", str(tmp_path)]) == 0
    assert (tmp_path / "run_specimen.png").exists()


def write_cell(path: Path, lean: float = 0.0) -> None:
    """Write a cell 1 x 2 x 4 m: z shortens to exp(-1), 100 Pa aside, 300 Pa axially."""
    nine = [a + b for a in "xyz" for b in "xyz"]
    head = ["time [s]", "volume [m3]", *(f"edge_{e}{c} [m]" for e in "abc" for c in "xyz")]
    head += [f"{n}_{k} [{u}]" for n, u in (("deform", "-"), ("rate", "1/s"), ("stress", "Pa"))
             for k in nine]  # fmt: skip
    lines = [",".join(head)]
    for t in TIMES:
        edges = np.diag([1.0, 2.0, 4.0 * np.exp(-t)])
        edges[2, 0] = lean * t
        deform = np.diag([1.0, 1.0, np.exp(-t)])
        stress = -np.diag([100.0, 100.0, 300.0])
        row = [t, np.linalg.det(edges), *edges.ravel(), *deform.ravel(), *np.zeros(9)]
        lines.append(",".join(f"{v:.17g}" for v in [*row, *stress.ravel()]))
    path.write_text("\n".join(lines) + "\n")


def test_cell(tmp_path: Path) -> None:
    """A test in a cell has the same curves; a cell that leans is no such test; folders show it."""
    write_cell(tmp_path / "run_cell.csv")
    write_grains(tmp_path / "run.h5")
    test = specimens.read_test(tmp_path / "run_cell.csv")
    assert test.name == "run"
    assert test.axial_strain == pytest.approx(TIMES)
    assert test.deviator == pytest.approx(np.full(101, 200.0))
    assert test.friction_angle == pytest.approx(np.full(101, 30.0))
    assert test.void_ratio == pytest.approx(8.0 * np.exp(-TIMES) / 4.0 - 1.0)
    png = tmp_path / "out.png"
    assert main(["plot", "specimen", str(tmp_path / "run_cell.csv"), "-o", str(png)]) == 0
    assert [one.name for one in gallery.exhibits(tmp_path)] == ["run_cell.png", "run_specimen.png"]
    write_cell(tmp_path / "run_cell.csv", 0.1)
    with pytest.raises(FaultError, match="E558"):
        specimens.read_test(tmp_path / "run_cell.csv")
