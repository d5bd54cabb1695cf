"""Clumps of spheres: templates, clouds, bodies filled with spheres, packings, a picture."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from talus import clumps, sphere_fill
from talus.cli import main
from talus.commands.pack_clump import packing_of_clumps
from talus.faults import FaultError
from talus.packing import read_packing, write_h5

BALL = 4.0 / 3.0 * np.pi
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box(edges: tuple[float, float, float]) -> np.ndarray:
    """Triangles (12, 3, 3) of a box from the origin, normals outward."""
    corners = CORNERS * edges
    return np.array([corners[list(f)] for a, b, c, d in FACES for f in ((a, b, c), (a, c, d))])


def test_mass_of_spheres_apart_is_theirs() -> None:
    """Two spheres that do not meet have the sum of volumes and Steiner's moments."""
    centre = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 3.0]])
    volume, middle, inertia = clumps.mass_of(centre, np.array([1.0, 0.5]))
    parts = BALL * np.array([1.0, 0.125])
    assert volume == pytest.approx(parts.sum(), rel=1e-4)
    assert middle == pytest.approx(parts @ centre / parts.sum(), rel=2e-4)
    exact = np.diag([0.4 * (parts * [1.0, 0.25]).sum()] * 3)
    for m, x in zip(parts, centre - middle, strict=True):
        exact += m * (x @ x * np.eye(3) - np.outer(x, x))
    assert inertia == pytest.approx(exact, abs=2e-4 * np.trace(exact))


def test_box_has_its_mass_and_is_filled() -> None:
    """A box has its volume and moments; more spheres are truer, grown ones have its volume."""
    body = box((2.0, 1.0, 1.0))
    volume, middle, inertia = sphere_fill.mass_of_body(body)
    assert volume == pytest.approx(2.0)
    assert middle == pytest.approx([1.0, 0.5, 0.5])
    assert np.diag(inertia) == pytest.approx([2.0 / 6.0, 10.0 / 12.0, 10.0 / 12.0])
    errors = []
    for count in (2, 12):
        template = sphere_fill.fill(body, count, 16)
        assert len(template.radius) == count
        low = (template.centre - template.radius[:, None]).min(axis=0)
        high = (template.centre + template.radius[:, None]).max(axis=0)
        assert (low > -1e-9).all()
        assert (high < np.array([2.0, 1.0, 1.0]) + 1e-9).all()
        errors.append(-sphere_fill.fidelity(template, body).volume)
    # the grid's points are 1/16 off the middle: two spheres of radius 7/16
    assert errors[0] == pytest.approx(1.0 - BALL * (7.0 / 16.0) ** 3, abs=1e-4)
    assert 0.0 < errors[1] < 0.7 * errors[0]
    grown = sphere_fill.fill(body, 12, 16, grow=True)
    assert abs(sphere_fill.fidelity(grown, body).volume) < 1e-3


def test_stl_and_obj_hold_the_same_body(tmp_path: Path) -> None:
    """Both forms of STL and OBJ read back to the same triangles; an open file is a fault."""
    body = box((1.0, 2.0, 3.0))
    lines = ["solid box"]
    for corners in body:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {' '.join(map(str, x))}" for x in corners] + ["endloop", "endfacet"]
    (tmp_path / "text.stl").write_text("\n".join([*lines, "endsolid box"]))
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *c.ravel(), 0) for c in body)
    (tmp_path / "binary.stl").write_bytes(bytes(80) + struct.pack("<I", len(body)) + rows)
    words = [f"v {x} {y} {z}" for x, y, z in CORNERS * (1.0, 2.0, 3.0)]
    words += [f"f {a + 1} {b + 1}/7 {c + 1}//2 {d + 1}" for a, b, c, d in FACES]
    (tmp_path / "quads.obj").write_text("\n".join(words))
    for name in ("text.stl", "binary.stl", "quads.obj"):
        assert sphere_fill.read_body(tmp_path / name) == pytest.approx(body)
    (tmp_path / "bad.stl").write_text("solid nothing")
    with pytest.raises(FaultError, match="E682"):
        sphere_fill.read_body(tmp_path / "bad.stl")
    with pytest.raises(FaultError, match="E682"):
        sphere_fill.mass_of_body(body[:, ::-1])


def test_cloud_of_two_templates(tmp_path: Path) -> None:
    """A cloud keeps clumps apart, draws templates by weight, reads back, and is not cut."""
    table = tmp_path / "templates.txt"
    pair, given = "0 0 0 1\n1.2 0 0 1\n", "mass 8 0 0 0 5 5 5 0 0 0\n0 0 0 1\n"
    table.write_text(f"# two kinds\ntemplate 3\n{pair}template 1\n{given}")
    pack = tmp_path / "pack.h5"
    words = ["pack", "cloud", "--clumps", str(table), "--count", "60", "--spread", "0.2"]
    assert main([*words, "--box", "25", "25", "25", "-o", str(pack), "--periodic"]) == 0
    made = read_packing(pack)
    kind = made.clumps.template
    assert 30 < (kind == 0).sum() < 58
    assert made.count == len(kind) + (kind == 0).sum()
    assert made.clumps.templates[1].volume == 8.0
    places, radii, rows = made.clumps.members()
    assert places == pytest.approx(made.x)
    assert made.axes == pytest.approx(np.tile(radii[:, None], 3))
    apart = made.x[:, None] - made.x[None]
    apart -= 25.0 * np.round(apart / 25.0)
    gaps = np.linalg.norm(apart, axis=2) - radii[:, None] - radii[None]
    assert gaps[rows[:, None] != rows[None]].min() > 0.0
    with pytest.raises(FaultError, match="E681"):
        made.take(np.arange(3))
    with pytest.raises(FaultError, match="E681"):
        made.join(made)


@pytest.mark.parametrize("text", ["0 0 0 -1", "0 0 1", "template 2", "template x\n0 0 0 1", ""])
def test_faults_of_templates(tmp_path: Path, text: str) -> None:
    """What is no template is named."""
    table = tmp_path / "templates.txt"
    table.write_text(text)
    with pytest.raises(FaultError, match="E680"):
        clumps.read_templates(table)


def test_clump_of_a_body(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`talus pack clump` writes a template with the body's mass that a cloud takes."""
    body = box((2.0, 1.0, 1.0)).astype("<f4")
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *c.ravel(), 0) for c in body)
    stl, table = tmp_path / "box.stl", tmp_path / "box.txt"
    stl.write_bytes(bytes(80) + struct.pack("<I", 12) + rows)
    words = ["pack", "clump", str(stl), "--spheres", "6", "--grid", "12", "--body-mass"]
    assert main([*words, "--json", "-o", str(table)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["spheres"] == 6
    assert -0.6 < facts["error of the volume"] < 0.0
    (template,) = clumps.read_templates(table)
    assert len(template.radius) == 6
    assert template.volume == pytest.approx(2.0)
    assert template.middle == pytest.approx([1.0, 0.5, 0.5])
    made = packing_of_clumps(
        [template], np.zeros(1, int), np.ones(1), np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]])
    )
    write_h5(tmp_path / "one.h5", made)
    assert read_packing(tmp_path / "one.h5").clumps.templates[0].volume == pytest.approx(2.0)
