"""Every kind of element through the chain: node order of gmsh, mesh.h5, VTU; volumes; groups."""

import json
from pathlib import Path

import gmsh
import h5py
import meshio
import numpy as np
import pytest

from talus import elements
from talus import mesh as meshes
from talus.cli import main
from talus.faults import FaultError
from talus.fields import convert_to_vtu
from talus.gmsh_file import from_gmsh
from talus.orders import converted
from talus.surface import check_hanging

LOWER, UPPER = np.array([0.0, -1.0, 2.0]), np.array([1.0, 1.0, 3.5])
VOLUME = 3.0


def box(kind: str, cells: tuple[int, int, int] = (2, 3, 2)) -> meshes.Mesh:
    """A box of elements of a kind."""
    return converted(meshes.box(LOWER, UPPER, cells), kind)


def volume(mesh: meshes.Mesh) -> float:
    """Volume by the quadrature of every kind [m3]."""
    return sum(elements.volumes(k, mesh.x[rows]).sum() for k, rows in mesh.cells.items())


def bent(mesh: meshes.Mesh) -> meshes.Mesh:
    """The same mesh with smoothly moved nodes, so that no two directions look alike."""
    x, y, z = mesh.x.T
    moved = np.column_stack([x + 0.05 * y * z, y - 0.04 * x * z, z + 0.03 * x * y + 0.02 * x * x])
    return meshes.Mesh(moved, mesh.cells, mesh.volumes, mesh.facets, mesh.nodes)


@pytest.mark.parametrize("kind", elements.KINDS)
def test_reference(kind: str) -> None:
    """Faces point outward, close and enclose the volume; the shape functions fit their nodes."""
    x = elements.reference_nodes(kind)
    assert x.shape == (elements.NODES[kind], 3)
    wanted = {8: 8.0, 4: 1.0 / 6.0, 6: 1.0}[elements.CORNERS[kind]]
    assert elements.volumes(kind, x[None])[0] == pytest.approx(wanted, rel=1e-14)
    slope = elements.gradients(kind, np.array([[0.2, 0.1, 0.3]]))[0]
    assert np.abs(slope.sum(axis=0)).max() < 1e-13
    assert np.abs(x.T @ slope - np.eye(3)).max() < 1e-13
    total = np.zeros(3)
    for face in elements.faces(kind):
        name = elements.FACET_OF[len(face)]
        p = x[list(face[: elements.CORNERS[name]])]
        areas = 0.5 * np.cross(p[1] - p[0], p[2] - p[0])
        if len(p) == 4:
            areas = areas + 0.5 * np.cross(p[2] - p[0], p[3] - p[0])
        assert areas @ (p.mean(axis=0) - x.mean(axis=0)) > 0.0
        total += areas
    assert np.abs(total).max() < 1e-14


@pytest.mark.parametrize("kind", elements.KINDS)
def test_order_of_gmsh(kind: str) -> None:
    """The tables turn gmsh's own local coordinates into our reference nodes."""
    gmsh.initialize(interruptible=False)
    try:
        _, dim, _, count, local, _ = gmsh.model.mesh.getElementProperties(elements.GMSH_TYPE[kind])
    finally:
        gmsh.finalize()
    assert (dim, count) == (3, elements.NODES[kind])
    order = elements.FROM_GMSH.get(kind, list(range(count)))
    assert np.reshape(local, (count, 3))[order] == pytest.approx(elements.reference_nodes(kind))


@pytest.mark.parametrize("kind", elements.KINDS)
def test_round_trip(tmp_path: Path, kind: str) -> None:
    """Box -> gmsh file -> mesh.h5: the same elements, volumes, facets and owners."""
    made = bent(box(kind))
    check_hanging(made)
    blocks = [(elements.MESHIO[kind], made.cells[kind])]
    tags = [np.ones(made.count, int)]
    for part, rows in meshes.facet_parts(made.facets["x1"]).items():
        blocks.append((elements.MESHIO[part], np.asarray(rows)))
        tags.append(np.full(len(rows), 2))
    out = meshio.Mesh(
        made.x, blocks, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"body": np.array([1, 3]), "end": np.array([2, 2])},
    )  # fmt: skip
    meshio.write(tmp_path / "box.msh", out, file_format="gmsh22", binary=False)
    assert main(["mesh", "convert", str(tmp_path / "box.msh"), "-o", str(tmp_path / "box.h5")]) == 0
    again = meshes.read_mesh(tmp_path / "box.h5")
    assert np.array_equal(again.cells[kind], made.cells[kind])
    assert again.x == pytest.approx(made.x, rel=1e-14)
    assert volume(again) == pytest.approx(volume(made), rel=1e-13)
    assert again.volumes["body"].tolist() == list(range(made.count))
    assert meshes.facet_count(again.facets["end"]) == meshes.facet_count(made.facets["x1"])
    with h5py.File(tmp_path / "box.h5") as file:
        assert int(file.attrs["version"]) == (1 if kind == "hex8" else 2)
        owners = file["facet_groups/end/cell"][...]
        name = next(k for k in elements.FACETS if k in file["facet_groups/end"])
        facets = file[f"facet_groups/end/{name}"][...]
    for owner, facet in zip(owners, facets, strict=True):
        assert set(facet) <= set(again.cells[kind][owner])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", ["tet", "hex", "incomplete", "wedge"])
def test_gmsh_meshes(tmp_path: Path, shape: str, order: int) -> None:
    """What gmsh itself makes comes out with the right kind, volume and facets."""
    if (shape, order) == ("incomplete", 1):
        pytest.skip("first order has no incomplete elements")
    kinds = {"tet": ("tet4", "tet10"), "hex": ("hex8", "hex27"), "incomplete": ("hex8", "hex20"),
             "wedge": ("wedge6", "")}  # fmt: skip
    path = tmp_path / "made.msh"
    gmsh_box(path, shape, order)
    kind = kinds[shape][order - 1]
    if not kind:
        with pytest.raises(FaultError, match="E525"):
            from_gmsh(path)
        return
    mesh = from_gmsh(path)
    assert list(mesh.cells) == [kind]
    assert volume(mesh) == pytest.approx(VOLUME, rel=1e-12)
    check_hanging(mesh)
    meshes.write_mesh(tmp_path / "made.h5", mesh)
    top = meshes.facet_parts(meshes.read_mesh(tmp_path / "made.h5").facets["top"])
    for rows in top.values():
        assert np.all(mesh.x[rows][:, :, 2] == pytest.approx(UPPER[2]))


def gmsh_box(path: Path, shape: str, order: int) -> None:
    """Write an extruded box by gmsh."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(shape == "incomplete"))
        geo = gmsh.model.geo
        corners = [(0, -1), (1, -1), (1, 1), (0, 1)]
        points = [geo.addPoint(x, y, LOWER[2], 0.6) for x, y in corners]
        lines = [geo.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
        base = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        if shape in ("hex", "incomplete"):
            geo.mesh.setTransfiniteSurface(base)
            geo.mesh.setRecombine(2, base)
        layers = [] if shape == "tet" else [2]
        swept = geo.extrude([(2, base)], 0, 0, UPPER[2] - LOWER[2], layers, [], shape != "tet")
        geo.synchronize()
        gmsh.model.addPhysicalGroup(3, [swept[1][1]], name="body")
        gmsh.model.addPhysicalGroup(2, [swept[0][1]], name="top")
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


@pytest.mark.parametrize("kind", elements.KINDS)
def test_vtk_agrees(tmp_path: Path, kind: str) -> None:
    """VTK finds the same volumes and fields in the VTU series, all elements the right way round."""
    pyvista = pytest.importorskip("pyvista")
    mesh = bent(box(kind))
    path = tmp_path / "solid.h5"
    with h5py.File(path, "w") as file:
        file["mesh/x"] = mesh.x
        file[f"mesh/{kind}"] = mesh.cells[kind].astype(np.int32)
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.5
        step["u"] = np.column_stack([mesh.x[:, 0] ** 2, mesh.x[:, 1], mesh.x[:, 2]])
        step["stress"] = np.arange(6.0 * mesh.count).reshape(-1, 6)
    written = convert_to_vtu(path, tmp_path / "vtu")
    grid = pyvista.read(written[0])
    assert np.array_equal(grid.cells_dict[elements.VTK[kind]], mesh.cells[kind])
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert (sizes > 0.0).all()
    # VTK cuts curved elements into straight ones: exact only for straight elements
    straight = elements.CORNERS[kind] == elements.NODES[kind] and kind.startswith("tet")
    wanted = elements.volumes(kind, mesh.x[mesh.cells[kind]])
    assert sizes == pytest.approx(wanted, rel=1e-12 if straight else 0.03)
    assert np.array_equal(grid.cell_data["stress"][:, 5], 5.0 + 6.0 * np.arange(mesh.count))


@pytest.mark.parametrize("kind", elements.KINDS)
def test_generators(tmp_path: Path, capsys: pytest.CaptureFixture, kind: str) -> None:
    """The box and the block have the right volumes and areas in every kind."""
    path = tmp_path / "made.h5"
    sizes = ["--lower", "0", "-1", "2", "--upper", "1", "1", "3.5", "--cells", "2", "3", "2"]
    assert main(["mesh", "box", *sizes, "--kind", kind, "--json", "-o", str(path)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert list(facts["elements"]) == [kind]
    mesh = meshes.read_mesh(path)
    assert volume(mesh) == pytest.approx(VOLUME, rel=1e-13)
    assert mesh.x[mesh.nodes["z1"], 2] == pytest.approx(UPPER[2])
    on = np.flatnonzero(np.isclose(mesh.x[:, 2], UPPER[2]))
    assert np.array_equal(np.sort(mesh.nodes["z1"]), on)
    assert main(["mesh", "block", "--size", "20e-3", "--kind", kind, "-o", str(path)]) == 0
    mesh = meshes.read_mesh(path)
    assert volume(mesh) == pytest.approx(0.12**2 * 0.126 - 0.04**2 * 0.086, rel=1e-12)
    assert set(mesh.facets) == {"hole", "outer", "top"}
    for name, area in (("hole", 0.04**2 + 4 * 0.04 * 0.086), ("top", 0.12**2 - 0.04**2)):
        assert surface(mesh, name) == pytest.approx(area, rel=1e-12), name


def surface(mesh: meshes.Mesh, name: str) -> float:
    """Area of a facet group with straight edges [m2]."""
    total = 0.0
    for kind, rows in meshes.facet_parts(mesh.facets[name]).items():
        p = mesh.x[rows[:, : elements.CORNERS[kind]]]
        total += 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
        if p.shape[1] == 4:
            second = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])
            total += 0.5 * np.linalg.norm(second, axis=1).sum()
    return total


def test_mixed_kinds(tmp_path: Path) -> None:
    """Hexahedra and wedges in one mesh: ids run on over the kinds, facets of both kinds."""
    whole = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
    left, right = whole.hex8
    wedges = right[[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    top = {"quad4": whole.hex8[[0]][:, [4, 5, 6, 7]], "tri3": wedges[:, [3, 4, 5]]}
    mesh = meshes.Mesh(
        whole.x, {"wedge6": wedges, "hex8": left[None]}, {"all": np.arange(3)}, {"top": top}
    )
    check_hanging(mesh)
    meshes.write_mesh(tmp_path / "mixed.h5", mesh)
    again = meshes.read_mesh(tmp_path / "mixed.h5")
    assert list(again.cells) == ["hex8", "wedge6"]
    assert volume(again) == pytest.approx(2.0)
    assert {k: len(v) for k, v in again.facets["top"].items()} == {"quad4": 1, "tri3": 2}
    with h5py.File(tmp_path / "mixed.h5") as file:
        assert file["facet_groups/top/cell"][...].tolist() == [0, 1, 2]


def test_orders_that_do_not_nest() -> None:
    """Neighbours of different order, and middle nodes twice, are refused."""
    whole = meshes.box(np.zeros(3), np.array([2.0, 1.0, 1.0]), (2, 1, 1))
    higher = converted(whole, "hex20")
    x = higher.x
    second = meshes.Mesh(x, {"hex8": whole.hex8[[1]], "hex20": higher.cells["hex20"][[0]]})
    with pytest.raises(FaultError, match="E528"):
        check_hanging(second)
    doubled = higher.cells["hex20"].copy()
    common = np.intersect1d(*doubled[:, 8:])
    row = np.flatnonzero(np.isin(doubled[1], common[:1]))[0]
    x = np.vstack([x, x[doubled[1, row]]])
    doubled[1, row] = len(x) - 1
    with pytest.raises(FaultError, match="E528"):
        check_hanging(meshes.Mesh(x, {"hex20": doubled}))


def test_bent_too_far() -> None:
    """A middle node beyond the opposite side turns a quadrature point inside out."""
    mesh = box("tet10", (1, 1, 1))
    mesh.x[mesh.cells["tet10"][0, 4]] += 0.9 * (UPPER - LOWER)
    with pytest.raises(FaultError, match="E522"):
        meshes.check_mesh(mesh)
