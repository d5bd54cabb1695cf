"""Clumps: rigid grains of several spheres, from templates of their centres and radii.

A template has centres (n, 3) and radii (n) in metres, in axes of its own. Arrays of clumps have a
row a clump. Theory of grains, section Clumps.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.forms import table_rows
from talus.polyhedron_mass import Hull, mass_of_rounded, normal_of

ROW = "x y z radius of a sphere [m]; a line 'template WEIGHT' begins another template"
COLUMNS = 400  # across the longer side, of the integral over a template


@dataclass
class Template:
    """Spheres of one kind of clump, its weight by number, and mass properties if given."""

    centre: np.ndarray
    radius: np.ndarray
    weight: float = 1.0
    volume: float | None = None
    middle: np.ndarray | None = None  # centre of mass (3) [m]
    inertia: np.ndarray | None = None  # about it, density 1 (3, 3) [m5]
    corners: list[np.ndarray] | None = None  # of a polyhedron: vertices of its members, from 0


@dataclass
class Clumps:
    """Clumps of a packing: template from 0, scale, origin of the template, turn, motion."""

    templates: list[Template]
    first: np.ndarray  # id of the first member; the others follow
    template: np.ndarray
    scale: np.ndarray
    x: np.ndarray
    quat: np.ndarray
    v: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))  # of the centre of mass [m/s]
    omega: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))  # in space [rad/s]

    def __post_init__(self) -> None:
        """Take rest where no motion is given."""
        if not len(self.v):
            self.v = np.zeros((len(self.first), 3))
        if not len(self.omega):
            self.omega = np.zeros((len(self.first), 3))

    def members(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return places (s, 3), radii (s) and row of the clump (s) of all spheres."""
        places, radii, rows = [], [], []
        for k, (kind, scale) in enumerate(zip(self.template, self.scale, strict=True)):
            own = self.templates[kind]
            places.append(self.x[k] + scale * own.centre @ rotation(self.quat[k]).T)
            radii.append(scale * own.radius)
            rows.append(np.full(len(own.radius), k))
        return np.concatenate(places), np.concatenate(radii), np.concatenate(rows)


def rotation(q: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) of a unit quaternion, body to space."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def mass_of(centre: np.ndarray, radius: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre (3) and inertia about it (3, 3) of the union of spheres, density 1.

    Columns along z on a grid of COLUMNS squares across, each the exact union of its intervals: the
    error is below 1e-4 of the volume. talus-dem integrates slices instead, to 1e-6 or better.
    """
    low = (centre - radius[:, None]).min(axis=0)
    high = (centre + radius[:, None]).max(axis=0)
    step = (high - low)[:2].max() / COLUMNS
    count = np.maximum(np.ceil((high - low)[:2] / step), 1).astype(int)
    edge = (high - low)[:2] / count
    x, y = (g.ravel() for g in np.meshgrid(*(low[c] + edge[c] * (np.arange(count[c]) + 0.5)
                                             for c in (0, 1)), indexing="ij"))  # fmt: skip
    away = (x[:, None] - centre[:, 0]) ** 2 + (y[:, None] - centre[:, 1]) ** 2
    half = np.sqrt(np.maximum(radius**2 - away, 0.0))
    sums = np.zeros((3, len(x)))  # integrals of 1, z, z^2 along each column
    reached = np.full(len(x), -np.inf)
    begin = np.where(half > 0.0, centre[:, 2] - half, np.inf)
    end = np.where(half > 0.0, centre[:, 2] + half, -np.inf)
    order = np.argsort(begin, axis=1)
    begin, end = np.take_along_axis(begin, order, 1), np.take_along_axis(end, order, 1)
    for a, b in zip(begin.T, end.T, strict=True):
        a = np.maximum(a, reached)
        new = b > a
        for p in range(3):
            sums[p, new] += (b[new] ** (p + 1) - a[new] ** (p + 1)) / (p + 1)
        reached = np.maximum(reached, b)
    moment = np.array([np.ones_like(x), x, y]) * sums[0]
    area = edge.prod()
    volume = area * sums[0].sum()
    middle = area * np.array([moment[1].sum(), moment[2].sum(), sums[1].sum()]) / volume
    second = np.array([
        [(x * moment[1]).sum(), (x * moment[2]).sum(), (x * sums[1]).sum()],
        [(x * moment[2]).sum(), (y * moment[2]).sum(), (y * sums[1]).sum()],
        [(x * sums[1]).sum(), (y * sums[1]).sum(), sums[2].sum()],
    ])  # fmt: skip
    second = area * second - volume * np.outer(middle, middle)
    second[[0, 1], [0, 1]] += volume * edge**2 / 12.0
    return volume, middle, np.trace(second) * np.eye(3) - second


def weighed(template: Template) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre of mass and inertia of a template, as given or of its spheres."""
    if template.volume is not None:
        return template.volume, template.middle, template.inertia
    if template.corners is not None:
        return mass_of_rounded(*core_of(template))
    return mass_of(template.centre, template.radius)


def core_of(template: Template) -> tuple[Hull, float]:
    """Return the core of a polyhedron, and the radius of its edges [m]."""
    vertices = sum(len(part) == 1 for part in template.corners)
    faces = [part for part in template.corners if len(part) > 2]
    x = template.centre[:vertices]
    normal = np.array([normal_of(x[part]) for part in faces])
    return Hull(x, faces, normal), float(template.radius[0])


def read_templates(path: Path) -> list[Template]:
    """Read a file of templates: rows x y z radius, lines 'template WEIGHT' between templates.

    A line 'mass VOLUME X Y Z XX YY ZZ XY YZ ZX' gives volume, centre of mass and inertia about it
    (density 1, products as -sum x y) in place of those of the spheres. Faults: E680.
    """
    found: list[dict] = []
    for number, words in table_rows(path):
        try:
            read_row(found, words)
        except ValueError as fault:
            hint = f"a row is: {ROW}"
            raise FaultError("E680", f"no sphere: {fault}", hint, f"{path}:{number}") from fault
    if not found or not all(part["rows"] for part in found):
        raise FaultError("E680", f"{path} has a template without spheres", f"a row is: {ROW}")
    return [template_of(part) for part in found]


def read_row(found: list[dict], words: list[str]) -> None:
    """Take one row of a file of templates; a ValueError says what is wrong with it."""
    if words[0] == "template":
        weight = float(words[1]) if len(words) == 2 else 1.0
        if len(words) > 2 or not 0.0 < weight < np.inf:
            raise ValueError("a weight is a number above 0")
        found.append({"rows": [], "weight": weight, "mass": None})
        return
    if not found:
        found.append({"rows": [], "weight": 1.0, "mass": None})
    values = [float(word) for word in words[words[0] == "mass" :]]
    wanted = 10 if words[0] == "mass" else 4
    if len(values) != wanted or not np.isfinite(values).all():
        raise ValueError(f"{len(values)} numbers instead of {wanted}")
    if wanted == 10:
        found[-1]["mass"] = values
    elif values[3] > 0.0:
        found[-1]["rows"].append(values)
    else:
        raise ValueError(f"the radius {values[3]:g}")


def template_of(part: dict) -> Template:
    """Return the template of the rows read."""
    rows = np.array(part["rows"])
    template = Template(rows[:, :3], rows[:, 3], part["weight"])
    if part["mass"] is not None:
        m = part["mass"]
        xx, yy, zz, xy, yz, zx = m[4:]
        template.volume, template.middle = m[0], np.array(m[1:4])
        template.inertia = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
        if not (template.volume > 0.0 and np.linalg.eigvalsh(template.inertia)[0] > 0.0):
            raise FaultError("E680", "the mass given is not above 0, or its inertia is none")
    return template


def reach_of(template: Template) -> float:
    """Radius of the sphere about the centre of mass that holds a template [m]."""
    away = np.linalg.norm(template.centre - weighed(template)[1], axis=1)
    return float((away + template.radius).max())


def put_clumps(file: object, clumps: Clumps) -> None:
    """Write templates and clumps into an open packing.h5."""
    templates = file.create_group("templates")
    every = clumps.templates
    templates["spheres"] = np.array([len(t.radius) for t in every], np.int32)
    templates["centre"] = np.concatenate([t.centre for t in every])
    templates["radius"] = np.concatenate([t.radius for t in every])
    if any(t.corners is not None for t in every):
        none = np.empty(0, int)
        parts = [p for t in every for p in t.corners or [none] * len(t.radius)]
        templates["corners"] = np.array([len(part) for part in parts], np.int32)
        templates["corner"] = np.concatenate(parts).astype(np.int32) + np.int32(1)
    if any(t.volume is not None for t in every):
        volume, middle, inertia = zip(*(weighed(t) for t in every), strict=True)
        templates["volume"] = np.array(volume)
        templates["middle"] = np.array(middle)
        rows, columns = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]
        templates["inertia"] = np.array(inertia)[:, rows, columns]
    group = file.create_group("clumps")
    group["first"] = clumps.first.astype(np.int64)
    group["template"] = clumps.template.astype(np.int32) + np.int32(1)
    for name in ("scale", "x", "quat", "v", "omega"):
        group[name] = np.ascontiguousarray(getattr(clumps, name), np.float64)


def clumps_of(templates: dict[str, np.ndarray], clumps: dict[str, np.ndarray]) -> Clumps:
    """Return the clumps of the datasets of a packing.h5; a missing one is a KeyError."""
    ends = np.cumsum(templates["spheres"])[:-1]
    found = [
        Template(centre, radius)
        for centre, radius in zip(
            np.split(templates["centre"], ends), np.split(templates["radius"], ends), strict=True
        )
    ]
    if "corners" in templates:
        parts = np.split(templates["corner"] - 1, np.cumsum(templates["corners"])[:-1])
        low = 0
        for template in found:
            own = parts[low : low + len(template.radius)]
            low += len(template.radius)
            template.corners = own if any(map(len, own)) else None
    if "volume" in templates:
        for k, template in enumerate(found):
            xx, yy, zz, xy, yz, zx = templates["inertia"][k]
            template.volume, template.middle = templates["volume"][k], templates["middle"][k]
            template.inertia = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    return Clumps(
        found, clumps["first"], clumps["template"] - 1, clumps["scale"], clumps["x"],
        clumps["quat"], clumps["v"], clumps["omega"],
    )  # fmt: skip
