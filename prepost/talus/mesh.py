"""Meshes: hexahedra, tetrahedra and wedges with named groups, in mesh.h5 and from gmsh files.

A mesh is written as mesh.h5 (manual, Files): nodes from 0 in VTK order, facet normals outward.
"""

import contextlib
import io
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from talus.checksum import created, opened
from talus.datasets import DAMAGE, all_numbers, numbers
from talus.elements import (
    CORNERS,
    FACET_OF,
    FACETS,
    KINDS,
    MESHIO,
    NODES,
    faces,
    jacobians,
    reference_nodes,
    rule,
)
from talus.faults import FaultError
from talus.files import refuse, replaced

Facets = np.ndarray | dict[str, np.ndarray]


@dataclass
class Mesh:
    """Nodes (n, 3) [m], elements by kind, groups of elements, facets and nodes.

    Elements are numbered through over the kinds in the order of KINDS; an array (m, 8) means
    hex8 alone. A facet group is an array (k, nodes) or, of several kinds, a dict of such arrays.
    """

    x: np.ndarray
    cells: dict[str, np.ndarray]
    volumes: dict[str, np.ndarray] = field(default_factory=dict)
    facets: dict[str, Facets] = field(default_factory=dict)
    nodes: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Bring the elements into the order of the kinds."""
        if not isinstance(self.cells, dict):
            self.cells = {"hex8": np.asarray(self.cells)}
        self.cells = {k: self.cells[k] for k in KINDS if k in self.cells and len(self.cells[k])}

    @property
    def hex8(self) -> np.ndarray:
        """Hexahedra of first order (m, 8)."""
        return self.cells.get("hex8", np.zeros((0, 8), int))

    @property
    def count(self) -> int:
        """Number of elements of all kinds."""
        return sum(len(cells) for cells in self.cells.values())


def facet_parts(facets: Facets) -> dict[str, np.ndarray]:
    """Facets of a group by kind, in the order of FACETS."""
    if not isinstance(facets, dict):
        facets = np.asarray(facets)
        facets = {FACET_OF[facets.shape[1]] if facets.ndim == 2 else "quad4": facets}
    return {kind: facets[kind] for kind in FACETS if kind in facets}


def facet_count(facets: Facets) -> int:
    """Number of facets of a group."""
    return sum(len(part) for part in facet_parts(facets).values())


@dataclass(frozen=True)
class Faces:
    """All faces of elements: sorted corners (f, 4; -1 first for triangles), element, nodes."""

    keys: np.ndarray
    element: np.ndarray
    kind: np.ndarray  # index into FACETS
    nodes: np.ndarray  # (f, 9), -1 beyond


def all_faces(cells: dict[str, np.ndarray]) -> Faces:
    """Return the faces of all elements, kind by kind."""
    keys, element, kinds, nodes = [], [], [], []
    first = 0
    for kind, rows in cells.items():
        for local in faces(kind):
            name = FACET_OF[len(local)]
            corners = np.full((len(rows), 4), -1)
            corners[:, : CORNERS[name]] = rows[:, local[: CORNERS[name]]]
            keys.append(np.sort(corners, axis=1))
            element.append(first + np.arange(len(rows)))
            kinds.append(np.full(len(rows), FACETS.index(name)))
            whole = np.full((len(rows), 9), -1)
            whole[:, : len(local)] = rows[:, local]
            nodes.append(whole)
        first += len(rows)
    order = np.argsort(np.concatenate(element), kind="stable")
    return Faces(*(np.concatenate(part)[order] for part in (keys, element, kinds, nodes)))


def boundary_faces(
    cells: np.ndarray | dict[str, np.ndarray],
) -> dict[tuple[int, ...], tuple[int, np.ndarray]]:
    """Faces that belong to one element: sorted corners -> (element, nodes with outward normal)."""
    table = all_faces(cells if isinstance(cells, dict) else {"hex8": np.asarray(cells)})
    _, first, count = np.unique(table.keys, axis=0, return_index=True, return_counts=True)
    outer = {}
    for k in first[count == 1]:
        key = tuple(int(v) for v in table.keys[k] if v >= 0)
        outer[key] = int(table.element[k]), table.nodes[k, : NODES[FACETS[table.kind[k]]]]
    return outer


def corner_volumes(x: np.ndarray, hex8: np.ndarray) -> np.ndarray:
    """Jacobian determinant at the eight corners of every hexahedron (m, 8) [m3 / 8]."""
    edges = np.array(
        [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]]
    )
    p = x[hex8]
    d = p[:, edges] - p[:, :, None, :]
    return np.einsum("eci,eci->ec", np.cross(d[:, :, 0], d[:, :, 1]), d[:, :, 2])


def least_jacobians(kind: str, x: np.ndarray) -> np.ndarray:
    """Least Jacobian (m) [m3] at corners (first order) or quadrature points; 0 if but rounding."""
    points = reference_nodes(kind) if kind in ("hex8", "wedge6") else rule(kind)[0]
    least = jacobians(kind, x, points).min(axis=1)
    size = (x.max(axis=1) - x.min(axis=1)).max(axis=1)
    return np.where(np.abs(least) <= 1e-14 * size**3, 0.0, least)


def check_mesh(mesh: Mesh) -> None:
    """Raise a fault for inside-out elements, elements with a repeated node, NaN, unused nodes."""
    if not np.isfinite(mesh.x).all():
        bad = int(np.flatnonzero(~np.isfinite(mesh.x).all(axis=1))[0])
        raise FaultError("E521", f"node {bad + 1} has the coordinates {mesh.x[bad]}")
    if not mesh.cells:
        raise FaultError("E525", "the mesh has no elements")
    parts = [least_jacobians(kind, mesh.x[rows]) for kind, rows in mesh.cells.items()]
    least = np.concatenate(parts)
    bad = np.flatnonzero(least <= 0.0)
    if bad.size:
        raise FaultError(
            "E522",
            f"{bad.size} elements are inside out or flat, the first is element {bad[0] + 1} "
            f"(least Jacobian {least[bad[0]]:.3g} m3)",
            "check the node order (VTK) and the mesh around it",
        )
    used = np.unique(np.concatenate([rows.ravel() for rows in mesh.cells.values()]))
    unused = np.setdiff1d(np.arange(len(mesh.x)), used)
    if unused.size:
        raise FaultError(
            "E523", f"node {unused[0] + 1} belongs to no element ({unused.size} such nodes)"
        )


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Check the mesh and write mesh.h5."""
    check_mesh(mesh)
    outer = boundary_faces(mesh.cells)
    facets = {name: orient(name, group, outer) for name, group in mesh.facets.items()}
    plain = set(mesh.cells) == {"hex8"}
    with replaced(path) as temporary, created(temporary) as file:
        file.attrs["format"] = np.bytes_("talus-mesh")
        file.attrs["version"] = np.int32(1 if plain else 2)
        file["nodes/x"] = np.ascontiguousarray(mesh.x, np.float64)
        for kind, rows in mesh.cells.items():
            file[f"cells/{kind}"] = np.ascontiguousarray(rows, np.int32)
        for name, rows in mesh.volumes.items():
            file[f"volume_groups/{name}"] = np.asarray(rows, np.int32)
        for name, rows in mesh.nodes.items():
            file[f"node_groups/{name}"] = np.asarray(rows, np.int32)
        for name, (owners, parts) in facets.items():
            for kind, part in parts.items():
                file[f"facet_groups/{name}/{kind}"] = part.astype(np.int32)
            file[f"facet_groups/{name}/cell"] = owners.astype(np.int32)


def orient(name: str, facets: Facets, outer: dict) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return (elements, facets by kind with outward normals) of a facet group on the boundary."""
    owners, turned = [], {}
    for kind, part in facet_parts(facets).items():
        rows = []
        for facet in np.asarray(part).reshape(-1, NODES[kind]):
            found = outer.get(tuple(sorted(int(v) for v in facet[: CORNERS[kind]])))
            if found is None or set(found[1].tolist()) != set(facet.tolist()):
                raise FaultError(
                    "E524",
                    f"facet group '{name}' has a facet (nodes "
                    f"{', '.join(str(v + 1) for v in facet)}) that is no outer face of one element",
                    "facet groups must lie on the surface of the mesh",
                )
            owners.append(found[0])
            rows.append(found[1])
        turned[kind] = np.array(rows, int).reshape(-1, NODES[kind])
    return np.array(owners, int), turned


def read_mesh(path: Path) -> Mesh:
    """Read mesh.h5."""
    try:
        with opened(path) as file:
            volumes = all_numbers(file.get("volume_groups", {}))
            facets = {k: read_facets(v) for k, v in file.get("facet_groups", {}).items()}
            nodes = all_numbers(file.get("node_groups", {}))
            cells = {k: numbers(v) for k, v in file["cells"].items() if k in KINDS}
            return Mesh(numbers(file["nodes/x"]), cells, volumes, facets, nodes)
    except DAMAGE as fault:
        reason = str(refuse(path, fault)).split(f"{path}: ", 1)[-1]
        raise FaultError("E520", f"{path} cannot be read as a mesh: {reason}") from fault


def read_facets(group: h5py.Group) -> Facets:
    """Return the facets of a group: one array if they are of one kind."""
    parts = {kind: numbers(group[kind]) for kind in FACETS if kind in group}
    if not parts:
        raise KeyError(f"{group.name} has no facets")
    return parts if len(parts) > 1 else next(iter(parts.values()))


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
    """Read any gmsh file with physical groups through meshio (first and second order)."""
    data = read_foreign(path)
    known = {MESHIO[kind]: kind for kind in (*KINDS, *FACETS)}
    dims = {kind: 3 for kind in KINDS} | {kind: 2 for kind in FACETS}
    found = sorted({block.type for block in data.cells})
    others = {name for name in found if name not in known and not name.startswith("line")}
    cells: dict[str, list] = {kind: [] for kind in KINDS}
    for block in data.cells:
        if known.get(block.type) in KINDS:
            cells[known[block.type]].append(np.asarray(block.data))
    if not found:
        raise FaultError("E525", f"{path} holds no elements", "save a mesh of volumes")
    if others - {"vertex"} or not any(cells.values()):
        raise FaultError(
            "E525",
            f"{path} has cells of type {', '.join(found)}; known are "
            f"{', '.join(MESHIO[kind] for kind in KINDS)}",
            "mesh volumes with these, of first or second order",
        )
    first = np.cumsum([0] + [sum(map(len, cells[kind])) for kind in KINDS])
    row = dict(zip(KINDS, first[:-1], strict=True))
    names = {(int(tag), int(dim)): name for name, (tag, dim) in data.field_data.items()}
    tags = data.cell_data.get("gmsh:physical", [np.zeros(len(b.data), int) for b in data.cells])
    groups: dict[int, dict[str, dict[str, list]]] = {3: {}, 2: {}, 0: {}}
    for block, tag in zip(data.cells, tags, strict=True):
        kind = known.get(block.type, block.type)
        dim = 0 if kind == "vertex" else dims.get(kind, 1)
        start = row.get(kind, 0)
        if dim == 3:
            row[kind] += len(block.data)
        for value in np.unique(tag):
            name = names.get((int(value), dim))
            if name is None or dim == 1:
                continue
            chosen = np.flatnonzero(tag == value)
            what = start + chosen if dim == 3 else np.asarray(block.data)[chosen]
            groups[dim].setdefault(name, {}).setdefault(kind, []).append(what)
    mesh = Mesh(data.points, {kind: np.concatenate(rows) for kind, rows in cells.items() if rows})
    mesh.volumes = {name: joined_rows(parts) for name, parts in groups[3].items()}
    mesh.facets = {name: joined_facets(parts) for name, parts in groups[2].items()}
    mesh.nodes = {name: np.unique(joined_rows(parts)) for name, parts in groups[0].items()}
    return without_unused(mesh)


def joined_rows(parts: dict[str, list]) -> np.ndarray:
    """Rows of all kinds in one array."""
    return np.concatenate([rows for kind in parts.values() for rows in kind])


def joined_facets(parts: dict[str, list]) -> Facets:
    """Facets of one kind as an array, of several as a dict."""
    joined = {kind: np.concatenate(rows) for kind, rows in parts.items()}
    return joined if len(joined) > 1 else next(iter(joined.values()))


def read_foreign(path: Path) -> object:
    """Read a file through meshio; what it cannot read is fault E520."""
    import meshio

    if not path.is_file():
        raise FaultError("E520", f"{path}: there is no such file")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(path)
    except SystemExit as fault:  # meshio exits when no reader of this ending accepts the file
        hint = "a whole .msh file of gmsh is wanted"
        raise FaultError("E520", f"{path} is not in the form of its ending", hint) from fault
    except Exception as fault:  # a damaged file may raise anything inside a reader
        hint = "a whole .msh file of gmsh (2.2 or 4.1) is wanted"
        raise FaultError("E520", f"{path} cannot be read: {fault}", hint) from fault


def without_unused(mesh: Mesh) -> Mesh:
    """Drop nodes that belong to no element (gmsh keeps construction points)."""
    used = np.unique(np.concatenate([rows.ravel() for rows in mesh.cells.values()]))
    new = np.full(len(mesh.x), -1)
    new[used] = np.arange(len(used))
    facets = {
        name: {k: new[part] for k, part in group.items()} if isinstance(group, dict) else new[group]
        for name, group in mesh.facets.items()
    }
    nodes = {name: new[rows][new[rows] >= 0] for name, rows in mesh.nodes.items()}
    cells = {kind: new[rows] for kind, rows in mesh.cells.items()}
    return Mesh(mesh.x[used], cells, mesh.volumes, facets, nodes)
