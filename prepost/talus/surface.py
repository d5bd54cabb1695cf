"""The surface of a mesh: nodes that hang on faces or edges of elements they do not belong to."""

import numpy as np

from talus.elements import CORNERS, FACET_OF, NODES
from talus.faults import FaultError
from talus.measure import near_pairs
from talus.mesh import Mesh, all_faces, boundary_faces

NEAR = 1.0e-6  # distance / size of the face that counts as on it
BATCH = 2_000_000  # pairs checked at once
TRIANGLES = {
    "quad4": [[0, 1, 2], [0, 2, 3]],
    "quad8": [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
    "quad9": [
        [0, 4, 8], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8], [7, 0, 8]
    ],
    "tri3": [[0, 1, 2]],
    "tri6": [[0, 3, 5], [3, 1, 4], [4, 2, 5], [3, 4, 5]],
}  # fmt: skip


def check_nesting(mesh: Mesh) -> None:
    """Raise fault E528 where two elements share the corners of a face but not all its nodes."""
    if all(NODES[kind] == CORNERS[kind] for kind in mesh.cells):
        return
    table = all_faces(mesh.cells)
    order = np.lexsort(table.keys.T)
    keys = table.keys[order]
    same = (keys[1:] == keys[:-1]).all(axis=1)
    nodes = np.sort(table.nodes[order], axis=1)
    bad = np.flatnonzero(same & (nodes[1:] != nodes[:-1]).any(axis=1))
    if bad.size:
        a, b = sorted(int(table.element[order[k]]) + 1 for k in (bad[0], bad[0] + 1))
        raise FaultError(
            "E528",
            f"elements {a} and {b} share the corners of a face but not the nodes between them",
            "give neighbours the same order, and the same nodes on the common face",
        )


def triangles_of_faces(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (t, 3) between the nodes of the outer faces, their element, all nodes (t, 9)."""
    triangles, owners, own = [], [], []
    for element, nodes in boundary_faces(mesh.cells).values():
        padded = np.full(9, -1)
        padded[: len(nodes)] = nodes
        for local in TRIANGLES[FACET_OF[len(nodes)]]:
            triangles.append(nodes[local])
            owners.append(element)
            own.append(padded)
    return np.array(triangles).reshape(-1, 3), np.array(owners), np.array(own)


def check_hanging(mesh: Mesh) -> None:
    """Raise fault E527 for the first node on a face or edge of an element that does not have it.

    Every face is taken as triangles between its nodes; nodes on edges lie in them exactly.
    """
    check_nesting(mesh)
    triangles, owners, own = triangles_of_faces(mesh)
    if not len(triangles):
        return
    nodes = np.unique(own[own >= 0])
    corners = mesh.x[triangles]
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    pairs = near_pairs(
        np.concatenate([mesh.x[nodes], middle]),
        np.concatenate([np.zeros(len(nodes)), (1.0 + NEAR) * reach]),
    )
    pairs = pairs[(pairs[:, 0] < len(nodes)) & (pairs[:, 1] >= len(nodes))]
    for first in range(0, len(pairs), BATCH):
        part = pairs[first : first + BATCH]
        node, face = nodes[part[:, 0]], part[:, 1] - len(nodes)
        stranger = (own[face] != node[:, None]).all(axis=1)
        node, face = node[stranger], face[stranger]
        hit = on_triangles(mesh.x[node], corners[face], NEAR * reach[face])
        if hit.any():
            k = np.flatnonzero(hit)[0]
            raise FaultError(
                "E527",
                f"node {node[k] + 1} at {mesh.x[node[k]]} m hangs on a face or edge of element "
                f"{owners[face[k]] + 1} ({len(np.unique(node[hit]))} such nodes)",
                "join the parts so that neighbours share their nodes",
            )


def on_triangles(points: np.ndarray, corners: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Whether points (n, 3) lie within `near` (n) [m] of triangles (n, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    good = length > 0.0
    normal = normal / np.where(good, length, 1.0)[:, None]
    away = np.abs(np.einsum("ni,ni->n", points - corners[:, 0], normal))
    inside = good & (away <= near)
    for k in range(3):
        edge = corners[:, (k + 1) % 3] - corners[:, k]
        along = np.cross(normal, edge) / np.linalg.norm(edge, axis=1)[:, None]
        inside &= np.einsum("ni,ni->n", points - corners[:, k], along) >= -near
    return inside
