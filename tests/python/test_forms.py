"""Forms of grains: volumes, surfaces, tables, packings with them, clouds and surfaces in VTU."""

from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from talus import forms, generate
from talus.cli import main
from talus.faults import FaultError
from talus.fields import convert_to_vtu
from talus.measure import solid_fraction
from talus.packing import make_packing, read_packing, write_packing_file

AXES = np.array([[2.0, 1.5, 1.0], [1.0, 1.0, 1.0], [1.2, 1.0, 0.8], [1.0, 0.9, 0.8]])
SKEW = np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [0.0, 0.0, 0.0], [-0.3, 0.2, 0.0]])
EXPONENT = np.array([2.0, 2.0, 4.0, 3.0])


def some_packing() -> object:
    """Four grains of four kinds, turned."""
    rng = np.random.default_rng(2)
    x = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0]])
    packing = make_packing(x, AXES, generate.random_quaternions(rng, 4))
    packing.skew, packing.exponent = SKEW.copy(), EXPONENT.copy()
    return packing


def test_surface_is_where_the_form_says() -> None:
    """Points lie on |x/a|^p + ... = 1 about the origin of the octants, normals stand on it."""
    n = forms.net(6)
    points = forms.surface_points(AXES, SKEW, EXPONENT, n)
    origin = points + forms.centres(AXES, SKEW, EXPONENT)[:, None]
    a = np.where(origin >= 0.0, (AXES * (1 + SKEW))[:, None], (AXES * (1 - SKEW))[:, None])
    level = (np.abs(origin / a) ** EXPONENT[:, None, None]).sum(axis=2)
    assert level == pytest.approx(np.ones_like(level), abs=1e-12)
    inner = np.array([forms.inside(0.999 * points[k], AXES[k], SKEW[k], EXPONENT[k])
                      for k in range(4)])  # fmt: skip
    outer = np.array([forms.inside(1.001 * points[k], AXES[k], SKEW[k], EXPONENT[k])
                      for k in range(4)])  # fmt: skip
    assert inner.all() and not outer.any()
    radii = forms.bounding_radii(forms.Forms(AXES, SKEW, EXPONENT))
    assert (np.linalg.norm(points, axis=2) <= radii[:, None] * (1 + 1e-12)).all()


def test_volume_and_centre_of_triangles() -> None:
    """The triangles of a fine net enclose the volume in closed form about the centre of mass."""
    n, cells = forms.net_triangles(60)
    points = forms.surface_points(AXES, SKEW, EXPONENT, n)
    a, b, c = (points[:, cells[:, k]] for k in range(3))
    part = (a * np.cross(b, c)).sum(axis=2) / 6.0
    assert part.sum(axis=1) == pytest.approx(forms.volumes(AXES, SKEW, EXPONENT), rel=3e-3)
    centre = (part[:, :, None] * (a + b + c) / 4.0).sum(axis=1) / part.sum(axis=1)[:, None]
    assert np.abs(centre).max() < 2e-3


def test_packing_round_trips(tmp_path: Path) -> None:
    """Both files of a packing hold the forms to the bit; ellipsoids alone keep version 1."""
    packing = some_packing()
    for name in ("p.h5", "p.txt"):
        write_packing_file(tmp_path / name, packing)
        again = read_packing(tmp_path / name)
        assert np.array_equal(again.skew, SKEW) and np.array_equal(again.exponent, EXPONENT)
        assert np.array_equal(again.quat, packing.quat)
    with h5py.File(tmp_path / "p.h5") as file:
        assert file.attrs["version"] == 2
    plain = packing.take(np.array([0]))
    write_packing_file(tmp_path / "q.h5", plain)
    with h5py.File(tmp_path / "q.h5") as file:
        assert file.attrs["version"] == 1 and "skew" not in file["grains"]
    both = plain.join(packing.take(np.array([1, 3])))
    assert both.skew[1:].tolist() == SKEW[[1, 3]].tolist()
    assert both.exponent.tolist() == [2.0, 2.0, 3.0]


def test_bad_forms_are_refused(tmp_path: Path) -> None:
    """One clear fault each, for the solver's limits and for tables."""
    packing = some_packing()
    packing.skew[1, 1] = 0.9
    with pytest.raises(FaultError, match="skew"):
        write_packing_file(tmp_path / "p.h5", packing)
    packing = some_packing()
    packing.exponent[2] = 1.9
    with pytest.raises(FaultError, match="exponent"):
        write_packing_file(tmp_path / "p.h5", packing)
    for text, words in (
        ("1 1 1 1 1\n", "5 numbers"), ("1 1 1 1 1 cube\n", "cube"), ("", "no forms"),
        ("1 1 1 1 1 -1\n", "semi-axes"), ("1 1 1 1 1 0.05\n", "nine times"),
        ("1 1 1 1 1 1 1.5\n", "exponent 1.5"), ("1 1 1 0\n", "weight 0"),
        ("1 1 1 1 1 1 2 -3\n", "weight -3"), ("1 1\n", "2 numbers"),
    ):  # fmt: skip
        (tmp_path / "t.txt").write_text(text)
        with pytest.raises(FaultError, match=words) as caught:
            forms.read_table(tmp_path / "t.txt")
        assert caught.value.code == "E507"


def test_weights_of_a_table(tmp_path: Path) -> None:
    """Forms come as often as their weights say; rows of three semi-axes are ellipsoids."""
    (tmp_path / "t.txt").write_text("3 2 1 3\n1 1 1 1 1 1 4 1\n")
    table = forms.read_table(tmp_path / "t.txt")
    assert table.axes.tolist() == [[3.0, 2.0, 1.0], [1.0, 1.0, 1.0]]
    assert table.exponent.tolist() == [2.0, 4.0] and table.weight.tolist() == [3.0, 1.0]
    assert not table.skew.any() and table.take(np.array([1])).weight.tolist() == [1.0]
    rows = table.choose(np.random.default_rng(1), 4000)
    assert (rows == 0).mean() == pytest.approx(0.75, abs=4.0 * np.sqrt(0.75 * 0.25 / 4000))
    (tmp_path / "t.txt").write_text("3 2 1\n1 1 1 7\n")
    assert forms.read_table(tmp_path / "t.txt").weight.tolist() == [1.0, 7.0]


def test_cloud_of_a_table(tmp_path: Path) -> None:
    """Grains of a table follow the sieve curve by their middle axes and keep apart."""
    (tmp_path / "t.txt").write_text("# measured\n1.2 1 .8 .9 .7 .8\n1, .9, .7, 1, .9, .7, 4\n")
    words = ["--count", "200", "--box", "0.05", "0.05", "0.05", "--gradation", "2e-3:0", "4e-3:1"]
    assert main(["pack", "cloud", *words, "--shapes", str(tmp_path / "t.txt"),
                 "-o", str(tmp_path / "c.h5")]) == 0  # fmt: skip
    packing = read_packing(tmp_path / "c.h5")
    size = 2.0 * np.median(packing.axes, axis=1)
    assert size.min() >= 2e-3 and size.max() <= 4e-3 and size.max() > 3.5e-3
    assert set(packing.exponent) == {2.0, 4.0}
    radii = forms.bounding_radii(forms.Forms(packing.axes, packing.skew, packing.exponent))
    apart = np.linalg.norm(packing.x[:, None] - packing.x[None], axis=2) + np.eye(200)
    assert (apart > 0.999 * (radii[:, None] + radii[None])).all()
    words = ["pack", "cloud", "--count", "3", "--box", "1", "1", "1", "-o", str(tmp_path / "d.h5")]
    assert main(words) == 1
    assert main([*words, "--axes", ".1", ".1", ".1", "--exponent", "12"]) == 1
    assert main([*words, "--axes", ".1", ".1", ".1", "--skew", "0", "0", ".2"]) == 0
    assert read_packing(tmp_path / "d.h5").skew[:, 2].tolist() == [0.2] * 3


def test_solid_fraction_of_forms() -> None:
    """Points inside the forms fill the share of the box that their volumes say."""
    packing = some_packing()
    low, high = np.array([-3.0, -3, -3]), np.array([7.0, 7, 3])
    share = solid_fraction(packing, low, high, 0.08)
    assert share == pytest.approx(forms.volumes(AXES, SKEW, EXPONENT).sum() / 600.0, rel=5e-3)


def test_surfaces_in_vtu(tmp_path: Path) -> None:
    """Each grain becomes closed triangles that enclose its volume."""
    packing = some_packing()
    with h5py.File(tmp_path / "f.h5", "w") as file:
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.0
        for name in ("id", "kind", "x", "quat", "axes", "skew", "exponent"):
            step[f"grains/{name}"] = getattr(packing, name)
    written = convert_to_vtu(tmp_path / "f.h5", tmp_path / "out", surfaces=True)
    mesh = meshio.read(written[0])
    a, b, c = (mesh.points[mesh.cells[0].data[:, k]] for k in range(3))
    parts = (a * np.cross(b, c)).sum(axis=1) / 6.0
    volume = [parts[mesh.cell_data["id"][0] == k].sum() for k in packing.id]
    assert volume == pytest.approx(forms.volumes(AXES, SKEW, EXPONENT), rel=0.08)
