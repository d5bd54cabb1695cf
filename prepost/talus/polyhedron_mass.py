"""Volume, centre and inertia of convex polyhedra with rounded edges, in closed form.

The core, prisms over its faces, sectors of cylinders along its edges and of balls at its vertices.
eqs. D.93 and D.94 of the theory of grains.
"""

from dataclasses import dataclass

import numpy as np

Sums = tuple[float, np.ndarray, np.ndarray]  # integrals of 1, x (3), x x (3, 3)


@dataclass
class Hull:
    """Vertices (v, 3) of a convex body and its faces: rows of vertices, outward normals."""

    x: np.ndarray
    faces: list[np.ndarray]
    normal: np.ndarray

    def edges(self) -> list[tuple[int, int, int, int]]:
        """Return both ends of every edge and the faces that run along it and back."""
        along = {
            (int(a), int(b)): k
            for k, face in enumerate(self.faces)
            for a, b in zip(face, np.roll(face, -1), strict=True)
        }
        return [(a, b, k, along[b, a]) for (a, b), k in along.items() if a < b]


def normal_of(corners: np.ndarray) -> np.ndarray:
    """Return the unit normal of a plane polygon (n, 3), about which its corners go round."""
    away = corners - corners[0]
    n = np.cross(away[1:-1], away[2:]).sum(axis=0)
    return n / np.linalg.norm(n)


def mass_of_rounded(core: Hull, radius: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre (3) and inertia about it (3, 3) for density 1."""
    middle = core.x.mean(axis=0)
    moved = Hull(core.x - middle, core.faces, core.normal)
    parts = [*plates(moved, radius), *sectors(moved, radius)]
    volume, first, second = (sum(part[k] for part in parts) for k in range(3))
    centre = first / volume
    second = second - volume * np.outer(centre, centre)
    return float(volume), centre + middle, np.trace(second) * np.eye(3) - second


def tetrahedron(corners: np.ndarray) -> Sums:
    """Integrals over a tetrahedron (4, 3)."""
    volume = abs(np.linalg.det(corners[1:] - corners[0])) / 6.0
    total = corners.sum(axis=0)
    second = volume / 20.0 * (corners.T @ corners + np.outer(total, total))
    return volume, volume * total / 4.0, second


def plates(core: Hull, radius: float) -> list[Sums]:
    """Return the integrals over the core and over the prisms on its faces."""
    found = []
    for face, normal in zip(core.faces, core.normal, strict=True):
        top = radius * normal
        for p, q in zip(face[1:-1], face[2:], strict=True):
            a, b, c = core.x[[face[0], p, q]]
            rows = [
                [0 * a, a, b, c],
                [a, b, c, a + top],
                [b, c, a + top, b + top],
                [c, a + top, b + top, c + top],
            ]
            found += [tetrahedron(np.array(row)) for row in rows]
    return found


def about(point: np.ndarray, volume: float, first: np.ndarray, second: np.ndarray) -> Sums:
    """Return integrals about the origin of what has these about a point."""
    cross = np.outer(point, first)
    return (
        volume,
        first + volume * point,
        second + cross + cross.T + volume * np.outer(point, point),
    )


def sectors(core: Hull, r: float) -> list[Sums]:
    """Return the integrals over the sectors of cylinders and of balls."""
    found, k = [], len(core.x)
    angle, first = np.full(k, 2.0 * np.pi), np.zeros((k, 3))
    for a, b, one, other in core.edges():
        m, n = core.normal[one], core.normal[other]
        turn = np.arctan2(np.linalg.norm(np.cross(m, n)), m @ n)
        along, middle = core.x[b] - core.x[a], (m + n) / np.linalg.norm(m + n)
        length = np.linalg.norm(along)
        along = along / length
        across = np.cross(along, middle)
        tensor = (
            length
            * r**4
            / 8.0
            * (
                (turn + np.sin(turn)) * np.outer(middle, middle)
                + (turn - np.sin(turn)) * np.outer(across, across)
            )
        )
        tensor += length**3 * r**2 * turn / 24.0 * np.outer(along, along)
        push = 2.0 / 3.0 * length * r**3 * np.sin(0.5 * turn) * middle
        found.append(about(0.5 * (core.x[a] + core.x[b]), length * r**2 * turn / 2.0, push, tensor))
        for end, away in ((a, along), (b, -along)):
            first[end] -= 0.5 * turn * away
    for face in core.faces:
        for before, here, after in zip(np.roll(face, 1), face, np.roll(face, -1), strict=True):
            p, q = core.x[before] - core.x[here], core.x[after] - core.x[here]
            angle[here] -= np.arctan2(np.linalg.norm(np.cross(p, q)), p @ q)
    for v in range(k):  # anisotropic parts of second moments cancel at the other end of each edge
        tensor = r**5 / 15.0 * angle[v] * np.eye(3)
        found.append(about(core.x[v], r**3 / 3.0 * angle[v], r**4 / 4.0 * first[v], tensor))
    return found
