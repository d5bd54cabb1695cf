"""What the page of a view holds: arrays of the grains, the solid and the contacts, step by step.

Positions are Float32 [m], turns Int16 (of 32767), colours Uint8 between the `low` and `high` of
their field (over all steps), shapes a table of rows upper semi-axes, exponent, lower semi-axes, 0,
centre, 0 that the grains name by number. `Page.text` has them as base64 by name.
"""

import base64
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.datasets import DAMAGE, all_numbers
from talus.elements import faces
from talus.faults import FaultError
from talus.fields import ALWAYS, OF_NODES, FieldFile, Snapshot
from talus.forms import LEAST_EXPONENT, centres, net_triangles
from talus.network import ends_of
from talus.pictures import fold, round_above
from talus.polyhedron_view import (
    ball_radii,
    drawn,
    of_bodies,
    rounded_points,
    without_features,
)
from talus.progress import watch

TURN = 32767.0  # a component 1 of a quaternion
BODY = 6  # cells an edge of the net that a polyhedron is drawn with
TOP = 0.995  # share of the values of a field below the top of its colours
NAMES = {
    "displacement": "displacement [m]", "v": "speed [m/s]", "omega": "spin [rad/s]",
    "force": "force [N]", "moment": "moment [N m]", "coordination": "contacts of a grain [-]",
    "size": "mean semi-axis [m]", "u": "displacement [m]", "reaction": "reaction [N]",
    "stress_nodal": "von Mises stress [Pa]", "pore_pressure": "pore pressure [Pa]",
    "excess_pressure": "excess pore pressure [Pa]", "saturation": "saturation [-]",
}  # fmt: skip


@dataclass
class Page:
    """Blobs by name as base64, and the facts that say what they are."""

    text: dict[str, str] = field(default_factory=dict)
    facts: dict = field(default_factory=dict)

    def put(self, name: str, values: np.ndarray, kind: str) -> None:
        """Add an array in little-endian order as kind `f4`, `i2`, `u4` or `u1`."""
        data = np.ascontiguousarray(values, np.dtype(f"<{kind}"))
        self.text[name] = base64.b64encode(data.tobytes()).decode()

    def get(self, name: str, kind: str) -> np.ndarray:
        """Return an array that was put, flat."""
        return np.frombuffer(base64.b64decode(self.text[name]), np.dtype(f"<{kind}"))


def size_of(name: str, values: np.ndarray) -> np.ndarray:
    """Return one number a row: lengths of vectors, von Mises of tensors (xx yy zz xy yz zx)."""
    values = np.asarray(values, float)
    if values.ndim == 1:
        return values
    if name.startswith("stress") and values.shape[1:] == (6,):
        normal, shear = values[:, :3], values[:, 3:]
        apart = normal - np.roll(normal, 1, axis=1)
        return np.sqrt(0.5 * (apart**2).sum(axis=1) + 3.0 * (shear**2).sum(axis=1))
    return np.linalg.norm(values.reshape(len(values), -1), axis=1)


def limits(parts: list[np.ndarray]) -> tuple[float, float]:
    """Low and high of the colours of a field from its values at all steps."""
    values = np.concatenate([part[np.isfinite(part)] for part in parts] or [np.zeros(1)])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(np.quantile(values, TOP))
    if low >= 0.0:
        return 0.0, round_above(max(high, float(values.max()) * 1.0e-3, 1.0e-30))
    return low, max(high, low + 1.0e-30)


def coded(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return values as 0 to 255 between low and high; no number is 0."""
    share = np.clip((np.nan_to_num(values, nan=low) - low) / (high - low), 0.0, 1.0)
    return np.round(255.0 * share)


def chosen_steps(count: int, most: int) -> list[int]:
    """Return at most so many steps, evenly spread, the first and the last among them."""
    if count <= most:
        return list(range(count))
    return sorted({round(k * (count - 1) / max(1, most - 1)) for k in range(most)} | {count - 1})


def build(grains: Path | None, solid: Path | None, most: int) -> Page:
    """Return all that the page shows of a field file of grains, of a solid, or of both."""
    page, times = Page(), []
    if grains:
        times = add_grains(page, grains, most)
    if solid:
        add_solid(page, solid, times, most)
    return page


def add_grains(page: Page, path: Path, most: int) -> list[float]:
    """Add the steps of the grains; return their times [s]."""
    shots = []
    with FieldFile(path) as fields:
        steps = chosen_steps(len(fields), most)
        entries = watch(fields.entries(), "steps", len(fields))
        for step, entry in enumerate(entries):
            if step in steps:
                shots.append(snapshot(fields, step, entry))
    if not any(len(now.grains["x"]) for now, _, _ in shots):
        raise FaultError("E543", f"{path} holds no grains", "the field file of the grains")
    page.facts["frames"] = [
        add_frame(page, k, now, links) for k, (now, links, _) in enumerate(shots)
    ]
    if any(frame["bodies"] for frame in page.facts["frames"]):
        page.put("body.t", net_triangles(BODY)[1], "u4")
    add_shapes(page, [now.grains for now, _, _ in shots])
    values = [found for _, _, found in shots]
    names = [name for name in values[-1] if all(name in found for found in values)]
    page.facts["fields"] = add_colours(page, "g", names, values)
    add_forces(page, [links for _, links, _ in shots])
    return [now.time for now, _, _ in shots]


def snapshot(fields: FieldFile, step: int, entry: Snapshot) -> tuple[Snapshot, dict, dict]:
    """Return a step, its contacts as lines, and what its grains can be coloured by (n each)."""
    now = fields.read(step)
    if not now.grains:
        now.grains = {"id": np.zeros(0, int), "kind": np.zeros(0, int), "x": np.zeros((0, 3)),
                      "quat": np.zeros((0, 4)), "axes": np.zeros((0, 3))}  # fmt: skip
    links = lines(fields, step, now)
    if now.cell is not None:
        fold(entry, now)
    g = now.grains
    others = [name for name in g if name not in (*ALWAYS, "skew", "exponent", "vertices")]
    fields = {"displacement": g["x"] - entry.grains["x"]} | {name: g[name] for name in others}
    found = {name: size_of(name, of_bodies(g, name, data)) for name, data in fields.items()}
    found["size"] = np.cbrt(g["axes"].prod(axis=1))[drawn(g)]
    if "vertices" in g:
        now.grains = without_features(g) | bodies_of(g)
        rows, points = now.grains["bodies"], now.grains["points"]
        found["size"][rows] = ball_radii(points, net_triangles(BODY)[1])
    return now, links, found


def bodies_of(g: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return `bodies` (m), the drawn rows that are polyhedra, and their `points` (m, p, 3) [m]."""
    rows = np.flatnonzero(g["vertices"] > 0)
    return {
        "bodies": np.flatnonzero(g["vertices"][drawn(g)] > 0),
        "points": rounded_points(g, rows, net_triangles(BODY)[0]),
    }


def lines(fields: FieldFile, step: int, now: Snapshot) -> dict[str, np.ndarray]:
    """Return the contacts of a step as `start`, `end` (m, 3) [m] and `force` (m) [N], if any."""
    group = fields.file["steps"][fields.names[step]]
    if "contacts" not in group or not len(group["contacts"].get("ids", ())):
        return {}
    try:
        contacts = all_numbers(group["contacts"])
        start, end = ends_of(contacts, now.grains, now.cell)
        return {"start": start, "end": end, "force": np.linalg.norm(contacts["force"], axis=1)}
    except DAMAGE as fault:
        text = f"{fields.path}, contacts of step {step}: {fault.args[-1]}"
        raise FaultError("E542", text) from fault


def add_frame(page: Page, k: int, now: Snapshot, links: dict[str, np.ndarray]) -> dict:
    """Add what a step of grains is drawn with, without shapes and colours; return its facts."""
    g, s = now.grains, now.surfaces
    page.put(f"x{k}", g["x"], "f4")
    page.put(f"quat{k}", np.round(TURN * np.clip(g["quat"], -1.0, 1.0)), "i2")
    page.put(f"kind{k}", g["kind"], "u1")
    if links:
        page.put(f"links{k}", np.column_stack([links["start"], links["end"]]), "f4")
    if len(s.get("triangles", ())):
        page.put(f"surface{k}", s["x"][s["triangles"]], "f4")
    if len(g.get("bodies", ())):
        page.put(f"bodies{k}", g["bodies"], "u4")
        page.put(f"points{k}", g["points"], "f4")
    frame = {
        "time": now.time,
        "count": len(g["x"]),
        "bodies": len(g.get("bodies", ())),
        "links": len(links.get("force", ())),
        "triangles": len(s.get("triangles", ())),
    }
    if now.cell is not None:
        frame["cell"] = [now.cell.origin.tolist(), now.cell.vectors.tolist()]
    return frame


def add_shapes(page: Page, grains: list[dict[str, np.ndarray]]) -> None:
    """Add the table of shapes of all steps, each once, and the number of each grain's shape."""
    rows = []
    for g in grains:
        n = len(g["axes"])
        skew, exponent = g.get("skew", np.zeros((n, 3))), g.get("exponent", np.full(n, 2.0))
        rows.append(np.column_stack([g["axes"], skew, np.maximum(exponent, LEAST_EXPONENT)]))
    table, number = np.unique(np.concatenate(rows).astype(np.float32), axis=0, return_inverse=True)
    axes, skew, exponent = table[:, :3].astype(float), table[:, 3:6].astype(float), table[:, 6]
    zero = np.zeros(len(table))
    middle = centres(axes, skew, exponent.astype(float))
    shape = [axes * (1.0 + skew), exponent, axes * (1.0 - skew), zero, middle, zero]
    page.put("shapes", np.column_stack(shape), "f4")
    ends = np.cumsum([len(part) for part in rows])[:-1]
    for k, part in enumerate(np.split(number.ravel(), ends)):
        page.put(f"shape{k}", part, "u4")
    page.facts["shapes"] = len(table)
    page.facts["size"] = float(np.quantile(np.cbrt(axes.prod(axis=1)), 0.5))


def add_colours(page: Page, kind: str, names: list[str], steps: list[dict]) -> list[dict]:
    """Add fields of all steps as bytes `<kind>.<name><step>`; return name, title, low and high."""
    facts = []
    for name in names:
        low, high = limits([found[name] for found in steps])
        for k, found in enumerate(steps):
            page.put(f"{kind}.{name}{k}", coded(found[name], low, high), "u1")
        title = NAMES.get(name, name.replace("_", " "))
        facts.append({"name": name, "title": title, "low": low, "high": high})
    return facts


def add_forces(page: Page, links: list[dict[str, np.ndarray]]) -> None:
    """Add the forces of the contacts as bytes; the scale is that of the root, for thickness."""
    forces = [part["force"] for part in links if part]
    if not forces:
        return
    high = limits(forces)[1]
    for k, part in enumerate(links):
        if part:
            page.put(f"pull{k}", coded(np.sqrt(part["force"]), 0.0, np.sqrt(high)), "u1")
    page.facts["force"] = high


def skin(elements: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles (k, 3) and edges (m, 2) of the outside of a mesh, by its corners."""
    sides = []
    for kind, rows in elements.items():
        for face in faces(kind):
            size = 3 if len(face) in (3, 6) else 4
            corners = rows[:, list(face[:size])]
            sides.append(corners if size == 4 else corners[:, [0, 1, 2, 2]])
    if not sides:
        return np.zeros((0, 3), int), np.zeros((0, 2), int)
    face = np.concatenate(sides)
    _, back, count = np.unique(np.sort(face, axis=1), axis=0, return_inverse=True,
                               return_counts=True)  # fmt: skip
    outer = face[count[back.ravel()] == 1]
    triangles = np.concatenate([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    edges = np.concatenate([outer[:, [k, (k + 1) % 4]] for k in range(4)])
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1), axis=0)
    return triangles, edges


def add_solid(page: Page, path: Path, times: list[float], most: int) -> None:
    """Add the outside of a solid: at each time of the grains its step nearest in time."""
    with FieldFile(path) as fields:
        if fields.mesh is None:
            raise FaultError("E543", f"{path} holds no mesh", "the field file of the solid")
        x, elements = fields.mesh
        own = [float(np.ravel(fields.file["steps"][n].attrs["time"])[0]) for n in fields.names]
        steps = [int(np.argmin(np.abs(np.array(own) - t))) for t in times]
        steps = steps or chosen_steps(len(own), most)
        shots = {step: fields.read(step).solid for step in sorted(set(steps))}
    triangles, edges = skin(elements)
    used, number = np.unique(triangles, return_inverse=True)
    place = np.zeros(len(x), int)
    place[used] = np.arange(len(used))
    page.put("solid.t", number, "u4")
    page.put("solid.e", place[edges], "u4")
    order = list(shots)
    found = []
    for k, step in enumerate(order):
        nodal = {name: data for name, data in shots[step].items() if name in OF_NODES}
        page.put(f"solid.x{k}", (x + nodal.get("u", 0.0))[used], "f4")
        found.append({name: size_of(name, data)[used] for name, data in nodal.items()})
    names = [name for name in found[-1] if all(name in part for part in found)]
    facts = {"nodes": len(used), "fields": add_colours(page, "s", names, found)}
    page.facts["solid"] = facts | {"step": [order.index(step) for step in steps]}
    if not times:
        nothing = {"count": 0, "bodies": 0, "links": 0, "triangles": 0}
        page.facts["frames"] = [{"time": own[s]} | nothing for s in steps]
        page.facts["fields"] = []
