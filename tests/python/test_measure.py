"""Measures of packings: solid fraction, gaps, coordination, fabric, comparison."""

import json
from pathlib import Path

import numpy as np
import pytest

from talus import generate, measure
from talus.cli import main
from talus.faults import FaultError
from talus.packing import FIXED, FREE, make_packing, write_h5


def test_solid_fraction_of_lattices() -> None:
    """Cells of simple and face-centred cubic spheres: pi/6 and pi sqrt(2)/6 (exact)."""
    radius = 2.5e-3
    for kind, edge, exact in (
        ("sc", 2 * radius, np.pi / 6),
        ("fcc", 2 * np.sqrt(2) * radius, np.pi * np.sqrt(2) / 6),
    ):
        packing = generate.lattice(kind, (5, 5, 5), edge, np.full(3, radius))
        # whole cells, begun off the sites; 1e-3: points that fall on either side of a surface
        lower = np.full(3, 1.1 * edge)
        found = measure.solid_fraction(packing, lower, lower + 2 * edge, edge / 83.3)
        assert found == pytest.approx(exact, abs=1e-3), kind


def test_solid_fraction_of_an_ellipsoid() -> None:
    """One turned ellipsoid in a box: 4/3 pi a b c / box; an empty box is refused."""
    axes, quat = np.array([[3.0, 2.0, 1.0]]), np.array([[0.8, 0.1, -0.5, 0.3]])
    packing = make_packing(np.zeros((1, 3)), axes, quat)
    found = measure.solid_fraction(packing, np.full(3, -4.0), np.full(3, 4.0), 0.05)
    assert found == pytest.approx(8 * np.pi / 512, rel=2e-3)
    with pytest.raises(FaultError, match="E541"):
        measure.solid_fraction(packing, np.ones(3), np.zeros(3), 0.1)


def test_gaps_of_spheres() -> None:
    """Distance of centres less both radii; the normal is the branch."""
    rng = np.random.default_rng(5)
    x, radius = rng.normal(size=(40, 3)), rng.uniform(0.2, 1.0, 40)
    packing = make_packing(
        x, np.repeat(radius[:, None], 3, 1), generate.random_quaternions(rng, 40)
    )
    pairs = np.column_stack([np.arange(0, 40, 2), np.arange(1, 40, 2)])
    gap, normal = measure.gaps(packing, pairs)
    branch = x[1::2] - x[::2]
    distance = np.linalg.norm(branch, axis=1)
    assert np.allclose(gap, distance - radius[::2] - radius[1::2], atol=1e-13)
    assert np.allclose(normal, branch / distance[:, None], atol=1e-7)


def test_gaps_of_ellipsoids() -> None:
    """Sphere beside an ellipsoid off its axes, and against the best of many directions."""
    # a sphere set at distance d from the surface point p along the normal there: the gap is d - r
    axes, p = np.array([3.0, 2.0, 1.0]), np.array([3.0, 2.0, 1.0]) / np.sqrt(3.0)
    normal = p / axes**2
    normal /= np.linalg.norm(normal)
    x = np.array([np.zeros(3), p + 0.9 * normal])
    packing = make_packing(x, np.array([axes, [0.5, 0.5, 0.5]]))
    gap, found = measure.gaps(packing, np.array([[0, 1]]))
    assert gap[0] == pytest.approx(0.4, abs=1e-12)
    assert np.allclose(found[0], normal, atol=1e-6)
    rng = np.random.default_rng(0)
    n = 120
    packing = make_packing(
        rng.uniform(0, 6, (n, 3)), rng.uniform(0.5, 3, (n, 3)), generate.random_quaternions(rng, n)
    )
    pairs = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    gap, _ = measure.gaps(packing, pairs)
    s = measure.shape_tensors(packing.axes, packing.quat)
    many = rng.normal(size=(4000, 3))
    many /= np.linalg.norm(many, axis=1)[:, None]
    for (i, j), value in zip(pairs, gap, strict=True):
        hi, hj = (np.sqrt(np.einsum("ni,ij,nj->n", many, s[k], many)) for k in (i, j))
        best = (many @ (packing.x[j] - packing.x[i]) - hi - hj).max()
        assert -1e-12 < value - best < 0.05  # never below any direction; 4000 come that near


def test_pairs_and_coordination() -> None:
    """All near pairs are found, each once; inner spheres of a simple cubic lattice touch six."""
    rng = np.random.default_rng(8)
    x, reach = rng.uniform(0, 5, (300, 3)), rng.uniform(0.1, 0.4, 300)
    pairs = measure.near_pairs(x, reach)
    i, j = np.triu_indices(300, 1)
    near = np.linalg.norm(x[i] - x[j], axis=1) <= reach[i] + reach[j]
    assert np.array_equal(pairs, np.column_stack([i[near], j[near]]))
    packing = generate.lattice("sc", (4, 4, 4), 1.0, np.full(3, 0.5001))
    number = measure.coordination(packing)
    inner = ((packing.x > 0.5) & (packing.x < 2.5)).all(axis=1)
    assert inner.sum() == 8
    assert (number[inner] == 6).all()
    assert number.min() == 3


def test_fabric() -> None:
    """Unturned grains have all short axes vertical; random ones none preferred."""
    axes = np.tile([2.5, 2.0, 1.5], (4000, 1))
    flat = measure.short_axis_fabric(make_packing(np.zeros((4000, 3)), axes))
    assert np.allclose(flat, np.diag([0.0, 0.0, 1.0]))
    quat = generate.random_quaternions(np.random.default_rng(3), 4000)
    loose = measure.short_axis_fabric(make_packing(np.zeros((4000, 3)), axes, quat))
    assert np.allclose(loose, np.eye(3) / 3, atol=0.02)  # four deviations of the mean of 4000


def test_compare(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A packing is within the limits of itself; a looser one is beyond them."""
    for name, radius in (("a", 2.5e-3), ("b", 2.4e-3)):
        packing = generate.lattice("sc", (9, 9, 9), 5e-3, np.full(3, radius))
        write_h5(tmp_path / f"{name}.h5", packing)
    a, b = str(tmp_path / "a.h5"), str(tmp_path / "b.h5")
    assert main(["compare", a, a]) == 0
    assert main(["compare", a, b]) == 1
    assert "BEYOND" in capsys.readouterr().out
    assert main(["compare", a, b, "--limits", "solid_fraction=0.2", "coordination=9"]) == 0
    assert main(["compare", a, b, "--limits", "solid=0.2"]) == 1
    assert "E551" in capsys.readouterr().err


def test_mass_median() -> None:
    """Of eight spheres of radius 1, one of 2 and one of 3 m the last has half of the volume."""
    radius = np.array([1.0] * 8 + [2.0, 3.0])
    axes = radius[:, None] * np.array([2.0, 1.0, 0.5])  # volumes as of spheres
    packing = make_packing(np.arange(30.0).reshape(10, 3), axes)
    assert measure.mass_median(packing) == 6.0
    assert measure.mass_median(packing.take(np.arange(9))) == 2.0


def test_floor_carries_a_share() -> None:
    """Half of the weight on the lowest fixed grains is a share of one half."""
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [3.0, 0.0, 1.0]])
    packing = make_packing(x, np.full((3, 3), 0.5), kind=np.array([FIXED, FREE, FIXED]))
    weight = 2650.0 * 9.81 * np.pi / 6.0
    force = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 1.0], [0.0, 0.0, -0.5]]) * weight
    assert measure.floor_share(packing, force) == pytest.approx(0.5)


def test_measure_command(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """`talus measure` gives the solid fraction of a lattice; layers too thin are refused."""
    path = str(tmp_path / "sc.h5")
    write_h5(Path(path), generate.lattice("sc", (9, 9, 9), 5e-3, np.full(3, 2.5e-3)))
    assert main(["measure", path, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    # 0.03: the bulk is no whole number of cells
    assert facts["solid fraction"] == pytest.approx(np.pi / 6, abs=0.03)
    assert facts["free grains"] == 729
    assert main(["measure", path, "--layers", "100000"]) == 1
    assert "E541" in capsys.readouterr().err
