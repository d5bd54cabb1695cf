"""Meshes: the block of the benchmark, boxes, gmsh files, and what is refused."""

import json
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from talus import mesh as meshes
from talus.block import Block, build_block
from talus.cli import main
from talus.faults import FaultError
from talus.gmsh_file import from_gmsh
from talus.surface import check_hanging


def volume(mesh: meshes.Mesh) -> float:
    """Volume of straight hexahedra (parallelepipeds) [m3]: mean of the corner Jacobians."""
    return float(meshes.corner_volumes(mesh.x, mesh.hex8).mean(axis=1).sum())


def vector_areas(x: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Area vectors of quadrangles (k, 3) [m2]: half the cross product of the diagonals."""
    p = x[quads]
    return 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])


def area(x: np.ndarray, quads: np.ndarray) -> float:
    """Area of plane quadrangles [m2]."""
    return float(np.linalg.norm(vector_areas(x, quads), axis=1).sum())


def test_block(tmp_path: Path) -> None:
    """Volume = outer box - hole; areas of hole, top and outer are those of the boxes."""
    size = Block(size=12.0e-3)
    build_block(tmp_path / "block.msh", size)
    meshes.write_mesh(tmp_path / "block.h5", from_gmsh(tmp_path / "block.msh"))
    mesh = meshes.read_mesh(tmp_path / "block.h5")
    a, b, depth = 2 * size.outer, 2 * size.hole, size.top - size.bottom
    assert volume(mesh) == pytest.approx(a**2 * (depth + size.floor) - b**2 * depth, rel=1e-12)
    wanted = {
        "hole": b**2 + 4 * b * depth,
        "top": a**2 - b**2,
        "outer": a**2 + 4 * a * (depth + size.floor),
    }
    for name, value in wanted.items():
        assert area(mesh.x, mesh.facets[name]) == pytest.approx(value, rel=1e-12), name
    assert list(mesh.volumes) == ["block"]
    assert len(mesh.volumes["block"]) == len(mesh.hex8)
    # normals leave the solid: the closed surface sums to zero, those of the hole point inwards
    total = sum(vector_areas(mesh.x, quads).sum(axis=0) for quads in mesh.facets.values())
    assert np.abs(total).max() < 1e-15
    hole = mesh.facets["hole"]
    middle = mesh.x[hole].mean(axis=1) - np.array([0.0, 0.0, 0.5 * (size.top + size.bottom)])
    assert (np.einsum("ki,ki->k", vector_areas(mesh.x, hole), middle) < 0.0).all()


def test_box(tmp_path: Path) -> None:
    """A box has the right counts, groups on its six faces and elements with positive volume."""
    mesh = meshes.box(np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 3.0]), (2, 3, 4))
    assert (len(mesh.x), len(mesh.hex8)) == (3 * 4 * 5, 24)
    assert volume(mesh) == pytest.approx(6.0)
    assert {name: len(q) for name, q in mesh.facets.items()} == {
        "x0": 12, "x1": 12, "y0": 8, "y1": 8, "z0": 6, "z1": 6,
    }  # fmt: skip
    assert area(mesh.x, mesh.facets["z1"]) == pytest.approx(2.0)
    assert (mesh.x[mesh.nodes["y1"], 1] == 2.0).all()
    meshes.write_mesh(tmp_path / "box.h5", mesh)
    again = meshes.read_mesh(tmp_path / "box.h5")
    assert np.array_equal(again.x, mesh.x)
    assert np.array_equal(again.hex8, mesh.hex8)
    with h5py.File(tmp_path / "box.h5") as file:
        cells = file["facet_groups/x0/cell"][...]
        owners = mesh.hex8[cells]
        assert all(np.isin(q, o).all() for q, o in zip(mesh.facets["x0"], owners, strict=True))


def gmsh_cube(path: Path, facet: list[int]) -> None:
    """Write one cube with the physical groups 'solid' and 'face', as gmsh would."""
    x = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        float,
    )
    tags = [np.array([1]), np.array([2])]
    made = meshio.Mesh(
        np.vstack([x, [[9.0, 9.0, 9.0]]]),
        [("hexahedron", np.arange(8)[None]), ("quad", np.array([facet]))],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"solid": np.array([1, 3]), "face": np.array([2, 2])},
    )
    meshio.write(path, made, file_format="gmsh22", binary=False)


@pytest.mark.parametrize("facet", [[4, 5, 6, 7], [7, 6, 5, 4]])
def test_gmsh_facets_are_turned_outwards(tmp_path: Path, facet: list[int]) -> None:
    """Whatever the order in the gmsh file, normals of written facets leave the solid."""
    gmsh_cube(tmp_path / "cube.msh", facet)
    meshes.write_mesh(tmp_path / "cube.h5", from_gmsh(tmp_path / "cube.msh"))
    mesh = meshes.read_mesh(tmp_path / "cube.h5")
    assert len(mesh.x) == 8  # the node without element is left out
    assert vector_areas(mesh.x, mesh.facets["face"])[0].tolist() == [0.0, 0.0, 1.0]
    assert mesh.volumes["solid"].tolist() == [0]


def test_bad_meshes_are_refused(tmp_path: Path) -> None:
    """Inside-out elements, NaN, unused nodes and inner facets have their own faults."""
    path = tmp_path / "bad.h5"
    good = meshes.box(np.zeros(3), np.ones(3), (2, 1, 1))

    def code_of(mesh: meshes.Mesh) -> str:
        with pytest.raises(FaultError) as fault:
            meshes.write_mesh(path, mesh)
        return fault.value.code

    inside_out = good.hex8.copy()
    inside_out[1] = inside_out[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    assert code_of(meshes.Mesh(good.x, inside_out)) == "E522"
    with pytest.raises(FaultError, match="element 2"):
        meshes.check_mesh(meshes.Mesh(good.x, inside_out))
    nan = good.x.copy()
    nan[3, 1] = np.nan
    assert code_of(meshes.Mesh(nan, good.hex8)) == "E521"
    assert code_of(meshes.Mesh(np.vstack([good.x, [[5.0, 5.0, 5.0]]]), good.hex8)) == "E523"
    inner = np.flatnonzero(np.isclose(good.x[:, 0], 0.5))[[0, 1, 3, 2]]
    assert code_of(meshes.Mesh(good.x, good.hex8, facets={"mid": inner[None]})) == "E524"
    assert not path.exists()


def two_boxes(shift: np.ndarray, cells: tuple[int, int, int]) -> meshes.Mesh:
    """A box of one element and another one at `shift`, without common nodes."""
    one = meshes.box(np.zeros(3), np.ones(3), (1, 1, 1))
    two = meshes.box(shift, shift + 1.0, cells)
    return meshes.Mesh(np.vstack([one.x, two.x]), np.vstack([one.hex8, two.hex8 + 8]))


def test_hanging_nodes() -> None:
    """Nodes on a face, edge or corner of a stranger are found; parts that stand apart pass."""
    for shift, cells in (
        ([1.0, 0.0, 0.0], (1, 1, 1)),  # doubled nodes
        ([1.0, 0.0, 0.0], (1, 2, 2)),  # finer on one side
        ([1.0, 0.3, 0.2], (1, 1, 1)),  # a corner inside a face
        ([1.0, 0.5, 1.0], (1, 1, 1)),  # a corner on an edge
    ):
        with pytest.raises(FaultError, match="E527"):
            check_hanging(two_boxes(np.array(shift), cells))
    check_hanging(two_boxes(np.array([1.01, 0.0, 0.0]), (1, 2, 2)))
    check_hanging(meshes.box(np.zeros(3), np.array([1.0, 2.0, 9.0]), (4, 3, 5)))


def test_block_by_words(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """`coarse` is the default; `fine` has more elements; both are without hanging nodes."""
    counts = []
    for size in ("coarse", "fine"):
        path = str(tmp_path / "block.h5")
        assert main(["mesh", "block", "--size", size, "--json", "-o", path]) == 0
        facts = json.loads(capsys.readouterr().out)
        counts.append(facts["elements"]["hex8"])
        assert set(facts["groups"]["facets"]) == {"hole", "outer", "top"}
        assert list(facts["groups"]["volumes"]) == ["block"]
    assert counts[1] > 2 * counts[0]
