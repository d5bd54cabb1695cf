"""Meshes of hexahedra: the block of the benchmark, boxes, and any gmsh file with physical groups.

A mesh is written as mesh.h5 (manual, Files): nodes from 0 in VTK order, facet normals outward.
"""

import contextlib
import io
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from talus.faults import FaultError
from talus.files import refuse, replaced

# local faces of a hexahedron, normals outward (VTK order)
FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [1, 2, 6, 5], [0, 4, 7, 3]]
)


@dataclass
class Mesh:
    """Nodes (n, 3) [m], hexahedra (m, 8), groups of elements, facets (k, 4) and nodes."""

    x: np.ndarray
    hex8: np.ndarray
    volumes: dict[str, np.ndarray] = field(default_factory=dict)
    facets: dict[str, np.ndarray] = field(default_factory=dict)
    nodes: dict[str, np.ndarray] = field(default_factory=dict)


def boundary_faces(hex8: np.ndarray) -> dict[tuple[int, ...], tuple[int, np.ndarray]]:
    """Faces that belong to one element: sorted nodes -> (element, nodes with outward normal)."""
    quads = hex8[:, FACES].reshape(-1, 4)
    keys = np.sort(quads, axis=1)
    _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
    return {tuple(int(v) for v in keys[k]): (int(k) // 6, quads[k]) for k in first[count == 1]}


def corner_volumes(x: np.ndarray, hex8: np.ndarray) -> np.ndarray:
    """Jacobian determinant at the eight corners of every element (m, 8); all must be positive."""
    edges = np.array(
        [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]]
    )
    p = x[hex8]
    d = p[:, edges] - p[:, :, None, :]
    return np.einsum("eci,eci->ec", np.cross(d[:, :, 0], d[:, :, 1]), d[:, :, 2])


def check_mesh(mesh: Mesh) -> None:
    """Raise a fault for inside-out elements, elements with a repeated node, NaN, unused nodes."""
    if not np.isfinite(mesh.x).all():
        bad = int(np.flatnonzero(~np.isfinite(mesh.x).all(axis=1))[0])
        raise FaultError("E521", f"node {bad + 1} has the coordinates {mesh.x[bad]}")
    least = corner_volumes(mesh.x, mesh.hex8).min(axis=1)
    bad = np.flatnonzero(least <= 0.0)
    if bad.size:
        raise FaultError(
            "E522",
            f"{bad.size} elements are inside out or flat, the first is element {bad[0] + 1} "
            f"(least corner Jacobian {least[bad[0]]:.3g} m3)",
            "check the node order (VTK) and the mesh around it",
        )
    unused = np.setdiff1d(np.arange(len(mesh.x)), mesh.hex8)
    if unused.size:
        raise FaultError(
            "E523", f"node {unused[0] + 1} belongs to no element ({unused.size} such nodes)"
        )


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Check the mesh and write mesh.h5."""
    check_mesh(mesh)
    outer = boundary_faces(mesh.hex8)
    facets = {name: orient(name, quads, outer) for name, quads in mesh.facets.items()}
    with replaced(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"] = np.bytes_("talus-mesh")
        file.attrs["version"] = np.int32(1)
        file["nodes/x"] = np.ascontiguousarray(mesh.x, np.float64)
        file["cells/hex8"] = np.ascontiguousarray(mesh.hex8, np.int32)
        for name, rows in mesh.volumes.items():
            file[f"volume_groups/{name}"] = np.asarray(rows, np.int32)
        for name, rows in mesh.nodes.items():
            file[f"node_groups/{name}"] = np.asarray(rows, np.int32)
        for name, (cells, turned) in facets.items():
            file[f"facet_groups/{name}/quad4"] = turned.astype(np.int32)
            file[f"facet_groups/{name}/cell"] = cells.astype(np.int32)


def orient(name: str, quads: np.ndarray, outer: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return (elements, facets with outward normals) of a facet group on the boundary."""
    cells, turned = [], []
    for quad in np.asarray(quads).reshape(-1, 4):
        key = tuple(sorted(int(v) for v in quad))
        if key not in outer:
            raise FaultError(
                "E524",
                f"facet group '{name}' has a facet (nodes "
                f"{', '.join(str(v + 1) for v in quad)}) that is no outer face of one element",
                "facet groups must lie on the surface of the mesh",
            )
        cells.append(outer[key][0])
        turned.append(outer[key][1])
    return np.array(cells, int), np.array(turned, int).reshape(-1, 4)


def read_mesh(path: Path) -> Mesh:
    """Read mesh.h5."""
    try:
        with h5py.File(path) as file:
            volumes = {k: v[...] for k, v in file.get("volume_groups", {}).items()}
            facets = {k: v["quad4"][...] for k, v in file.get("facet_groups", {}).items()}
            nodes = {k: v[...] for k, v in file.get("node_groups", {}).items()}
            return Mesh(file["nodes/x"][...], file["cells/hex8"][...], volumes, facets, nodes)
    except (OSError, KeyError) as fault:
        reason = str(refuse(path, fault)).split(f"{path}: ", 1)[-1]
        raise FaultError("E520", f"{path} cannot be read as a mesh: {reason}") from fault


def structured(
    lines: tuple[np.ndarray, np.ndarray, np.ndarray], keep: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and hexahedra of a grid of given coordinates; `keep` (nx, ny, nz) leaves cells out."""
    nx, ny, nz = (len(line) - 1 for line in lines)
    z, y, x = np.meshgrid(lines[2], lines[1], lines[0], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    k, j, i = (
        a.ravel() for a in np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    )
    if keep is not None:
        chosen = keep[i, j, k]
        i, j, k = i[chosen], j[chosen], k[chosen]

    def node(di: int, dj: int, dk: int) -> np.ndarray:
        return ((k + dk) * (ny + 1) + j + dj) * (nx + 1) + i + di

    corners = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ]
    hex8 = np.column_stack([node(*c) for c in corners])
    used, hex8 = np.unique(hex8, return_inverse=True)
    return points[used], hex8.reshape(-1, 8)


def box(lower: np.ndarray, upper: np.ndarray, cells: tuple[int, int, int]) -> Mesh:
    """A box with the volume group 'all' and facet and node groups x0, x1, y0, y1, z0, z1."""
    lines = tuple(np.linspace(lower[d], upper[d], cells[d] + 1) for d in range(3))
    x, hex8 = structured(lines)
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    faces = list(boundary_faces(hex8).values())
    for d, letter in enumerate("xyz"):
        for side, value in enumerate((lower[d], upper[d])):
            on = np.isclose(x[:, d], value, rtol=0.0, atol=1e-9 * (upper[d] - lower[d]))
            mesh.nodes[f"{letter}{side}"] = np.flatnonzero(on)
            mesh.facets[f"{letter}{side}"] = np.array([q for _, q in faces if on[q].all()])
    return mesh


def from_gmsh(path: Path) -> Mesh:
    """Read any gmsh file with physical groups through meshio (hexahedra and quadrangles)."""
    import meshio

    if not path.is_file():
        raise FaultError("E520", f"{path}: there is no such file")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            data = meshio.read(path)
    except SystemExit as fault:  # meshio leaves when no reader of this ending takes the file
        hint = "a whole .msh file of gmsh is wanted"
        raise FaultError("E520", f"{path} is not in the form of its ending", hint) from fault
    except Exception as fault:  # a damaged file may raise anything inside a reader
        raise FaultError("E520", f"{path} cannot be read: {fault}") from fault
    kinds = sorted({block.type for block in data.cells})
    others = set(kinds) - {"hexahedron", "quad", "line", "vertex"}
    if others or "hexahedron" not in kinds:
        raise FaultError(
            "E525",
            f"{path} has cells of type {', '.join(kinds)}; only hexahedra with 8 nodes are known",
            "recombine the mesh to hexahedra of first order",
        )
    names = {(int(tag), int(dim)): name for name, (tag, dim) in data.field_data.items()}
    tags = data.cell_data.get("gmsh:physical", [np.zeros(len(b.data), int) for b in data.cells])
    mesh = Mesh(data.points, np.concatenate([b.data for b in data.cells if b.type == "hexahedron"]))
    gathered: dict[str, dict[str, list]] = {"hexahedron": {}, "quad": {}, "vertex": {}}
    row = 0
    for block, tag in zip(data.cells, tags, strict=True):
        dim = {"hexahedron": 3, "quad": 2, "line": 1, "vertex": 0}[block.type]
        for value in np.unique(tag):
            name = names.get((int(value), dim))
            if name is None or dim == 1:
                continue
            chosen = np.flatnonzero(tag == value)
            what = row + chosen if dim == 3 else block.data[chosen]
            gathered[block.type].setdefault(name, []).append(what)
        row += len(block.data) if dim == 3 else 0
    mesh.volumes = {name: np.concatenate(parts) for name, parts in gathered["hexahedron"].items()}
    mesh.facets = {name: np.concatenate(parts) for name, parts in gathered["quad"].items()}
    mesh.nodes = {
        name: np.unique(np.concatenate(parts)) for name, parts in gathered["vertex"].items()
    }
    return without_unused(mesh)


def without_unused(mesh: Mesh) -> Mesh:
    """Drop nodes that belong to no element (gmsh keeps construction points)."""
    used = np.unique(mesh.hex8)
    new = np.full(len(mesh.x), -1)
    new[used] = np.arange(len(used))
    facets = {name: new[quads] for name, quads in mesh.facets.items()}
    nodes = {name: new[rows][new[rows] >= 0] for name, rows in mesh.nodes.items()}
    return Mesh(mesh.x[used], new[mesh.hex8], mesh.volumes, facets, nodes)
