"""Mandel's slab, and a strip load on classical and micropolar layers."""

from pathlib import Path

import numpy as np

from talus.compare import max_of
from talus.mesh import Mesh, boundary_faces, structured, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

LOAD, THICK = 1.0e4, 0.1
# Mandel: E, nu, mobility, half-width, height
YOUNG, POISSON, MOBILITY = 1.0e7, 0.2, 1.0e-9
CLASSICAL = "law = 'linear_elastic', young = 1.0e7, poisson = 0.3"
POLAR = (
    "law = 'micropolar', lambda = 5769230.769, mu = 2846153.846, kappa = 2.0e6, alpha = 0.0, "
    "beta = 0.0, gamma = 1.2e5"
)
# time, settlement at the centre and the edge of the load, p at POINTS (and phi_y)
POINTS = ((0.0, 0.75), (0.0, 0.5), (0.0, 0.0), (1.0, 0.5))
STRIP = (
    (0.742857142857, 3.88201933159e-4, 1.51109935074e-4,
     (6362.91645334, 5954.49058661, 6238.00027358, 1381.42140252)),
    (3.71428571429, 4.60060896007e-4, 1.90009340546e-4,
     (3535.20755659, 5144.97110639, 5524.52455033, 1378.64887341)),
    (14.8571428571, 5.69454038285e-4, 2.67494751585e-4,
     (1428.42409656, 2516.41481533, 3390.61496028, 1225.57769929)),
    (37.1428571429, 6.53690513723e-4, 3.38726849603e-4,
     (514.832997502, 928.066873742, 1284.16748103, 624.827797888)),
)  # fmt: skip
# settlement of the centre and p at POINTS at once
UNDRAINED = (3.29041094555e-4, (6548.74841486, 5651.89041608, 6741.27387339, 1476.17867304))
POLAR_POINTS = ((0.0, 0.75), (0.0, 0.5), (0.5, 0.9), (1.0, 0.5))
POLAR_STRIP = (
    (3.71428571443, 4.39889809765e-4, 1.88601229177e-4,
     (3452.09171487, 5054.60684443, 1038.42547585, 1430.59898834),
     (0.0, 0.0, -4.10932966517e-4, 1.82730075617e-7)),
    (37.1428571443, 6.28284605498e-4, 3.35958186023e-4,
     (510.393813396, 920.694760581, 191.914000773, 625.354541569),
     (0.0, 0.0, -5.0333547473e-4, -7.79521312887e-5)),
)  # fmt: skip


class Mandel:
    """Series of Mandel's slab of half-width 1 and height 1 under a mean stress LOAD."""

    def __init__(self) -> None:
        """Find the roots of tan b = (1 - nu)/(nu_u - nu) b with nu_u = 1/2."""
        ratio = (1 - POISSON) / (0.5 - POISSON)
        low = np.arange(200) * np.pi + 1e-9
        high = low + np.pi / 2
        for _ in range(60):  # bisection of all roots together
            middle = (low + high) / 2
            below = np.tan(middle) < ratio * middle
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        self.b = low
        self.shear = YOUNG / 2 / (1 + POISSON)
        confined = YOUNG * (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)
        self.c = MOBILITY * confined

    def shares(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return sines, cosines and the decaying factors of the series."""
        s, c = np.sin(self.b), np.cos(self.b)
        return s, c, np.exp(-(self.b**2) * self.c * t) / (self.b - s * c)

    def pressure(self, x: np.ndarray, t: float) -> np.ndarray:
        """Pressure at x [Pa]."""
        s, c, e = self.shares(t)
        return LOAD * (np.cos(np.outer(x, self.b)) - c) @ (s * e)

    def plate(self, t: float) -> float:
        """Displacement of the plate [m]."""
        s, c, e = self.shares(t)
        return -LOAD / self.shear * ((1 - POISSON) / 2 - 0.5 * np.sum(s * c * e))

    def side(self, t: float) -> float:
        """Displacement of the side [m]."""
        s, c, e = self.shares(t)
        return LOAD / self.shear * (POISSON / 2 + 0.5 * np.sum(s * c * e))


def slice_of(x: np.ndarray, z: np.ndarray, kind: str) -> Mesh:
    """Slice with lines at x and z, and groups of its sides and of the strip on its top."""
    nodes, hex8 = structured((x, np.array([0.0, THICK]), z))
    mesh = converted(Mesh(nodes, hex8, {"all": np.arange(len(hex8))}), kind)
    top = np.isclose(mesh.x[:, 2], z[-1])
    for name, axis, at in (("x0", 0, x[0]), ("x1", 0, x[-1]), ("z0", 2, z[0]), ("z1", 2, z[-1])):
        mesh.nodes[name] = np.flatnonzero(np.isclose(mesh.x[:, axis], at))
    faces = [q for _, q in boundary_faces(mesh.cells).values()]
    mesh.facets["strip"] = np.array(
        [q for q in faces if top[q].all() and (mesh.x[q, 0] < 0.5 + 1e-9).all()]
    )
    return mesh


def fill(case: Case, source: str, name: str, values: dict[str, str]) -> None:
    """Write the deck of a run with its values, and run it."""
    text = (case.folder / source).read_text()
    for key, value in values.items():
        text = text.replace(key, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")


def judge_mandel(case: Case, element: str, ax: object) -> None:
    """Judge pressure, side and load of Mandel's slab; the centre rises above p0."""
    exact = Mandel()
    end, steps = 0.6 / exact.c, 240
    times = np.linspace(0.0, end, steps + 1)
    kind = element.split("_")[0]
    line = 1 - np.linspace(1.0, 0.0, 21) ** 1.5
    mesh = slice_of(line, np.linspace(0.0, 1.0, 3), kind)
    write_mesh(case.folder / "slab.h5", mesh)
    fill(case, "mandel.nml", f"mandel_{element}", {
        "T_END": repr(end), "STEP": repr(end / steps), "ELEMENT": element,
        "OUTPUT": repr(end / 12), "TIMES": ", ".join(repr(float(t)) for t in times),
        "VALUES": ", ".join(repr(float(exact.plate(t))) for t in times),
    })  # fmt: skip
    p0, off, side, highest = LOAD / 2, [], [], 0.0
    order = np.argsort(mesh.x[:, 0])
    for step in field_steps(case.folder / f"mandel_{element}.h5")[1:]:
        p = exact.pressure(mesh.x[:, 0], step.time)
        off.append(np.abs(step.solid["pore_pressure"] - p).max() / p0)
        moved = step.solid["u"][np.isclose(mesh.x[:, 0], 1.0), 0].mean()
        side.append(abs(moved / exact.side(step.time) - 1))
        if element not in ("hex20", "hex8_bbar"):
            continue
        ax.plot(mesh.x[order, 0], p[order] / p0, "k-", lw=1)
        mark = "o" if element == "hex20" else "x"
        ax.plot(mesh.x[order, 0], step.solid["pore_pressure"][order] / p0, mark, ms=3, mfc="none")
    table = read_history(case.folder / f"mandel_{element}_pore.csv")
    highest = float(table["largest pressure"].max() / p0)
    case.below(f"Mandel, {element}: pressure, error / p0", max_of(off), 0.01)
    case.below(f"Mandel, {element}: side, error", max_of(side), 0.005)
    best = max(exact.pressure(np.zeros(1), t)[0] for t in times[1:]) / p0
    case.metric(f"Mandel, {element}: highest pressure / p0", highest, float(best), 0.01)
    force = read_history(case.folder / f"mandel_{element}_reactions.csv")["z1 z"]
    late = read_history(case.folder / f"mandel_{element}_reactions.csv")["time"] > 0.04 / exact.c
    worst = float(np.abs(-force[late] / (LOAD * THICK) - 1).max())
    case.below(f"Mandel, {element}: force of the plate, error", worst, 0.01)
    scale = np.abs(table["x1 entered"]).max()
    case.below(f"Mandel, {element}: liquid unaccounted for",
               float(np.abs(table["balance"]).max() / scale), 1e-12)  # fmt: skip


def write_strip(path: Path, kind: str, n: int) -> Mesh:
    """Write the layer with n elements under half of the load."""
    size = 0.5 / n
    far = 1.0 + 3.0 * np.linspace(0.0, 1.0, 2 * n + 1) ** 1.5
    x = np.r_[np.arange(0.0, 1.0 + size / 2, size), far[1:]]
    z = np.unique(np.r_[np.linspace(0.0, 0.5, n // 2 + 1), np.arange(0.5, 1.0 + size / 2, size)])
    z = np.unique(np.round(z, 12))
    mesh = slice_of(np.round(x, 12), z, kind)
    write_mesh(path, mesh)
    return mesh


def node_at(mesh: Mesh, x: float, z: float) -> int:
    """Return a node at a place of the slice."""
    return int(np.argmin(np.abs(mesh.x - [x, 0.0, z]).sum(axis=1)))


def judge_strip(case: Case, element: str, ax: object) -> None:
    """Judge settlement and pressures of the strip at four times, a run each."""
    polar = "/" in element
    kind = element.split("/")[0].split("_")[0]
    title = f"strip, {element}"
    mesh = write_strip(case.folder / f"layer_{kind}.h5", kind, 10)
    sink, edge, off, turn = [], [], [], []
    for row in POLAR_STRIP if polar else STRIP:
        name = f"strip_{element.replace('/', '_')}_{row[0]:.0f}"
        fill(case, "strip.nml", name, {
            "T_END": repr(row[0]), "MESH": f"layer_{kind}", "STEP": repr(row[0] / 50),
            "MATERIAL": POLAR if polar else CLASSICAL, "ELEMENT": element,
            "TURNS": ", 'rx', 'rz'" if polar else "", "SIDE": ", 'ry'" if polar else "",
            "DRAINED": "&pore_pressure group = 'z1', value = 0.0 /",
        })  # fmt: skip
        last = field_steps(case.folder / f"{name}.h5")[-1].solid
        sink.append(abs(-last["u"][node_at(mesh, 0.0, 1.0), 2] / row[1] - 1))
        edge.append(abs(-last["u"][node_at(mesh, 0.5, 1.0), 2] / row[2] - 1))
        points = POLAR_POINTS if polar else POINTS
        found = [last["pore_pressure"][node_at(mesh, *at)] for at in points]
        off.append(np.abs(np.array(found) - row[3]).max() / LOAD)
        if polar:
            turned = [last["phi"][node_at(mesh, *at), 1] for at in points]
            turn.append(np.abs(np.array(turned) - row[4]).max() / 5e-4)
        ax.plot(row[3], [at[1] + 0.02 * at[0] for at in points], "k+", ms=10)
        mark = "s" if polar else "o" if kind == "hex20" else "x"
        ax.plot(found, [at[1] + 0.02 * at[0] for at in points], mark, ms=4, mfc="none")
    case.below(f"{title}: settlement of the centre, error", max_of(sink), 0.01)
    case.below(f"{title}: settlement of the edge, error", max_of(edge), 0.01)
    case.below(f"{title}: pressures, error / load", max_of(off), 0.01)
    if polar:
        case.below(f"{title}: micro-rotation, error / largest", max_of(turn), 0.02)


def undrained(case: Case, element: str, n: int) -> tuple[float, float]:
    """Run a first step in which no liquid flows; errors of pressures and settlement."""
    kind = element.split("_")[0]
    mesh = write_strip(case.folder / f"sealed_{kind}_{n}.h5", kind, n)
    name = f"first_{element}_{n}"
    fill(case, "strip.nml", name, {
        "T_END": "1.0e-5", "MESH": f"sealed_{kind}_{n}", "STEP": "1.0e-5", "MATERIAL": CLASSICAL,
        "ELEMENT": element, "TURNS": "", "SIDE": "", "DRAINED": "! no pressure is held",
    })  # fmt: skip
    last = field_steps(case.folder / f"{name}.h5")[-1].solid
    found = np.array([last["pore_pressure"][node_at(mesh, *at)] for at in POINTS])
    sink = float(-last["u"][node_at(mesh, 0.0, 1.0), 2] / UNDRAINED[0])
    return float(np.abs(found - UNDRAINED[1]).max() / LOAD), sink - 1


def judge_first_step(case: Case) -> None:
    """Judge undrained layers: 1 % with quadratic elements, first order with linear ones."""
    off, sink = undrained(case, "hex20", 10)
    case.below("undrained, hex20: pressures, error / load", off, 0.01)
    case.below("undrained, hex20: settlement, error", abs(sink), 0.01)
    for element in ("hex8_bbar", "tet4"):
        coarse = undrained(case, element, 10)
        fine = undrained(case, element, 20)
        case.above(f"undrained, {element}: error of half the elements",
                   coarse[0] / fine[0], 1.5)  # fmt: skip
        case.below(f"undrained, {element}: settlement, error", abs(fine[1]), 0.01)


def run(case: Case) -> None:
    """Judge Mandel's slab, strips and the first step; plot pressures."""
    fig, (ax, bx) = case.figure(ncols=2)
    for element in ("hex20", "hex8_bbar", "hex27", "tet10", "hex8_full"):
        judge_mandel(case, element, ax)
    ax.set(xlabel="x / half-width [-]", ylabel="p / p0 [-]", title="Mandel, T = 0.05 to 0.6")
    for element in ("hex20", "hex8_bbar", "hex20/hex8"):
        judge_strip(case, element, bx)
    bx.set(xlabel="p [Pa]", ylabel="height [m] (+ 0.02 x)", title="strip: + exact")
    judge_first_step(case)
    case.save(fig)
