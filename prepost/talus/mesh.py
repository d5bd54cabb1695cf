"""Meshes: hexahedra, tetrahedra and wedges with named groups, and their file mesh.h5.

A mesh is written as mesh.h5 (manual, Files): nodes from 0 in VTK order, facet normals outward.
"""

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
            keys.append(sorted_corners(name, rows[:, local]))
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


def element_counts(cells: dict[str, np.ndarray], corners: np.ndarray) -> np.ndarray:
    """Number of elements (k) that have facets of sorted corners (k, 4; -1 first of triangles)."""
    keys = all_faces(cells).keys
    _, place = np.unique(np.concatenate([keys, corners]), axis=0, return_inverse=True)
    place = place.ravel()
    counts = np.bincount(place[: len(keys)], minlength=place.max() + 1)
    return counts[place[len(keys) :]]


def sorted_corners(kind: str, facets: np.ndarray) -> np.ndarray:
    """Sorted corners (k, 4) of facets of a kind, -1 first of triangles."""
    corners = np.full((len(facets), 4), -1)
    corners[:, : CORNERS[kind]] = facets[:, : CORNERS[kind]]
    return np.sort(corners, axis=1)


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
    facets = {name: orient(name, group, outer, mesh.cells) for name, group in mesh.facets.items()}
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


def orient(
    name: str, facets: Facets, outer: dict, cells: dict[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return (elements, facets by kind with outward normals) of a facet group on the boundary."""
    owners, turned = [], {}
    for kind, part in facet_parts(facets).items():
        rows = []
        for facet in np.asarray(part).reshape(-1, NODES[kind]):
            found = outer.get(tuple(sorted(int(v) for v in facet[: CORNERS[kind]])))
            if found is None or set(found[1].tolist()) != set(facet.tolist()):
                raise no_outer_face(name, kind, facet, cells)
            owners.append(found[0])
            rows.append(found[1])
        turned[kind] = np.array(rows, int).reshape(-1, NODES[kind])
    return np.array(owners, int), turned


def no_outer_face(
    name: str, kind: str, facet: np.ndarray, cells: dict[str, np.ndarray]
) -> FaultError:
    """Return fault E524 with the reason why a facet (nodes) cannot be in a facet group."""
    table = all_faces(cells)
    same = (table.keys == sorted_corners(kind, facet[None])).all(axis=1)
    owners = table.element[same] + 1
    hint = "facet groups must lie on the surface of the mesh"
    if len(owners) == 0:
        reason = "is no face of an element"
    elif len(owners) == 1:
        reason = f"has other nodes between its corners than element {owners[0]}"
    else:
        reason = f"lies inside the mesh, between elements {owners[0]} and {owners[1]}"
        hint = (
            "a load there would have no side: give a node group, or outer facets in a group alone"
        )
    nodes = ", ".join(str(v + 1) for v in facet)
    return FaultError(
        "E524", f"facet group '{name}' has a facet (nodes {nodes}) that {reason}", hint
    )


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
