"""Polyhedra in the view: their fields from the rows of their features, and their colours."""

import io
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest
from browser import working  # noqa: F401
from browser_page import BrowserPage
from test_polyhedra import cubes
from test_view import blobs_of

from talus import polyhedron_view, view
from talus.forms import net_triangles


def run(path: Path) -> Path:
    """Write a sphere and two cubes of edges of 1: at rest, and moving along y at 3 m/s."""
    grains, clumps, _ = cubes()
    n = len(grains["id"])
    grains |= {
        "kind": np.zeros(n, int), "quat": np.tile([1.0, 0, 0, 0], (n, 1)),
        "v": np.repeat([[0.0, 0, 0], [0, 0, 0], [0, 3.0, 0]], [1, 26, 26], axis=0),
        "force": np.repeat([[2.0, 0, 0], [0, 0.1, 0], [0, 0, 0.2]], [1, 26, 26], axis=0),
        "coordination": np.repeat([5, 1, 2], [1, 26, 26]),
    }  # fmt: skip
    with h5py.File(path, "w") as file:
        for k in range(2):
            step = file.create_group(f"steps/{k:06d}")
            step.attrs["time"] = 0.1 * k
            for name, data in grains.items():
                moved = k * np.repeat([0.0, 0.0, 0.3], [1, 26, 26])[:, None] * [0, 1, 0]
                step[f"grains/{name}"] = data + moved if name == "x" else data
            for name, data in clumps.items():
                step[f"clumps/{name}"] = data
    return path


def test_fields(tmp_path: Path) -> None:
    """A cube has the sum of its forces and contacts, the speed and displacement of its corners."""
    view.write(run(tmp_path / "g.h5"), None, tmp_path / "view.html", 5, "cubes")
    page, facts = blobs_of((tmp_path / "view.html").read_text())
    assert [f["count"] for f in facts["frames"]] == [3, 3]
    assert [f["bodies"] for f in facts["frames"]] == [2, 2]
    assert [f["triangles"] for f in facts["frames"]] == [0, 0]
    assert page.get("bodies1", "u4").tolist() == [1, 2]
    limits = {f["name"]: f for f in facts["fields"]}
    radius = cubes()[2]
    ball = np.cbrt(0.75 / np.pi)  # of the volume of a cube of edges of 1
    expected = {
        "v": [0.0, 0.0, 3.0], "force": [2.0, 2.6, 5.2], "coordination": [5.0, 26.0, 52.0],
        "displacement": [0.0, 0.0, 0.3], "size": [radius, ball, ball],
    }  # fmt: skip
    for name, values in expected.items():
        low, high = limits[name]["low"], limits[name]["high"]
        found = low + (high - low) * page.get(f"g.{name}1", "u1") / 255.0
        # a cube is drawn by a net, rounded: its volume is up to a tenth less
        assert np.abs(found - values).max() <= (0.04 * ball if name == "size" else high / 500.0)


def test_sums_and_means() -> None:
    """Forces add up over all rows of a body; of other fields its vertices give the mean."""
    grains, clumps, _ = cubes()
    polyhedron_view.mark_vertices(grains, clumps)
    values = np.arange(53.0)
    total = polyhedron_view.of_bodies(grains, "force", values)
    assert total.tolist() == [0.0, sum(range(1, 27)), sum(range(27, 53))]
    vertices = polyhedron_view.of_bodies(grains, "v", np.stack([values, -values], axis=1))
    assert vertices.tolist() == [[0.0, 0.0], [4.5, -4.5], [30.5, -30.5]]
    del grains["vertices"]
    assert polyhedron_view.of_bodies(grains, "v", values) is values


def test_ball_radii() -> None:
    """The net of a ball has the radius of the ball, nearly; twice the size twice the radius."""
    normals, triangles = net_triangles(30)
    points = normals / np.linalg.norm(normals, axis=1)[:, None]
    radii = polyhedron_view.ball_radii(np.stack([points, 2.0 * points + 5.0]), triangles)
    assert radii == pytest.approx([1.0, 2.0], rel=2.0e-3)


def share_of(picture: bytes, colour: tuple[float, float, float]) -> float:
    """Return the share of the picture that has a colour, in light or shade, of its middle."""
    image = matplotlib.image.imread(io.BytesIO(picture), format="png")[..., :3]
    image = image[:, 260:1120].astype(float)
    away = image / np.maximum(image.max(axis=-1, keepdims=True), 1e-6)
    return float((np.abs(away - np.array(colour) / max(colour)).max(axis=-1) < 0.03).mean())


def test_colours(tmp_path: Path, browser: None) -> None:
    """A browser paints the cube at rest dark, the fast one yellow; by the role both alike."""
    view.write(run(tmp_path / "g.h5"), None, tmp_path / "view.html", 5, "cubes")
    slow, fast = (0.267, 0.005, 0.329), (0.993, 0.906, 0.144)
    address = (tmp_path / "view.html").as_uri()
    idle = "!now.moving && !now.job && !now.asked"
    with BrowserPage(address + "#colour=g.v", tmp_path) as page:
        page.wait(idle)
        by_speed = page.picture()
        page.value("el('colour').value = 'role'; el('colour').oninput()")
        free = page.value("rgb(facts.roles.find((role) => role[1] === 'free')[2])")
        page.wait(idle)
        page.value("new Promise((d) => requestAnimationFrame(() => requestAnimationFrame(d)))")
        by_role = page.picture()
        page.value("parts.free.checked = false; redraw()")
        page.wait(idle)
        page.value("new Promise((d) => requestAnimationFrame(() => requestAnimationFrame(d)))")
        hidden = page.picture()
    assert share_of(by_speed, slow) > 0.003 and share_of(by_speed, fast) > 0.003
    assert share_of(by_speed, free) < 0.001  # of 620 000 pixels
    assert share_of(by_role, free) > 0.006
    assert share_of(by_role, fast) < 0.001
    assert share_of(hidden, free) < 0.001
