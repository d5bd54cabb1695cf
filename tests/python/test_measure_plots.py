"""Figures of measures: components, layers of a grid, rose, contact network; options of measure."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import boundary_plots, cell_plots, measure_plots, network
from talus.checksum import edited
from talus.cli import main
from talus.faults import FaultError
from talus.fields import Cell

PNG = b"\x89PNG"


def write_pair(path: Path) -> None:
    """Write a field file: two grains that touch, one on a plane."""
    with h5py.File(path, "w") as file:
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.25
        grains = {"id": [7, 9], "kind": [0, 0], "x": [[0.0, 0, 1], [0, 0, 3]],
                  "quat": [[1.0, 0, 0, 0]] * 2, "axes": [[1.0, 1, 1]] * 2,
                  "v": [[0.0, 0, 0]] * 2}  # fmt: skip
        contacts = {"ids": [[7, 9], [-1, 7]], "point": [[0.0, 0, 2], [0, 0, 0]],
                    "normal": [[0.0, 0, 1], [0, 0, 1]],
                    "force": [[0.0, 0, 2], [0, 0, 4]]}  # fmt: skip
        for group, arrays in (("grains", grains), ("contacts", contacts)):
            for name, data in arrays.items():
                step[f"{group}/{name}"] = np.array(data)


def write_grid(path: Path) -> None:
    """Write a grid of 2 x 3 x 4 cells with density = number of the cell, xy of stress = -that."""
    places = [np.linspace(0.0, 0.1 * (k + 2), k + 3) for k in range(3)]
    z, y, x = np.meshgrid(*places[::-1], indexing="ij")
    with h5py.File(path, "w") as file:
        file["mesh/x"] = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        file["mesh/hex8"] = np.zeros((24, 8), np.int32)
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.5
        step["density"] = np.arange(24.0)
        step["fabric"] = np.zeros((24, 9))
        step["stress"] = -np.arange(24.0)[:, None] * np.eye(9)[1]


def test_components() -> None:
    """Names of fields with their columns; others are refused with what there is."""
    assert measure_plots.component("density") == ("density", None)
    assert measure_plots.component("velocity_z") == ("velocity", 2)
    assert measure_plots.component("kinetic_stress_yx") == ("kinetic_stress", 3)
    for name in ("stress_x", "density_z", "fabric_xq", "speed", ""):
        with pytest.raises(FaultError, match="E556"):
            measure_plots.component(name)


def test_slices(tmp_path: Path) -> None:
    """A layer holds the cells of its place, x fastest; places outside are refused."""
    write_grid(tmp_path / "g.h5")
    figure = measure_plots.slice_of(tmp_path / "g.h5", "density", "y", 0.15)
    drawn = figure.axes[0].collections[0].get_array().reshape(4, 2)
    assert (drawn == np.arange(24.0).reshape(4, 3, 2)[:, 1]).all()
    figure = measure_plots.slice_of(tmp_path / "g.h5", "stress_xy", "z", 0.35)
    drawn = figure.axes[0].collections[0].get_array().reshape(3, 2)
    assert (drawn == -np.arange(18.0, 24.0).reshape(3, 2)).all()
    with pytest.raises(FaultError, match="E556"):
        measure_plots.slice_of(tmp_path / "g.h5", "density", "x", 1.0)


def test_rose(tmp_path: Path) -> None:
    """One upright contact: in x-z the two bins about z; contacts on planes do not count."""
    write_pair(tmp_path / "p.h5")
    figure = measure_plots.rose(tmp_path / "p.h5")
    heights = np.array([bar.get_height() for bar in figure.axes[1].patches])
    assert np.count_nonzero(heights) == 2
    assert heights.max() == pytest.approx(measure_plots.BINS / 2)
    assert "1 contacts" in figure.get_suptitle()


def test_rose_of_a_solid(tmp_path: Path) -> None:
    """A field file without grains is a fault that the report can pass over."""
    with h5py.File(tmp_path / "solid.h5", "w") as file:
        file.create_group("steps/000000").attrs["time"] = 0.0
    with pytest.raises(FaultError, match="E5"):
        measure_plots.axes_rose(tmp_path / "solid.h5")


def test_axes_rose(tmp_path: Path) -> None:
    """A grain with its short axis turned from z to x; spheres have no axes."""
    write_pair(tmp_path / "p.h5")
    with pytest.raises(FaultError, match="E543"):
        measure_plots.axes_rose(tmp_path / "p.h5")
    with edited(tmp_path / "p.h5") as file:
        grains = file["steps/000000/grains"]
        grains["axes"][0] = [3.0, 2.0, 1.0]
        grains["quat"][0] = np.sqrt(0.5) * np.array([1.0, 0.0, 1.0, 0.0])
    figure = measure_plots.axes_rose(tmp_path / "p.h5")
    bars = {bar.get_x() + 0.5 * bar.get_width(): bar.get_height()
            for bar in figure.axes[1].patches if bar.get_height() > 0.0}  # fmt: skip
    assert np.sort(np.abs(np.cos(list(bars)))) == pytest.approx([1.0, 1.0])
    assert "1 free grains" in figure.get_suptitle()
    out = str(tmp_path / "a.png")
    assert main(["plot", "rose", str(tmp_path / "p.h5"), "--of", "axes", "-o", out]) == 0


def test_probe_figure(tmp_path: Path) -> None:
    """The diagonals of both matrices and both fits are drawn; other files are refused."""
    rows = {n: (2.0e6 * np.eye(6)[k]).tolist() for k, n in enumerate(measure_plots.SIX)}
    one = {"stiffness_Pa": rows, "bulk_Pa": 3.0e6, "shear_Pa": 1.0e6}
    path = tmp_path / "run_probe.json"
    path.write_text(json.dumps({"probed": one, "affine": one, "pressure_Pa": 1.0e3}))
    figure = measure_plots.probe(path)
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    assert heights == pytest.approx([2.0] * 6 + [3.0, 1.0] + [2.0] * 6 + [3.0, 1.0])
    assert main(["plot", str(tmp_path)]) == 0
    assert (tmp_path / "run_probe.png").read_bytes().startswith(PNG)
    path.write_text("{}")
    with pytest.raises(FaultError, match="E545"):
        measure_plots.probe(path)


def test_boundaries(tmp_path: Path) -> None:
    """A surface of one part, a penetrometer of two: force, moment and work of each."""
    head = "time [s],surface [-],part [-],x [m],y [m],z [m]"
    head += "".join(
        f",{n}_{c} [{u}]" for n, u in (("force", "N"), ("moment", "N m")) for c in "xyz"
    )
    rows = [head + ",work [J]"]
    for t in (0.0, 1.0, 2.0):
        for number, part in ((1, 1), (2, 1), (2, 2)):
            force, moment = [3.0 * t * part, 0.0, 4.0 * t * part], [0.0, t, 0.0]
            values = [t, number, part, 0.0, 0.0, 0.0, *force, *moment, -t]
            rows.append(",".join(str(v) for v in values))
    path = tmp_path / "run_surfaces.csv"
    path.write_text("\n".join(rows) + "\n")
    figure = boundary_plots.figure(path)
    assert [line.get_label() for line in figure.axes[0].lines] == [
        "surface 1", "surface 2, part 1", "surface 2, part 2"]  # fmt: skip
    assert figure.axes[0].lines[2].get_ydata() == pytest.approx([0.0, 10.0, 20.0])
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx([0.0, 1.0, 2.0])
    assert figure.axes[2].lines[0].get_ydata() == pytest.approx([0.0, -1.0, -2.0])
    assert main(["plot", str(tmp_path)]) == 0
    assert (tmp_path / "run_surfaces.png").read_bytes().startswith(PNG)
    path.rename(tmp_path / "other.csv")
    assert main(["plot", "boundary", str(tmp_path / "other.csv")]) == 1


def test_network() -> None:
    """Tubes lie on cylinders of their radius about the branch, which ends at the plane's point."""
    contacts = {"ids": np.array([[7, 9], [-1, 7]]), "point": np.array([[0.0, 0, 2], [0, 0, 0]])}
    grains = {"id": np.array([7, 9]), "x": np.array([[0.0, 0, 1], [0, 0, 3]])}
    start, end = network.ends_of(contacts, grains)
    assert (start == [[0, 0, 1], [0, 0, 0]]).all()
    assert (end == [[0, 0, 3], [0, 0, 1]]).all()
    points, quads = network.tubes(start, end, np.array([0.1, 0.3]))
    radius = np.hypot(points[:, 0], points[:, 1]).reshape(2, -1)
    assert radius == pytest.approx(np.array([[0.1], [0.3]]) * np.ones_like(radius))
    assert quads[:, 1:].min() == 0
    assert quads[:, 1:].max() == len(points) - 1


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """`talus plot rose` and `slice` write figures; --deck goes with no option of the quick look."""
    write_pair(tmp_path / "p.h5")
    write_grid(tmp_path / "g.h5")
    assert main(["plot", "rose", str(tmp_path / "p.h5"), "-o", str(tmp_path / "r.png")]) == 0
    words = ["plot", "slice", str(tmp_path / "g.h5"), "--field", "stress", "-o"]
    assert main([*words, str(tmp_path / "s.png")]) == 0
    assert (tmp_path / "r.png").read_bytes()[:4] == PNG
    assert (tmp_path / "s.png").read_bytes()[:4] == PNG
    assert main(["measure", str(tmp_path / "p.h5"), "--deck", "d.nml", "--json"]) == 1
    assert "E557" in capsys.readouterr().err


def test_periodic_cell() -> None:
    """Points fold into a slanted cell, images are the nearest, branches over a face stay short."""
    vectors = np.array([[1.0, 0.0, 0.0], [5.3, 1.0, 0.0], [0.2, 0.1, 1.0]])
    cell = Cell(vectors, np.array([0.5, 0.0, 0.0]), np.array([True, True, True]))
    rng = np.random.default_rng(3)
    x = rng.uniform(-9.0, 9.0, (50, 3))
    inside = (cell.fold(x) - cell.origin) @ np.linalg.inv(vectors)
    assert ((inside > -1e-12) & (inside < 1.0 + 1e-12)).all()
    whole = (cell.fold(x) - x) @ np.linalg.inv(vectors)
    assert np.allclose(whole, np.round(whole), atol=1e-12)
    point = x + rng.integers(-4, 5, (50, 3)) @ vectors + rng.uniform(-0.2, 0.2, (50, 3))
    assert np.abs(cell.nearest(x, point) - point).max() < 0.2001
    later = Cell(2.0 * vectors, cell.origin, cell.periodic)
    assert np.allclose(later.flow(cell, x) - cell.origin, 2.0 * (x - cell.origin))
    grains = {"id": np.array([1, 2]), "x": np.array([[0.6, 0.1, 0.1], [0.7, 0.2, 0.95]])}
    contacts = {"ids": np.array([[1, 2]]), "point": np.array([[0.55, 0.1, 0.0]])}
    start, end = network.ends_of(contacts, grains, cell)
    assert np.linalg.norm(end - start) < 0.3


def test_cell_figure(tmp_path: Path) -> None:
    """Simple shear: the path of the deviator is the shear; pressure and shear stress are drawn."""
    gamma = np.linspace(0.0, 2.0, 41)
    deform = np.tile(np.eye(3), (41, 1, 1))
    deform[:, 0, 2] = gamma
    assert cell_plots.distortion(deform) == pytest.approx(gamma)
    nine = [a + b for a in "xyz" for b in "xyz"]
    names = ["time [s]", "volume [m3]"] + [f"deform_{n} [-]" for n in nine]
    names += [f"stress_{n} [Pa]" for n in nine]
    stress = np.tile(-2.0e3 * np.eye(3), (41, 1, 1))
    stress[:, 0, 2] = stress[:, 2, 0] = 700.0 * gamma
    parts = [gamma, np.ones(41), deform.reshape(41, 9), stress.reshape(41, 9)]
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack(parts)]
    (tmp_path / "run_cell.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    left, right = cell_plots.figure(tmp_path / "run_cell.csv").axes
    pressure, shear = left.lines
    assert pressure.get_ydata() == pytest.approx(2.0)
    assert shear.get_ydata() == pytest.approx(0.7 * gamma)
    assert right.lines[0].get_ydata() == pytest.approx(0.0)
    assert (
        main(["plot", "cell", str(tmp_path / "run_cell.csv"), "-o", str(tmp_path / "c.png")]) == 0
    )
