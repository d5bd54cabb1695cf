"""Convex polyhedra with rounded edges: hulls of points, rounding, templates, mass.

A body is the hull of points less a margin, the core, and all that lies within that margin, the
radius, of the core: flat faces stay where they were. Members of its template are the vertices,
edges and faces of the core, in this order. Theory of grains, section Rounded polyhedra.
"""

from pathlib import Path

import numpy as np

from talus.clumps import Template
from talus.faults import FaultError
from talus.polyhedron_mass import Hull
from talus.sphere_fill import read_body

FLAT = 1.0e-8  # of the size: points so near a plane lie in it
GOLDEN = 0.5 * (1.0 + np.sqrt(5.0))
SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
PUSHES = 2000  # towards the middle of a body, at most
NAMES = "cube, tetrahedron, octahedron, dodecahedron, brick"


def hull_of(points: np.ndarray) -> Hull:
    """Return the convex hull of points (n, 3); fewer than four off a plane are a fault (E683)."""
    size = np.ptp(points, axis=0).max(initial=0.0)
    triangles = first_triangles(points, size)
    while True:
        a, b, c = (points[triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        off = points @ normal.T - np.einsum("fi,fi->f", normal, a)
        if off.max() <= FLAT * size:
            return joined(points, triangles, normal, FLAT * size)
        far = int(np.unravel_index(off.argmax(), off.shape)[0])
        seen = off[far] > 0.1 * FLAT * size
        rims = {(int(t[k]), int(t[k - 2])) for t in triangles[seen] for k in range(3)}
        rims = sorted(edge for edge in rims if edge[::-1] not in rims)
        triangles = np.vstack([triangles[~seen], [[p, q, far] for p, q in rims]])


def first_triangles(points: np.ndarray, size: float) -> np.ndarray:
    """Return a tetrahedron of the points as four triangles (4, 3), seen from outside."""
    a = int(points[:, 0].argmin())
    b = int(np.linalg.norm(points - points[a], axis=1).argmax())
    along = (points[b] - points[a]) / max(np.linalg.norm(points[b] - points[a]), 1e-300)
    away = points - points[a]
    c = int(np.linalg.norm(away - np.outer(away @ along, along), axis=1).argmax())
    normal = np.cross(points[b] - points[a], points[c] - points[a])
    height = away @ (normal / max(np.linalg.norm(normal), 1e-300))
    d = int(np.abs(height).argmax())
    if not abs(height[d]) > 1.0e3 * FLAT * size:
        raise FaultError("E683", "its points lie in a plane", "four or more around a volume")
    if height[d] > 0.0:
        b, c = c, b
    return np.array([[a, b, c], [a, d, b], [b, d, c], [c, d, a]])


def joined(points: np.ndarray, triangles: np.ndarray, normal: np.ndarray, off: float) -> Hull:
    """Return the hull whose faces are the triangles, those of one plane as one face."""
    left, faces, normals = list(range(len(triangles))), [], []
    heights = np.einsum("fi,fi->f", normal, points[triangles[:, 0]])
    while left:
        k = max(left, key=lambda j: area_of(points[triangles[j]]))
        near = [
            j
            for j in left
            if np.ptp(points[triangles[j]] @ normal[k] - heights[k]) <= 4 * off
            and normal[j] @ normal[k] > 0.5
            and abs(points[triangles[j][0]] @ normal[k] - heights[k]) <= 4 * off
        ]
        rims = {(int(t[i]), int(t[i - 2])) for t in triangles[near] for i in range(3)}
        after = {p: q for p, q in rims if (q, p) not in rims}
        face = [min(after)]
        while after[face[-1]] != face[0]:
            face.append(after[face[-1]])
        faces.append(without_straight(points, np.array(face), off))
        normals.append(normal[k])
        left = [j for j in left if j not in near]
    used = np.unique(np.concatenate(faces))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    return Hull(points[used], [number[face] for face in faces], np.array(normals))


def area_of(corners: np.ndarray) -> float:
    """Area of a triangle (3, 3)."""
    return float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2)


def without_straight(points: np.ndarray, face: np.ndarray, off: float) -> np.ndarray:
    """Leave out corners of a face that lie on the line between their neighbours."""
    before, after = points[np.roll(face, 1)], points[np.roll(face, -1)]
    along = after - before
    away = np.linalg.norm(np.cross(along, points[face] - before), axis=1)
    return face[away > off * np.linalg.norm(along, axis=1)]


def volume_of(hull: Hull) -> float:
    """Volume of a hull [m3]."""
    total = 0.0
    for face in hull.faces:
        a = hull.x[face[0]]
        for b, c in zip(hull.x[face[1:-1]], hull.x[face[2:]], strict=True):
            total += a @ np.cross(b, c) / 6.0
    return float(total)


def middle_of(hull: Hull, margin: float) -> np.ndarray:
    """Return a point further than the margin from all faces; none is a fault (E684)."""
    heights = np.array(
        [hull.x[face[0]] @ n for face, n in zip(hull.faces, hull.normal, strict=True)]
    )
    point = hull.x.mean(axis=0)
    step = 0.5 * np.ptp(hull.x, axis=0).max()
    for _ in range(PUSHES):
        depth = heights - hull.normal @ point
        if depth.min() > 1.02 * margin:
            return point
        trial = point - step * hull.normal[depth.argmin()]
        if (heights - hull.normal @ trial).min() > depth.min():
            point = trial
        else:
            step *= 0.8
    raise FaultError(
        "E684", f"a body is too thin for the radius {margin:.3g} m of its edges", "less --rounding"
    )


def shrunk(hull: Hull, margin: float) -> Hull:
    """Return the points of a hull that are further than the margin [m] inside all faces."""
    middle = middle_of(hull, margin)
    depth = np.array(
        [(hull.x[face[0]] - middle) @ n for face, n in zip(hull.faces, hull.normal, strict=True)]
    )
    dual = hull_of(hull.normal / (depth - margin)[:, None])
    heights = np.array(
        [dual.x[face[0]] @ n for face, n in zip(dual.faces, dual.normal, strict=True)]
    )
    return hull_of(middle + dual.normal / heights[:, None])


def rounded(points: np.ndarray, rounding: float) -> Template:
    """Return the template of the hull of points (n, 3) [m].

    The radius of its edges is `rounding` times that of the sphere of the hull's volume.
    """
    hull = hull_of(points)
    radius = rounding * float(np.cbrt(3.0 * volume_of(hull) / (4.0 * np.pi)))
    return template_of_core(shrunk(hull, radius), radius)


def template_of_core(core: Hull, radius: float) -> Template:
    """Return the template of a core swept by a sphere of the radius [m]."""
    edges = [np.array(edge[:2]) for edge in core.edges()]
    corners = [np.array([k]) for k in range(len(core.x))] + edges + core.faces
    centre = np.array([core.x[part].mean(axis=0) for part in corners])
    return Template(centre, np.full(len(corners), radius), corners=corners)


def named_points(word: str) -> np.ndarray:
    """Points of a body NAME:EDGE, brick:AxBxC, or an STL or OBJ file [m]; faults E683, E685."""
    name, _, size = word.partition(":")
    if not size:
        return read_body(Path(word)).reshape(-1, 3)
    try:
        edges = np.array([float(part) for part in size.split("x")])
    except ValueError:
        edges = np.array([0.0])
    if len(edges) != (3 if name == "brick" else 1) or not (edges > 0.0).all():
        raise FaultError("E685", f"'{size}' is no size of a {name}", "NAME:EDGE, brick:AxBxC [m]")
    half = 0.5 * edges
    shapes = {
        "cube": SIGNS,
        "brick": SIGNS,
        "tetrahedron": SIGNS[SIGNS.prod(axis=1) > 0.0] / np.sqrt(2.0),
        "octahedron": np.vstack([np.eye(3), -np.eye(3)]) * np.sqrt(2.0),
        "dodecahedron": dodecahedron(),
    }
    if name not in shapes:
        raise FaultError("E685", f"there is no body called '{name}'", f"{NAMES}, or a file")
    return shapes[name] * half


def dodecahedron() -> np.ndarray:
    """Return the vertices (20, 3) of a dodecahedron of edges of 2."""
    points = [*SIGNS]
    for a in (-1.0, 1.0):
        for b in (-1.0, 1.0):
            row = np.array([0.0, a / GOLDEN, b * GOLDEN])
            points += [row, np.roll(row, 1), np.roll(row, 2)]
    return np.array(points) * GOLDEN
