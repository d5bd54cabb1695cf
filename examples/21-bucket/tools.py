"""The blade and the bucket: shapes, places, ways."""

from pathlib import Path

import numpy as np

EDGE, COPIES = 0.036, (6, 4, 1)  # of a column of grains [m]; columns of the bed
PLACES = {"a": (0.0, 0.0), "b": (0.009, 0.018), "c": (0.018, 0.009)}  # shifts of the tool [m]
MIDDLE = np.array([0.5 * EDGE * COPIES[0], 0.5 * EDGE * COPIES[1]])

WIDTH, RAKE, LENGTH, SPEED = 0.05, np.radians(60.0), 0.04, 0.2  # of the blade
DEPTHS = (0.010, 0.015, 0.020)
WAY = 0.04  # of the blade [m]

#: Side view of the bucket: along its motion and away from the pivot [m]; first the lip.
PROFILE = 1.1e-3 * np.array([[0, 90], [-16, 81], [-27, 73], [-33, 64], [-33, 56], [-27, 51]])
BUCKET, DIG, LIP_SPEED = 0.06, 0.015, 0.4  # width, greatest depth [m], speed of the lip [m/s]
RADIUS = PROFILE[0, 1]
BEGIN, END = np.radians(-42.0), np.radians(55.0)  # of the pivot's arm, from straight down


def turned(angle: float) -> np.ndarray:
    """Return the side view about the pivot at an angle of the arm: x and z (n, 2) [m]."""
    forward = np.array([np.cos(angle), np.sin(angle)])
    inward = np.array([-np.sin(angle), np.cos(angle)])
    return PROFILE[:, :1] * forward - PROFILE[:, 1:] * inward


def write_bucket(path: Path, angle: float) -> None:
    """Write the bucket about its pivot, a sheet with two sides, as STL in text [m]."""
    view = turned(angle)
    left = np.column_stack([view[:, 0], np.full(len(view), -0.5 * BUCKET), view[:, 1]])
    right = left * [1.0, -1.0, 1.0]
    facets = []
    for k in range(len(view) - 1):
        facets += [(left[k], right[k], right[k + 1]), (left[k], right[k + 1], left[k + 1])]
    for k in range(1, len(view) - 1):
        facets += [(left[0], left[k], left[k + 1]), (right[0], right[k + 1], right[k])]
    lines = ["solid bucket"]
    for facet in facets:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {:.9e} {:.9e} {:.9e}".format(*corner) for corner in facet]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid bucket"]) + "\n")


def capacity() -> float:
    """Return the volume of the bucket below the plane of its opening [m3]."""
    x, y = PROFILE.T
    return float(0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) * BUCKET)


def swept() -> float:
    """Return the volume that the lip cuts out of the bed [m3]."""
    half = np.arccos(1.0 - DIG / RADIUS)
    return float(RADIUS**2 * (half - np.sin(half) * np.cos(half)) * BUCKET)


def inside(points: np.ndarray, angle: float) -> np.ndarray:
    """Return which points (n, 3) about the pivot [m] lie in the bucket or heaped over its opening."""
    lip, back = turned(angle)[[0, -1]]
    along = (back - lip) / np.linalg.norm(back - lip)
    up = np.array([along[1], -along[0]])
    if (turned(angle)[2] - lip) @ up > 0.0:
        up = -up
    place = (points[:, [0, 2]] - lip) @ np.column_stack([along, up])
    deep = ((turned(angle) - lip) @ up).min()
    long = np.linalg.norm(back - lip)
    return ((np.abs(points[:, 1]) < 0.5 * BUCKET) & (place[:, 0] > -5e-3) & (place[:, 0] < long + 5e-3)
            & (place[:, 1] > deep) & (place[:, 1] < 0.04))  # fmt: skip
