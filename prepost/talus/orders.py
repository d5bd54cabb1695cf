"""Other kinds of elements from a mesh of hex8: higher order, wedges, tetrahedra."""

import numpy as np

from talus.elements import CORNERS, EDGES, FACET_OF, HEX_FACES, HEX_MIDDLES, NODES
from talus.faults import FaultError
from talus.mesh import Mesh, boundary_faces, facet_parts

# along the diagonal from node 0 to node 6; faces meet where all elements run the same way
SPLITS = {
    "tet4": [
        [0, 1, 2, 6], [0, 3, 7, 6], [0, 4, 5, 6], [0, 5, 1, 6], [0, 2, 3, 6], [0, 7, 4, 6]
    ],
    "wedge6": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
}  # fmt: skip
FIRST = {"hex8": "hex8", "hex20": "hex8", "hex27": "hex8", "tet4": "tet4", "tet10": "tet4",
         "wedge6": "wedge6"}  # fmt: skip


def converted(mesh: Mesh, kind: str) -> Mesh:
    """Return the mesh of hex8 with elements of another kind, and the same groups.

    Tetrahedra (6 a hexahedron) and wedges (2) need a structured mesh: all hexahedra must run the
    same way, as those of `structured` do.
    """
    if set(mesh.cells) != {"hex8"}:
        raise FaultError("E525", "only a mesh of hex8 can be turned into other elements")
    if kind == "hex8":
        return mesh
    first = FIRST[kind]
    cells = mesh.hex8
    if first != "hex8":
        cells = mesh.hex8[:, SPLITS[first]].reshape(-1, CORNERS[first])
    parts = len(cells) // len(mesh.hex8)
    volumes = {
        name: (np.asarray(rows)[:, None] * parts + np.arange(parts)).ravel()
        for name, rows in mesh.volumes.items()
    }
    x, cells, ends = with_middles(mesh.x, cells, kind)
    nodes = {
        name: with_ends(np.asarray(rows), len(mesh.x), ends) for name, rows in mesh.nodes.items()
    }
    made = Mesh(x, {kind: cells}, volumes, nodes=nodes)
    outer = boundary_faces(made.cells)
    made.facets = {name: children(group, outer) for name, group in mesh.facets.items()}
    return made


def with_middles(
    x: np.ndarray, cells: np.ndarray, kind: str
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Add the nodes in the middle of edges, faces and elements that the kind has.

    Returns nodes, elements, and for the new nodes in their order the corner nodes around each.
    """
    corners = CORNERS[kind]
    wanted: list[np.ndarray] = []
    if NODES[kind] > corners:
        wanted.append(np.array(EDGES[corners]))
    if kind == "hex27":
        wanted += [np.array(HEX_FACES)[np.argsort(HEX_MIDDLES)], np.arange(8)[None]]
    ends = []
    for local in wanted:
        around = cells[:, local].reshape(-1, local.shape[1])
        unique, inverse = np.unique(np.sort(around, axis=1), axis=0, return_inverse=True)
        cells = np.hstack([cells, len(x) + inverse.reshape(-1, len(local))])
        x = np.vstack([x, x[unique].mean(axis=1)])
        ends.append(unique)
    return x, cells, ends


def with_ends(rows: np.ndarray, first: int, ends: list[np.ndarray]) -> np.ndarray:
    """Return a node group with the new nodes, from `first` on, whose corners all belong to it."""
    member = np.zeros(first, bool)
    member[rows] = True
    found = [rows]
    for part in ends:
        found.append(first + np.flatnonzero(member[part].all(axis=1)))
        first += len(part)
    return np.concatenate(found)


def children(group: np.ndarray | dict[str, np.ndarray], outer: dict) -> dict[str, np.ndarray]:
    """Outer faces of the new mesh that lie in the quadrangles of a group."""
    found: dict[str, list] = {}
    for quads in facet_parts(group).values():
        for quad in np.asarray(quads):
            q = [int(v) for v in quad]
            keys = [tuple(sorted(q))] + [tuple(sorted(q[:k] + q[k + 1 :])) for k in range(4)]
            for key in keys:
                if key in outer:
                    nodes = outer[key][1]
                    found.setdefault(FACET_OF[len(nodes)], []).append(nodes)
    parts = {kind: np.array(rows) for kind, rows in found.items()}
    return parts if len(parts) != 1 else next(iter(parts.values()))
