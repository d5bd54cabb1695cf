"""Shapes of grains: eight octants of six semi-axes and an exponent, as talus-dem reads them.

A grain has the semi-axes `axes` (1 + skew) on the positive sides of its frame and `axes` (1 - skew)
on the negative ones; exponent p: |x/a|^p + |y/b|^p + |z/c|^p = 1. Skew 0 and exponent 2 is an
ellipsoid. Arrays have one row a grain, lengths are metres. Theory of grains, section Forms.
"""

from dataclasses import dataclass
from math import gamma
from pathlib import Path

import numpy as np

from talus.faults import FaultError

MOST_SKEW = 0.8  # one half nine times the other
LEAST_EXPONENT, MOST_EXPONENT = 2.0, 10.0
TABLE = "a b c weight, or a+ b+ c+ a- b- c- exponent weight"  # columns of a table of forms
COLUMNS = (3, 4, 6, 7, 8)  # that a row may have; weight 1 and exponent 2 where they are left out
MARGIN = 1.02  # of bounding spheres, for the directions between those sampled


@dataclass
class Forms:
    """Mean semi-axes (n, 3), skew (n, 3), exponents and weights (n) by number of some forms."""

    axes: np.ndarray
    skew: np.ndarray
    exponent: np.ndarray
    weight: np.ndarray | None = None  # None: all alike

    def take(self, rows: np.ndarray) -> "Forms":
        """Return the forms of an index array."""
        weight = None if self.weight is None else self.weight[rows]
        return Forms(self.axes[rows], self.skew[rows], self.exponent[rows], weight)

    def choose(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Rows (count) of forms taken by chance, by their weights."""
        if self.weight is None:
            return rng.integers(len(self.axes), size=count)
        return rng.choice(len(self.axes), size=count, p=self.weight / self.weight.sum())


def formed(skew: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Whether grains (n) are no ellipsoids."""
    return (skew != 0.0).any(axis=1) | (exponent > LEAST_EXPONENT)


def dirichlet(p: float, i: int, j: int, k: int) -> float:
    """Integral of x^(i-1) y^(j-1) z^(k-1) over the octant of semi-axes 1 and exponent p."""
    return gamma(i / p) * gamma(j / p) * gamma(k / p) / (p**3 * gamma(1.0 + (i + j + k) / p))


def volumes(axes: np.ndarray, skew: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Volumes of grains (n) [m3]; the halves of an axis add up, so that skew changes none."""
    round_volume = 4.0 / 3.0 * np.pi * axes.prod(axis=1)
    share = {p: 6.0 / np.pi * dirichlet(p, 1, 1, 1) for p in set(exponent) - {2.0}}
    return round_volume * np.array([share.get(p, 1.0) for p in exponent])


def centres(axes: np.ndarray, skew: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Centres of mass (n, 3) from where the octants meet, in their frame [m]."""
    part = {p: dirichlet(p, 2, 1, 1) / dirichlet(p, 1, 1, 1) for p in set(exponent)}
    return 2.0 * axes * skew * np.array([part[p] for p in exponent])[:, None]


def surface_points(
    axes: np.ndarray, skew: np.ndarray, exponent: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Surface points (n, m, 3) with outward normals (m, 3), from the centre of mass, in its frame.

    Of superquadrics these are the points of the sharp form, which talus-dem rounds by 1e-4.
    """
    upper, lower = axes * (1.0 + skew), axes * (1.0 - skew)
    a = np.where(normals[None] >= 0.0, upper[:, None], lower[:, None])
    u = a * normals[None]
    u /= np.linalg.norm(u, axis=2, keepdims=True)
    q = (exponent / (exponent - 1.0))[:, None, None]
    total = (np.abs(u) ** q).sum(axis=2, keepdims=True)
    points = a * np.sign(u) * np.abs(u) ** (q - 1.0) * total ** (1.0 / q - 1.0)
    return points - centres(axes, skew, exponent)[:, None]


def bounding_radii(forms: Forms) -> np.ndarray:
    """Radii (n) of spheres about the centres of mass that hold the grains [m]."""
    radius = forms.axes.max(axis=1)
    rows = np.flatnonzero(formed(forms.skew, forms.exponent))
    if rows.size:
        some = forms.take(rows)
        points = surface_points(some.axes, some.skew, some.exponent, net(24))
        radius[rows] = MARGIN * np.linalg.norm(points, axis=2).max(axis=1)
    return radius


def net(count: int) -> np.ndarray:
    """Directions (m, 3) on a net over the faces of a cube, `count` cells an edge."""
    s = np.tan(0.25 * np.pi * np.linspace(-1.0, 1.0, count + 1))
    p, q = (g.ravel() for g in np.meshgrid(s, s))
    one = np.ones_like(p)
    faces = [
        np.roll(np.column_stack([side * one, p, q]), k, 1) for k in range(3) for side in (1, -1)
    ]
    n = np.concatenate(faces)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def net_triangles(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions of `net` and triangles (k, 3) between them, outward."""
    n = net(count)
    row = count + 1
    corner = np.add.outer(np.arange(count) * row, np.arange(count)).ravel()
    square = [corner, corner + 1, corner + row + 1, corner + row]
    half = [np.column_stack([square[0], square[i], square[i + 1]]) for i in (1, 2)]
    cells = np.concatenate([np.concatenate(half) + face * row**2 for face in range(6)])
    a, b, c = (n[cells[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0.0
    cells[inward] = cells[inward][:, [0, 2, 1]]
    return n, cells


def inside(points: np.ndarray, axes: np.ndarray, skew: np.ndarray, exponent: float) -> np.ndarray:
    """Whether points (..., 3) in the frame of one grain, from its centre of mass, lie inside it."""
    centre = centres(axes[None], skew[None], np.array([exponent]))[0]
    y = points + centre
    a = np.where(y >= 0.0, axes * (1.0 + skew), axes * (1.0 - skew))
    return (np.abs(y / a) ** exponent).sum(axis=-1) <= 1.0


def read_table(path: Path) -> Forms:
    """Read a table of measured grains: a row a form, three or six semi-axes [m], see TABLE."""
    rows = []
    for number, words in table_rows(path):
        try:
            values = [float(word) for word in words]
            if len(values) not in COLUMNS:
                wanted = ", ".join(map(str, COLUMNS[:-1]))
                raise ValueError(f"{len(values)} numbers instead of {wanted} or {COLUMNS[-1]}")
        except ValueError as fault:
            hint = f"rows are: {TABLE} (2 and 1 if left out)"
            raise FaultError("E507", f"no form: {fault}", hint, f"{path}:{number}") from fault
        if len(values) < 6:
            values = [*values[:3], *values[:3], LEAST_EXPONENT, *values[3:]]
        rows.append([*values, *[LEAST_EXPONENT, 1.0][len(values) - 6 :]])
        check_row(np.array(rows[-1]), f"{path}:{number}")
    if not rows:
        raise FaultError("E507", f"{path} holds no forms", f"rows are: {TABLE}")
    table = np.array(rows)
    upper, lower = table[:, 0:3], table[:, 3:6]
    weight = None if (table[:, 7] == table[0, 7]).all() else table[:, 7]
    return Forms(0.5 * (upper + lower), (upper - lower) / (upper + lower), table[:, 6], weight)


def table_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the lines of a table that hold words, with their numbers; `#` begins a comment."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as fault:
        raise FaultError("E501", f"cannot read {path}: {fault}") from fault
    rows = [(n, line.split("#")[0].replace(",", " ").split()) for n, line in enumerate(lines, 1)]
    return [(number, words) for number, words in rows if words]


def check_row(row: np.ndarray, place: str) -> None:
    """Raise a fault for a form that talus-dem would not take (E507)."""
    upper, lower, p = row[0:3], row[3:6], row[6]
    if row[7:].size and not 0.0 < row[7] < np.inf:
        raise FaultError("E507", f"weight {row[7]:g}", "weights must be above 0", place)
    if not (np.isfinite(row).all() and (row[:6] > 0.0).all()):
        raise FaultError("E507", f"semi-axes {row[:6]} m", "all six must be above 0", place)
    if np.abs((upper - lower) / (upper + lower)).max() > MOST_SKEW:
        text = f"semi-axes {row[:6]} m: one half is more than nine times the other"
        raise FaultError("E507", text, f"columns are: {TABLE}", place)
    if not LEAST_EXPONENT <= p <= MOST_EXPONENT:
        hint = f"from {LEAST_EXPONENT:g}, an ellipsoid, to {MOST_EXPONENT:g}"
        raise FaultError("E507", f"exponent {p:g}", hint, place)
