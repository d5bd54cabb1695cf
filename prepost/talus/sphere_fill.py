"""Fill a closed body of triangles with spheres: a template of a clump, and how true it is.

The points of a grid inside the body are centres of candidates, each as large as the body allows
there. One after another the candidate that covers most of what no sphere covers yet is taken. All
spheres lie inside the body, so that the clump is smaller: `grow` makes all of them larger until the
union has the body's volume.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus.clumps import Template, mass_of
from talus.faults import FaultError

BATCH = 2_000_000  # point-triangle pairs at once
VOLUME = 1.0e-3  # to which the volume of grown spheres is that of the body


@dataclass
class Fidelity:
    """Errors of a clump against the body it stands for, relative to the body."""

    spheres: int
    volume: float
    centre: float  # distance over the radius of gyration
    inertia: np.ndarray  # of the principal moments (3), rising


def read_body(path: Path) -> np.ndarray:
    """Read the triangles (n, 3, 3) of an STL or OBJ file [m]; faults E501, E682."""
    try:
        raw = path.read_bytes()
    except OSError as fault:
        raise FaultError("E501", f"cannot read {path}: {fault.strerror}") from fault
    try:
        triangles = read_obj(raw) if path.suffix.lower() == ".obj" else read_stl(raw)
    except (ValueError, IndexError, UnicodeDecodeError) as fault:
        raise FaultError("E682", f"{path} is no STL or OBJ file: {fault}") from fault
    if len(triangles) < 4 or not np.isfinite(triangles).all():
        raise FaultError("E682", f"{path} has {len(triangles)} triangles, no body")
    return triangles


def read_stl(raw: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) of an STL file."""
    count = int.from_bytes(raw[80:84], "little")
    if len(raw) == 84 + 50 * count:
        kind = np.dtype([("v", "<f4", (4, 3)), ("n", "<u2")])
        return np.frombuffer(raw, kind, count, 84)["v"][:, 1:].astype(float)
    words = [line.split()[1:] for line in raw.decode().splitlines() if "vertex" in line]
    return np.array(words, float).reshape(-1, 3, 3)


def read_obj(raw: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) of an OBJ file; faces of more corners are fans."""
    lines = [line.split() for line in raw.decode().splitlines()]
    corners = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    found = []
    for line in lines:
        if line[:1] == ["f"]:
            at = [int(word.split("/")[0]) for word in line[1:]]
            at = [k - 1 if k > 0 else len(corners) + k for k in at]
            found += [[at[0], at[k], at[k + 1]] for k in range(1, len(at) - 1)]
    return corners[np.array(found, int).reshape(-1, 3)]


def mass_of_body(t: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre (3) and inertia about it (3, 3) inside triangles (n, 3, 3), density 1."""
    six = np.einsum("ni,ni->n", t[:, 0], np.cross(t[:, 1], t[:, 2]))
    volume = six.sum() / 6.0
    if not volume > 0.0:
        raise FaultError("E682", f"the triangles enclose {volume:.3g} m3", "normals point outward")
    total = t.sum(axis=1)
    middle = (six[:, None] * total).sum(axis=0) / (24.0 * volume)
    second = np.einsum("n,nai,naj->ij", six, t, t) + np.einsum("n,ni,nj->ij", six, total, total)
    second = second / 120.0 - volume * np.outer(middle, middle)
    return volume, middle, np.trace(second) * np.eye(3) - second


def winding(points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """How often triangles (n, 3, 3) wind about points (m, 3): 1 inside a closed body, 0 outside."""
    found = np.zeros(len(points))
    size = max(BATCH // len(t), 1)
    for low in range(0, len(points), size):
        a, b, c = (t[None, :, k] - points[low : low + size, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
        top = np.einsum("mni,mni->mn", a, np.cross(b, c))
        base = la * lb * lc + np.einsum("mni,mni->mn", a, b) * lc
        base += np.einsum("mni,mni->mn", b, c) * la + np.einsum("mni,mni->mn", c, a) * lb
        found[low : low + size] = np.arctan2(top, base).sum(axis=1) / (2.0 * np.pi)
    return found


def distance(points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Distances (m) of points (m, 3) from the nearest of triangles (n, 3, 3)."""
    found = np.full(len(points), np.inf)
    size = max(BATCH // len(t), 1)
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1.0e-300)
    for low in range(0, len(points), size):
        p = points[low : low + size, None]
        above = np.einsum("mni,ni->mn", p - t[None, :, 0], normal)
        over = np.ones(above.shape, bool)
        least = np.full(above.shape, np.inf)
        for k in range(3):
            a, edge = t[:, k], t[:, (k + 1) % 3] - t[:, k]
            away = p - a[None]
            over &= np.einsum("mni,ni->mn", away, np.cross(normal, edge)) >= 0.0
            along = np.einsum("mni,ni->mn", away, edge) / np.maximum((edge**2).sum(1), 1.0e-300)
            away -= np.clip(along, 0.0, 1.0)[:, :, None] * edge[None]
            least = np.minimum(least, np.linalg.norm(away, axis=2))
        found[low : low + size] = np.where(over, np.abs(above), least).min(axis=1)
    return found


def grid_inside(t: np.ndarray, count: int) -> np.ndarray:
    """Points (m, 3) inside a body of a grid with `count` points along its longest side [m]."""
    low, high = t.min(axis=(0, 1)), t.max(axis=(0, 1))
    step = (high - low).max() / count
    lines = [np.arange(a + 0.5 * step, b, step) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    points = points[winding(points, t) > 0.5]
    if not len(points):
        raise FaultError("E682", "no point of the grid lies inside the body", "raise --grid")
    return points


def fill(t: np.ndarray, spheres: int, count: int = 30, grow: bool = False) -> Template:
    """Return the template of a body of triangles (n, 3, 3): at most so many spheres.

    `count` is the number of points of the grid along the longest side.
    """
    points = grid_inside(t, count)
    radius = distance(points, t)
    bare = np.ones(len(points), bool)
    chosen: list[int] = []
    while len(chosen) < spheres and bare.any():
        order = np.argsort(-radius)
        gains = np.zeros(len(points), int)
        best = 0
        for k in order:
            if 4.2 * (radius[k] * count / np.ptp(t, axis=(0, 1)).max() + 1.0) ** 3 < best:
                break  # a smaller sphere holds fewer points
            gains[k] = (bare & (((points - points[k]) ** 2).sum(axis=1) <= radius[k] ** 2)).sum()
            best = max(best, gains[k])
        chosen.append(int(gains.argmax()))
        bare &= ((points - points[chosen[-1]]) ** 2).sum(axis=1) > radius[chosen[-1]] ** 2
    template = Template(points[chosen], radius[chosen])
    if grow:
        template.radius = grown(template, mass_of_body(t)[0])
    return template


def grown(template: Template, volume: float) -> np.ndarray:
    """Radii (n), all by one length larger, with which the union has a volume [m3]."""
    low, high = 0.0, volume ** (1.0 / 3.0)
    middle = 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        now = mass_of(template.centre, template.radius + middle)[0]
        if abs(now / volume - 1.0) < VOLUME:
            break
        low, high = (middle, high) if now < volume else (low, middle)
    return template.radius + middle


def fidelity(template: Template, t: np.ndarray) -> Fidelity:
    """Return how true the union of the spheres of a template is to a body of triangles."""
    volume, middle, inertia = mass_of(template.centre, template.radius)
    true, centre, other = mass_of_body(t)
    gyration = np.sqrt(np.trace(other) / (2.0 * true))
    moments = np.linalg.eigvalsh(inertia) / np.linalg.eigvalsh(other) - 1.0
    away = float(np.linalg.norm(middle - centre) / gyration)
    return Fidelity(len(template.radius), volume / true - 1.0, away, moments)
