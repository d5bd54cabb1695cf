"""Kinds of elements and facets: node order, faces, edges, shape functions, quadrature points.

The node order is VTK's (manual, Files), as in talus-fem: corners first, then middles of edges, of
faces, and the centre. Wedges have the order of gmsh: nodes 0 1 2 turn counter-clockwise seen from
nodes 3 4 5.
"""

from functools import cache
from itertools import product

import numpy as np

KINDS = ("hex8", "hex20", "hex27", "tet4", "tet10", "wedge6")
FACETS = ("quad4", "quad8", "quad9", "tri3", "tri6")
NODES = {
    "hex8": 8, "hex20": 20, "hex27": 27, "tet4": 4, "tet10": 10, "wedge6": 6,
    "quad4": 4, "quad8": 8, "quad9": 9, "tri3": 3, "tri6": 6,
}  # fmt: skip
CORNERS = {
    "hex8": 8, "hex20": 8, "hex27": 8, "tet4": 4, "tet10": 4, "wedge6": 6,
    "quad4": 4, "quad8": 4, "quad9": 4, "tri3": 3, "tri6": 3,
}  # fmt: skip
MESHIO = {
    "hex8": "hexahedron", "hex20": "hexahedron20", "hex27": "hexahedron27", "tet4": "tetra",
    "tet10": "tetra10", "wedge6": "wedge", "quad4": "quad", "quad8": "quad8", "quad9": "quad9",
    "tri3": "triangle", "tri6": "triangle6",
}  # fmt: skip
VTK = {"hex8": 12, "hex20": 25, "hex27": 29, "tet4": 10, "tet10": 24, "wedge6": 13}
FACET_OF = {size: name for name, size in NODES.items() if name in FACETS}

# gmsh orders these kinds otherwise: nodes in VTK order = nodes of gmsh[:, FROM_GMSH[kind]]
FROM_GMSH = {
    "hex20": [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
    "hex27": [
        0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15,
        22, 23, 21, 24, 20, 25, 26,
    ],
    "tet10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
}  # fmt: skip
GMSH_TYPE = {
    "hex8": 5, "hex20": 17, "hex27": 12, "tet4": 4, "tet10": 11, "wedge6": 6,
    "quad4": 3, "quad8": 16, "quad9": 10, "tri3": 2, "tri6": 9,
}  # fmt: skip

HEX_FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [1, 2, 6, 5], [0, 4, 7, 3]]
HEX_MIDDLES = [24, 25, 22, 23, 21, 20]  # of the faces above, hex27
TET_FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
WEDGE_FACES = [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]
HEX_EDGES = [
    [0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]
]  # fmt: skip
TET_EDGES = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]
CORNER_FACES = {8: HEX_FACES, 4: TET_FACES, 6: WEDGE_FACES}
EDGES = {8: HEX_EDGES, 4: TET_EDGES}


@cache
def faces(kind: str) -> tuple[tuple[int, ...], ...]:
    """Local nodes of every face, counter-clockwise seen from outside, in the facet's own order."""
    corners = CORNERS[kind]
    whole = []
    for number, face in enumerate(CORNER_FACES[corners]):
        nodes = list(face)
        if NODES[kind] > corners:
            edges = [frozenset(edge) for edge in EDGES[corners]]
            pairs = zip(face, face[1:] + face[:1], strict=True)
            nodes += [corners + edges.index(frozenset(pair)) for pair in pairs]
        if kind == "hex27":
            nodes.append(HEX_MIDDLES[number])
        whole.append(tuple(nodes))
    return tuple(whole)


@cache
def reference_nodes(kind: str) -> np.ndarray:
    """Natural coordinates of the nodes (nodes, 3): [-1, 1] of hexahedra, else the unit simplex."""
    if CORNERS[kind] == 8:
        corners = 2.0 * np.array(
            [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
        )
        corners -= 1.0
    elif CORNERS[kind] == 4:
        corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    else:
        return np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
    if NODES[kind] == len(corners):
        return corners
    nodes = np.vstack([corners, [corners[edge].mean(axis=0) for edge in EDGES[len(corners)]]])
    if kind == "hex27":
        order = np.argsort(HEX_MIDDLES)
        middles = np.array([corners[HEX_FACES[face]].mean(axis=0) for face in order])
        nodes = np.vstack([nodes, middles, np.zeros((1, 3))])
    return nodes


@cache
def exponents(kind: str) -> np.ndarray:
    """Exponents (nodes, 3) of the monomials that span the shape functions."""
    every = np.array(list(product(range(3), repeat=3)))
    linear = every.max(axis=1) <= 1
    if kind == "hex27":
        return every
    if kind == "hex8":
        return every[linear]
    if kind == "hex20":  # at most one square, and of superlinear degree 2
        return every[np.where(every > 1, every, 0).sum(axis=1) <= 2]
    if kind == "wedge6":
        return every[linear & (every[:, :2].sum(axis=1) <= 1)]
    return every[every.sum(axis=1) <= (1 if kind == "tet4" else 2)]


def gradients(kind: str, xi: np.ndarray) -> np.ndarray:
    """Derivatives of the shape functions (points, nodes, 3) at natural coordinates (points, 3)."""
    power = exponents(kind)
    values = np.prod(reference_nodes(kind)[:, None, :] ** power, axis=2)
    inverse = np.linalg.inv(values)
    slope = np.empty((len(xi), len(power), 3))
    for axis in range(3):
        lower = power.copy()
        lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
        terms = np.prod(np.asarray(xi)[:, None, :] ** lower, axis=2) * power[:, axis]
        slope[:, :, axis] = terms @ inverse
    return slope


@cache
def rule(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Quadrature points (q, 3) and weights (q) of talus-fem, exact for the volume."""
    if CORNERS[kind] == 8:
        x, w = np.polynomial.legendre.leggauss(2 if kind == "hex8" else 3)
        points = np.array(list(product(x, repeat=3)))
        return points, np.array([a * b * c for a, b, c in product(w, repeat=3)])
    if kind == "wedge6":
        flat = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0
        x, w = np.polynomial.legendre.leggauss(2)
        points = np.array([[*p, z] for z in x for p in flat])
        return points, np.repeat(w, 3) / 6.0
    if kind == "tet4":
        return np.full((1, 3), 0.25), np.array([1.0 / 6.0])
    orbits = (
        (0.310885919263300610, 0.0187813209530026418),
        (0.0927352503108912264, 0.0122488405193936583),
    )
    points = [np.full((4, 3), a) + (1.0 - 4.0 * a) * np.eye(4)[:, 1:] for a, _ in orbits]
    weights = [np.full(4, w) for _, w in orbits]
    a = 0.0455037041256496494
    six = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 1], [1, 0, 0], [1, 0, 1], [1, 1, 0]])
    points.append(np.where(six == 1, 0.5 - a, a))
    weights.append(np.full(6, 0.00709100346284691107))
    return np.concatenate(points), np.concatenate(weights)


def jacobians(kind: str, x: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Jacobian determinants (m, points) [m3] of elements with nodes x (m, nodes, 3) [m]."""
    slope = gradients(kind, xi)
    least = np.empty((len(x), len(xi)))
    for q, d in enumerate(slope):
        least[:, q] = np.linalg.det(np.einsum("eni,nj->eij", x, d))
    return least


def volumes(kind: str, x: np.ndarray) -> np.ndarray:
    """Volumes (m) [m3] of elements with nodes x (m, nodes, 3) [m]."""
    points, weights = rule(kind)
    return jacobians(kind, x, points) @ weights
