"""The surface of a mesh: nodes that hang on faces or edges of elements they do not belong to."""

import numpy as np

from talus.faults import FaultError
from talus.measure import near_pairs
from talus.mesh import Mesh, boundary_faces

NEAR = 1.0e-6  # distance / size of the face that counts as on it
BATCH = 2_000_000  # pairs looked at in one go


def check_hanging(mesh: Mesh) -> None:
    """Raise fault E527 for the first node on a face or edge of an element that does not have it.

    Every face is taken as the two triangles of a diagonal; nodes on edges lie in them exactly.
    """
    faces = list(boundary_faces(mesh.hex8).values())
    if not faces:
        return
    owners = np.array([owner for owner, _ in faces])
    quads = np.array([quad for _, quad in faces])
    nodes = np.unique(quads)
    corners = mesh.x[quads]
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
        stranger = (quads[face] != node[:, None]).all(axis=1)
        node, face = node[stranger], face[stranger]
        hit = on_quads(mesh.x[node], corners[face], NEAR * reach[face])
        if hit.any():
            k = np.flatnonzero(hit)[0]
            raise FaultError(
                "E527",
                f"node {node[k] + 1} at {mesh.x[node[k]]} m hangs on a face or edge of element "
                f"{owners[face[k]] + 1} ({len(np.unique(node[hit]))} such nodes)",
                "join the parts so that neighbours share their nodes",
            )


def on_quads(points: np.ndarray, corners: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Whether points (n, 3) lie within `near` (n) [m] of quadrangles (n, 4, 3)."""
    hit = np.zeros(len(points), bool)
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        hit |= on_triangles(points, corners[:, [a, b, c]], near)
    return hit


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
