"""Rounded polyhedra: hulls, rounding, mass, packings, clouds."""

from pathlib import Path

import numpy as np
import pytest

from talus import clumps, polyhedra, polyhedron_view
from talus.cli import main
from talus.faults import FaultError
from talus.forms import net_triangles
from talus.packing import read_packing
from talus.polyhedron_mass import mass_of_rounded
from talus.sphere_fill import distance

SHAPES = {  # vertices, edges, faces, volume for the edge 1
    "cube": (8, 12, 6, 1.0),
    "tetrahedron": (4, 6, 4, np.sqrt(2.0) / 12.0),
    "octahedron": (6, 12, 8, np.sqrt(2.0) / 3.0),
    "dodecahedron": (20, 30, 12, (15.0 + 7.0 * np.sqrt(5.0)) / 4.0),
}


@pytest.mark.parametrize("name", SHAPES)
def test_bodies_by_name(name: str) -> None:
    """Bodies have their faces, equal edges and volume; rounding leaves all faces in place."""
    hull = polyhedra.hull_of(polyhedra.named_points(f"{name}:1"))
    assert (len(hull.x), len(hull.edges()), len(hull.faces)) == SHAPES[name][:3]
    assert polyhedra.volume_of(hull) == pytest.approx(SHAPES[name][3], rel=1e-12)
    lengths = [np.linalg.norm(hull.x[a] - hull.x[b]) for a, b, _, _ in hull.edges()]
    assert lengths == pytest.approx(np.ones(len(lengths)), rel=1e-12)
    template = polyhedra.rounded(hull.x, 0.15)
    core, radius = clumps.core_of(template)
    assert (len(core.x), len(core.edges()), len(core.faces)) == SHAPES[name][:3]
    assert radius == pytest.approx(0.15 * np.cbrt(0.75 * SHAPES[name][3] / np.pi))
    for face, normal in zip(hull.faces, hull.normal, strict=True):
        assert (core.x @ normal).max() + radius == pytest.approx(hull.x[face[0]] @ normal)


def test_hull_leaves_out_what_lies_inside() -> None:
    """Points inside, on faces and on edges are no vertices; faces of one plane are one."""
    rng = np.random.default_rng(4)
    box = polyhedra.named_points("brick:1x2x3")
    inside = rng.uniform(-0.5, 0.5, (50, 3)) * [1.0, 2.0, 3.0]
    on_face = inside * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.5]
    on_edge = inside * [1.0, 0.0, 0.0] + [0.0, 1.0, 1.5]
    hull = polyhedra.hull_of(np.vstack([inside, on_face, on_edge, box]))
    assert sorted(map(tuple, hull.x.tolist())) == sorted(map(tuple, box.tolist()))
    assert len(hull.faces) == 6
    cloud = rng.normal(size=(200, 3))
    hull = polyhedra.hull_of(cloud)
    heights = np.array([hull.x[f[0]] @ n for f, n in zip(hull.faces, hull.normal, strict=True)])
    assert (cloud @ hull.normal.T - heights).max() < 1e-7
    assert len(hull.x) - len(hull.edges()) + len(hull.faces) == 2


def test_mass_against_an_integral_over_directions() -> None:
    """Volume, centre and inertia of a rounded body without symmetry, by another way."""
    rng = np.random.default_rng(1)
    core = polyhedra.hull_of(rng.normal(size=(7, 3)) * [1.0, 2.0, 0.7] + [1.0, 2.0, 3.0])
    radius = 0.4
    volume, middle, inertia = mass_of_rounded(core, radius)
    z, weight = np.polynomial.legendre.leggauss(60)
    turn = np.arange(120) * 2.0 * np.pi / 120
    across = np.sqrt(1.0 - z**2)[:, None]
    u = np.stack([across * np.cos(turn), across * np.sin(turn), z[:, None] + 0 * turn], -1)
    u, weight = u.reshape(-1, 3), np.repeat(weight, 120) * 2.0 * np.pi / 120
    triangles = [
        core.x[[f[0], p, q]] for f in core.faces for p, q in zip(f[1:-1], f[2:], strict=True)
    ]
    heights = np.array([core.x[f[0]] @ n for f, n in zip(core.faces, core.normal, strict=True)])
    low, high = np.zeros(len(u)), np.full(len(u), 10.0)
    for _ in range(40):
        half = 0.5 * (low + high)
        x = middle + half[:, None] * u
        within = (x @ core.normal.T <= heights).all(axis=1)
        within |= distance(x, np.array(triangles)) < radius
        low, high = np.where(within, half, low), np.where(within, high, half)
    assert volume == pytest.approx((weight * low**3).sum() / 3.0, rel=1e-5)
    assert ((weight * low**4) @ u) / 4.0 == pytest.approx(np.zeros(3), abs=1e-4 * volume)
    second = np.einsum("n,ni,nj->ij", weight * low**5, u, u) / 5.0
    other = np.trace(second) * np.eye(3) - second
    assert inertia == pytest.approx(other, abs=1e-5 * np.trace(inertia))


def test_cloud_of_polyhedra(tmp_path: Path) -> None:
    """A cloud of two bodies keeps them apart, reads back with its corners, and is not cut."""
    pack = tmp_path / "pack.h5"
    words = ["pack", "cloud", "--polyhedra", "cube:1", "brick:2x1x1", "--rounding", "0.2"]
    words += ["--count", "40", "--spread", "0.2", "--box", "12", "12", "12", "-o", str(pack)]
    assert main(words) == 0
    made = read_packing(pack)
    assert made.count == 40 * 26
    places, radii, rows = made.clumps.members()
    assert places == pytest.approx(made.x)
    assert made.axes == pytest.approx(np.tile(radii[:, None], 3))
    corners = rows * 26 + np.arange(len(rows)) % 26 < rows * 26 + 8
    away = np.linalg.norm(made.x[corners][:, None] - made.x[corners][None], axis=2)
    other = rows[corners][:, None] != rows[corners][None]
    assert (away - radii[corners][:, None] - radii[corners][None])[other].min() > 0.0
    for template, edges in zip(made.clumps.templates, ((1, 1, 1), (2, 1, 1)), strict=True):
        core, radius = clumps.core_of(template)
        assert np.ptp(core.x, axis=0) + 2.0 * radius == pytest.approx(edges)
        assert [len(part) for part in template.corners] == [1] * 8 + [2] * 12 + [4] * 6
    with pytest.raises(FaultError, match="E681"):
        made.take(np.arange(3))


def test_hull_of_a_file(tmp_path: Path) -> None:
    """An OBJ file gives its hull."""
    body = tmp_path / "pyramid.obj"
    body.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv .5 .5 1\nv .5 .5 .2\n"
                    "f 1 3 4 2\nf 1 2 5\nf 2 4 5\nf 4 3 5\nf 3 1 6\n")  # fmt: skip
    hull = polyhedra.hull_of(polyhedra.named_points(str(body)))
    assert (len(hull.x), len(hull.faces)) == (5, 5)
    assert polyhedra.volume_of(hull) == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize(
    ("code", "word", "rounding"),
    [
        ("E685", "cubus:1", 0.1),
        ("E685", "brick:1", 0.1),
        ("E685", "cube:-1", 0.1),
        ("E685", "cube:one", 0.1),
        ("E684", "brick:1x1x0.1", 0.5),
        ("E501", "nothing.stl", 0.1),
    ],
)
def test_faults(code: str, word: str, rounding: float) -> None:
    """What is no body, or too thin for its rounding, is named."""
    with pytest.raises(FaultError, match=code):
        polyhedra.rounded(polyhedra.named_points(word), rounding)


def test_points_in_a_plane() -> None:
    """Points of a plane have no hull."""
    with pytest.raises(FaultError, match="E683"):
        polyhedra.hull_of(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [3, 2, 0]]))


def cubes() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], float]:
    """Rows of a sphere and of two cubes as a field file has them, and the radius of the edges."""
    cube = polyhedra.rounded(polyhedra.named_points("cube:1"), 0.2)
    x = [np.array([[5.0, 5.0, 5.0]]), cube.centre + [1.0, 0.0, 0.0], cube.centre - [2.0, 0.0, 0.0]]
    grains = {"x": np.vstack(x), "id": np.arange(1, 54), "axes": np.full((53, 3), cube.radius[0])}
    clumps_of_step = {"first": [2, 28], "vertices": [8, 8], "members": [26, 26]}
    return grains, clumps_of_step, float(cube.radius[0])


def test_surfaces_for_pictures() -> None:
    """A polyhedron is drawn once, by points of its surface; a cell does not tear it apart."""
    grains, rigid, radius = cubes()
    polyhedron_view.mark_vertices(grains, rigid)
    assert np.flatnonzero(polyhedron_view.drawn(grains)).tolist() == [0, 1, 27]
    assert polyhedron_view.without_features(grains)["id"].tolist() == [1, 2, 28]
    normals, _ = net_triangles(8)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    points = polyhedron_view.rounded_points(grains, np.array([1, 27]), normals)
    for body, middle in zip(points, ([1.0, 0, 0], [-2.0, 0, 0]), strict=True):
        assert np.abs(body - middle).max() == pytest.approx(0.5)
        core = np.clip(body - middle, radius - 0.5, 0.5 - radius)
        off = np.linalg.norm(body - middle - core, axis=1)
        assert off == pytest.approx(np.full(len(off), radius))
    before = grains["x"].copy()
    grains["x"] = np.mod(before, 1.3)
    polyhedron_view.join_features(grains, before)
    assert grains["x"][1] == pytest.approx(np.mod(before[1], 1.3))
    assert np.diff(grains["x"][1:27], axis=0) == pytest.approx(np.diff(before[1:27], axis=0))
