"""Thick rings that yield: orders of displacement and stress with each law."""

from dataclasses import dataclass

import numpy as np
from radial import Clay, Crushing, Drucker, Ring, Sand
from solid import save

from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

INNER, OUTER = 1.0, 2.0
DEGREE = np.pi / 180
K, G = 1.0e8 / 1.2, 1.0e8 / 2.6  # of E = 100 MPa, nu = 0.3
BULK, SHEAR, CRITICAL, THETA, BROKEN = 13833.0e6, 7588.0e6, 4.65e6, 0.8, 0.2
CRUSHING = (1 - THETA * BROKEN) / (1 - BROKEN) * np.sqrt(2 * BULK * CRITICAL / THETA)
SAND = {
    "G0": 125.0, "nu": 0.05, "M": 1.25, "c": 0.712, "line": 0.019, "e0": 0.934, "xi": 0.7,
    "m": 0.05, "h0": 7.05, "ch": 0.968, "nb": 1.1, "A0": 0.704, "nd": 3.5, "zmax": 4.0,
    "cz": 600.0, "pat": 101.0e3,
}  # fmt: skip


@dataclass
class Ringed:
    """A law: its deck, the second program's, pressure of the start and those that follow [Pa]."""

    deck: str
    law: object
    start: float
    inner: tuple[float, ...]
    outer: tuple[float, ...]


def grown(start: float, share: float) -> tuple[float, ...]:
    """Return three pressures that grow evenly to (1 + share) times that of the start."""
    return tuple(start * (1 + share * k / 3) for k in (1, 2, 3))


LAWS = {
    "Drucker-Prager": Ringed(
        "law = 'drucker_prager', density = 1.0, young = 1.0e8, poisson = 0.3, cohesion = 2.0e4, "
        "friction_deg = 25.0, dilation_deg = 5.0, hardening = 2.0e7",
        Drucker(K, G, 2.0e4, 25 * DEGREE, 5 * DEGREE, 2.0e7),
        1.0e5, (2.5e5, 2.6e5, 2.7e5), (1.0e5, 1.0e5, 1.0e5),
    ),
    "Cam-clay": Ringed(
        "law = 'cam_clay', density = 1.0, poisson = 0.3, critical_slope = 1.2, "
        "compression_index = 0.2, swelling_index = 0.05, specific_volume = 1.9",
        Clay(1.2, 0.05 / 1.9, 0.15 / 1.9, 1.2 / 2.6),
        1.0e5, grown(1.0e5, 0.5), grown(1.0e5, 0.3),
    ),
    "sanisand": Ringed(
        "law = 'sanisand', density = 1.0, poisson = 0.05, stiffness_number = 125.0, critical_slope"
        " = 1.25,\n          extension_ratio = 0.712, critical_void_ratio = 0.934, "
        "critical_line_slope = 0.019,\n          plastic_hardening = 7.05, hardening_void = 0.968, "
        "bounding_rate = 1.1, dilatancy = 0.704,\n          dilatancy_rate = 3.5, fabric_limit = "
        "4.0, fabric_rate = 600.0, void_ratio = 0.75, yield_opening = 0.05",
        Sand(SAND, 0.75, 0.005 * 101.0e3),
        1.0e5, (1.2e5, 1.35e5, 1.5e5), (1.0e5, 1.0e5, 1.0e5),
    ),
    "breakage": Ringed(
        f"law = 'breakage', density = 1.0, young = {9 * BULK * SHEAR / (3 * BULK + SHEAR)!r}, "
        f"poisson = {(3 * BULK - 2 * SHEAR) / (2 * (3 * BULK + SHEAR))!r},\n          "
        f"critical_slope = 1.7, breakage_energy = {CRITICAL!r}, breakage_angle_deg = 70.0, "
        f"grading_index = {THETA!r}, initial_breakage = {BROKEN!r}",
        Crushing(BULK, SHEAR, 1.7, CRITICAL, 70 * DEGREE, THETA, BROKEN),
        0.9999 * float(CRUSHING), grown(float(CRUSHING), 0.5), grown(float(CRUSHING), 0.3),
    ),
}  # fmt: skip
SIZES = {"hex8_bbar": (2, 4, 8, 16), "hex20": (2, 4, 8)}
FEWER = {"hex8_bbar": (2, 4, 8), "hex20": (2, 4)}  # of sand, whose tangent takes seven paths
MOST_TIME = "sanisand"


def quarter(n: int, element: str) -> Mesh:
    """Return a quarter of the ring, n cells through the wall and along, middle nodes on arcs."""
    line = np.linspace(0.0, 1.0, n + 1)
    s, cells = structured((line, line, np.array([0.0, 1.0 / n])))
    mesh = Mesh(s, cells, {"all": np.arange(len(cells))})
    faces = [q for _, q in boundary_faces(cells).values()]
    for name, at in (("inner", 0.0), ("outer", 1.0)):
        mesh.facets[name] = np.array([q for q in faces if np.isclose(s[q][:, 0], at).all()])
    mesh = converted(mesh, element.split("_")[0])
    r, angle = INNER + (OUTER - INNER) * mesh.x[:, 0], 0.5 * np.pi * mesh.x[:, 1]
    mesh.x = np.column_stack([r * np.cos(angle), r * np.sin(angle), mesh.x[:, 2]])
    for name, k in (("x0", 0), ("y0", 1)):
        mesh.nodes[name] = np.flatnonzero(np.isclose(mesh.x[:, k], 0.0, atol=1e-9))
    mesh.nodes["z"] = np.arange(len(mesh.x))
    return mesh


def run_ring(case: Case, name: str, element: str, n: int) -> tuple[np.ndarray, ...]:
    """Run a ring; return radii and radial displacement of nodes, radii and stress of elements."""
    ring = LAWS[name]
    mesh = quarter(n, element)
    stem = f"{name}_{element}_{n}".lower()
    save(mesh, case.folder / f"{stem}.h5m")
    text = (case.folder / "deck.nml").read_text()
    words = {"MESH.h5": f"{stem}.h5m", "LAW": ring.deck, "ELEMENT": element, "NAME": name}
    words |= {"START": repr(ring.start)}
    words |= {"INNER": ", ".join(map(repr, ring.inner)), "OUTER": ", ".join(map(repr, ring.outer))}
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    steps = field_steps(case.folder / f"{stem}.h5")
    if len(steps) != 4 or not all(s.solid["yield"].min() == 1 for s in steps[1:]):
        raise RuntimeError(f"{stem}: not all of the ring yields in three steps")
    cut = read_history(case.folder / f"{stem}_newton.csv")["share of the step"]
    if not np.allclose(cut, 1.0):
        raise RuntimeError(f"{stem}: a step was cut")
    last = steps[-1].solid
    r = np.linalg.norm(mesh.x[:, :2], axis=1)
    u = np.einsum("ni,ni->n", last["u"][:, :2], mesh.x[:, :2]) / r
    cells = mesh.cells[element.split("_")[0]]
    middle = mesh.x[cells[:, :8]].mean(axis=1)
    return r, u, middle, last["stress"]


def errors_of(case: Case, name: str, element: str, n: int, exact: tuple) -> tuple[float, float]:
    """Return the largest error of u over the largest, and the mean square one of the stress."""
    radial, u_exact, stress_exact = exact
    r, u, middle, stress = run_ring(case, name, element, n)
    off_u = abs(u - radial.at_nodes(u_exact, r)).max() / abs(u_exact).max()
    at = np.linalg.norm(middle[:, :2], axis=1)
    c, s = middle[:, 0] / at, middle[:, 1] / at
    xx, yy, zz, xy = stress[:, 0], stress[:, 1], stress[:, 2], stress[:, 3]
    found = -np.array([
        c * c * xx + 2 * c * s * xy + s * s * yy, s * s * xx - 2 * c * s * xy + c * c * yy, zz
    ])  # fmt: skip
    off = found - radial.interpolate(stress_exact, at)
    weight = at / at.sum()
    spread = stress_exact - LAWS[name].start
    off_s = np.sqrt((weight * (off**2).sum(axis=0)).sum()) / abs(spread).max()
    return float(off_u), float(off_s)


def judge_orders(case: Case, name: str, element: str, found: np.ndarray) -> None:
    """Judge the orders between the two finest meshes, and the errors of the finest."""
    order_u, order_s = np.log2(found[-2] / found[-1])
    label = f"{name}, {element}"
    if element == "hex20":
        case.above(f"{label}: order of the displacement", float(order_u), 2.8)
    else:
        case.metric(f"{label}: order of the displacement", float(order_u), 2.0, 0.2)
    case.metric(f"{label}: order of the stress", float(order_s), 2.0, 0.2)
    case.below(f"{label}: displacement, error / largest", float(found[-1, 0]), 2e-2)
    case.below(f"{label}: stress, error / largest change", float(found[-1, 1]), 5e-2)


def run(case: Case) -> None:
    """Judge the orders of all laws; plot the errors."""
    fig, axes = case.figure(ncols=2, figsize=(10, 4.2))
    for (name, ring), mark in zip(LAWS.items(), "os^d", strict=True):
        radial = Ring(INNER, OUTER)
        pairs = list(zip(ring.inner, ring.outer, strict=True))
        exact = (radial, *radial.solve(ring.law, ring.start, pairs))
        all_sizes = FEWER if name == MOST_TIME else SIZES
        for element, sizes in all_sizes.items():
            found = np.array([errors_of(case, name, element, n, exact) for n in sizes])
            judge_orders(case, name, element, found)
            for k, ax in enumerate(axes):
                label = f"{name}, {element}"
                line = "-" if element == "hex8_bbar" else "--"
                ax.loglog(sizes, found[:, k], mark + line, mfc="none", lw=0.8, label=label)
    for ax, title in zip(axes, ("displacement", "stress"), strict=True):
        ax.loglog((2, 16), (0.4, 0.4 / 64), "k-", lw=1, label="second order")
        ax.set(xlabel="elements through the wall", ylabel="error [-]", title=title)
    axes[0].loglog((2, 8), (2e-3, 2e-3 / 64), "k:", lw=1, label="third order")
    axes[0].legend(fontsize="xx-small")
    case.save(fig)
