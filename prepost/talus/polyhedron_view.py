"""Surfaces of rounded polyhedra for pictures, from the rows of their vertices in a field file.

`vertices` of the grains of a step is 0 for all grains of their own, the number of vertices in the
row of a polyhedron's first one, and -1 in its other rows, which are not drawn.
"""

import numpy as np

Arrays = dict[str, np.ndarray]


def mark_vertices(grains: Arrays, clumps: Arrays) -> None:
    """Add `vertices` to grains that are sorted by id, if some clumps are polyhedra."""
    if not np.any(clumps.get("vertices", 0)):
        return
    marks = np.zeros(len(grains["id"]), int)
    lead = np.searchsorted(grains["id"], clumps["first"])
    for row, count, members in zip(lead, clumps["vertices"], clumps["members"], strict=True):
        if count > 0:
            marks[row : row + members] = -1
            marks[row] = count
    grains["vertices"] = marks


def drawn(grains: Arrays) -> np.ndarray:
    """Return whether rows are drawn (n): all but further features of polyhedra."""
    return grains.get("vertices", np.zeros(len(grains["x"]), int)) >= 0


def without_features(grains: Arrays) -> Arrays:
    """Return the rows that are drawn."""
    keep = drawn(grains)
    return {name: values[keep] for name, values in grains.items()}


def of_bodies(grains: Arrays, name: str, values: np.ndarray) -> np.ndarray:
    """Return a field (n, ...) for the rows that are drawn.

    A polyhedron has the sum of the contacts and forces of its rows, the mean of its vertices of
    all else.
    """
    if "vertices" not in grains:
        return values
    marks, lead = grains["vertices"], np.flatnonzero(drawn(grains))
    values = np.asarray(values, float)
    if name in ("force", "coordination"):
        return np.add.reduceat(values, lead, axis=0)
    number = np.arange(len(marks)) - np.repeat(lead, np.diff(np.append(lead, len(marks))))
    counts = np.maximum(marks[lead], 1)
    some = number < np.repeat(counts, np.diff(np.append(lead, len(marks))))
    starts = np.append(0, np.cumsum(counts)[:-1])
    total = np.add.reduceat(values[some], starts, axis=0)
    return total / counts.reshape(-1, *[1] * (values.ndim - 1))


def ball_radii(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Radii (m) of the balls that have the volume of closed surfaces of points (m, p, 3)."""
    a, b, c = (points[:, triangles[:, k]] for k in range(3))
    volume = (a * np.cross(b, c)).sum(axis=(1, 2)) / 6.0
    return np.cbrt(0.75 * volume / np.pi)


def join_features(grains: Arrays, before: np.ndarray) -> None:
    """Keep the features of a polyhedron together where centres (n, 3) were folded into a cell."""
    if "vertices" not in grains:
        return
    marks = grains["vertices"]
    lead = np.maximum.accumulate(np.where(marks >= 0, np.arange(len(marks)), 0))
    grains["x"] = before + (grains["x"] - before)[lead]


def rounded_points(grains: Arrays, rows: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Surface points (m, p, 3) of the polyhedra of m rows that have the normals (p, 3)."""
    found = np.empty((len(rows), len(normals), 3))
    for k, row in enumerate(rows):
        x = grains["x"][row : row + grains["vertices"][row]]
        found[k] = x[np.argmax(x @ normals.T, axis=0)] + grains["axes"][row, 0] * normals
    return found
