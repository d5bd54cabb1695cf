"""Rigid bodies in cases: turns, Euler's equations, overlaps of rounded polyhedra by search."""

import numpy as np

from talus.clumps import rotation
from talus.polyhedron_mass import Hull
from talus.sphere_fill import distance
from talus.verification import Case

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
THIRDS = 70  # of brackets, to rounding


def turned(axis: list[float], angle: float) -> np.ndarray:
    """Quaternion of a turn."""
    n = np.array(axis) / np.linalg.norm(axis)
    return np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * n)])


def spin_rates(inertia: np.ndarray, start: np.ndarray, end: float, count: int) -> np.ndarray:
    """Spin in principal axes after Euler's equations (Runge and Kutta, `count` steps)."""

    def rate(w: np.ndarray) -> np.ndarray:
        return -np.cross(w, inertia * w) / inertia

    w, h = start.copy(), end / count
    for _ in range(count):
        a = rate(w)
        b = rate(w + 0.5 * h * a)
        c = rate(w + 0.5 * h * b)
        w = w + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(w + h * c))
    return w


def plot_limit(case: Case, errors: np.ndarray, names: list[str]) -> None:
    """Plot errors (3, names) of impacts against Young's moduli of 1 GPa, 32 GPa and 1024 GPa."""
    fig, axis = case.figure()
    young = np.array([1.0e9, 3.2e10, 1.024e12])
    for k, name in enumerate(names):
        axis.loglog(young, errors[:, k], "os"[k] + "-", label=name)
    axis.loglog(young, errors[0, 0] * (young / young[0]) ** -0.4, "k:", label="E^-2/5")
    axis.set(xlabel="Young's modulus [Pa]", ylabel="error against the rigid body [-]")
    axis.legend()
    case.save(fig)


def tilt(quat: np.ndarray) -> float:
    """Return the angle by which a body is turned [rad]."""
    return float(2.0 * np.arctan2(np.linalg.norm(quat[1:]), abs(quat[0])))


def overlap_of(force: float, radius: float, modulus: float) -> float:
    """Overlap of a Hertzian contact under a force [m]."""
    return (0.75 * force / (modulus * np.sqrt(radius))) ** (2.0 / 3.0)


def rounded_cube(edge: float, r: float) -> tuple[float, float]:
    """Volume and moment about an axis of a cube with rounded edges, density 1, from its parts."""
    a = edge - 2.0 * r
    h = 0.5 * a
    volume = a**3 + 6.0 * a**2 * r + 3.0 * np.pi * r**2 * a + 4.0 / 3.0 * np.pi * r**3
    # integral of x^2: slices across x, within the core and beyond its ends
    square = (a**2 + 4.0 * r * a + np.pi * r**2) * 2.0 * h**3 / 3.0
    square += 2.0 * a**2 * (h**2 * r + h * r**2 + r**3 / 3.0)
    square += 8.0 * a * (h**2 * np.pi * r**2 / 4 + 2 * h * r**3 / 3 + np.pi * r**4 / 16)
    square += 2.0 * np.pi * (2.0 * h**2 * r**3 / 3 + h * r**4 / 2 + 2.0 * r**5 / 15)
    return volume, 2.0 * square


def overlap_of_cores(
    cores: list[tuple[Hull, float]], turns: np.ndarray, place: np.ndarray
) -> float:
    """Overlap of two rounded bodies, the second at a place (3) from the first, by search [m].

    Vertices against triangles of faces and edges against edges: the distance from a point of one
    edge to the other is convex along it, so that its least value is found by thirds.
    """
    x = [core.x @ rotation(q).T for (core, _), q in zip(cores, turns, strict=True)]
    x[1] = x[1] + place
    least = np.inf
    for one, other in ((0, 1), (1, 0)):
        rows = [(f[0], p, q) for f in cores[one][0].faces
                for p, q in zip(f[1:-1], f[2:], strict=True)]  # fmt: skip
        least = min(least, distance(x[other], x[one][np.array(rows)]).min())
    ends = [x[k][np.array([e[:2] for e in cores[k][0].edges()])] for k in (0, 1)]
    a = np.repeat(ends[0], len(ends[1]), axis=0)
    b = np.tile(ends[1], (len(ends[0]), 1, 1))
    low, high = np.zeros(len(a)), np.ones(len(a))
    for _ in range(THIRDS):
        near, far = (
            from_segment(along(a, low + part * (high - low)), b) for part in (1 / 3, 2 / 3)
        )
        third = (high - low) / 3.0
        low, high = np.where(near < far, low, low + third), np.where(near < far, high - third, high)
    least = min(least, from_segment(along(a, low), b).min())
    return cores[0][1] + cores[1][1] - float(least)


def along(ends: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return points of segments (n, 2, 3)."""
    return ends[:, 0] + part[:, None] * (ends[:, 1] - ends[:, 0])


def from_segment(x: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Distances of points (n, 3) from segments (n, 2, 3), row by row."""
    way = ends[:, 1] - ends[:, 0]
    part = ((x - ends[:, 0]) * way).sum(axis=1) / (way * way).sum(axis=1)
    return np.linalg.norm(x - along(ends, np.clip(part, 0.0, 1.0)), axis=1)


def until_overlap(
    cores: list[tuple[Hull, float]], turns: np.ndarray, way: np.ndarray, overlap: float
) -> np.ndarray:
    """Return the place of the second body along a way from the first where they overlap so far."""
    low, high = 0.0, 2.0 * sum(np.linalg.norm(core.x, axis=1).max() + r for core, r in cores)
    step = (high - low) / 60.0
    while overlap_of_cores(cores, turns, high * way) < overlap:
        high -= step
    low, high = high, high + step
    for _ in range(30):
        half = 0.5 * (low + high)
        inside = overlap_of_cores(cores, turns, half * way) >= overlap
        low, high = (half, high) if inside else (low, half)
    return low * way
