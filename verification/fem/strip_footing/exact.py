"""A strip footing on ideally plastic clay."""

from pathlib import Path

import numpy as np

from talus.compare import same_arrays
from talus.mesh import Mesh, structured, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HALF, WIDTH, DEPTH, THICK, COHESION = 0.5, 5.0, 4.0, 0.1, 1.0e4
PRANDTL = 2.0 + np.pi
CELLS = (4, 8, 16)  # under half of the strip
FRICTION = np.deg2rad(20.0)
FRICTIONAL = (
    np.exp(np.pi * np.tan(FRICTION)) * np.tan(np.pi / 4 + FRICTION / 2) ** 2 - 1
) / np.tan(FRICTION)
# with friction: size of the elements at the edge of the strip [m], growth away from it
EDGES = ((0.08, 1.4), (0.04, 1.18), (0.028, 1.125))


def graded(first: float, length: float, growth: float = 1.15) -> np.ndarray:
    """Distances from 0 to length in steps that grow."""
    line, step = [0.0], first
    while line[-1] < length:
        line.append(line[-1] + step)
        step *= growth
    return np.array(line) * length / line[-1]


def write_slice(path: Path, x: np.ndarray, z: np.ndarray, kind: str = "hex8") -> None:
    """Write the slice of soil with lines at x and z."""
    nodes, hex8 = structured((x, np.array([0.0, THICK]), z))
    mesh = converted(Mesh(nodes, hex8, {"all": np.arange(len(hex8))}), kind)
    top = np.isclose(mesh.x[:, 2], 0.0)
    mesh.nodes |= {
        "strip": np.flatnonzero(top & (mesh.x[:, 0] < HALF + 1e-9)),
        "left": np.flatnonzero(np.isclose(mesh.x[:, 0], 0.0)),
        "right": np.flatnonzero(np.isclose(mesh.x[:, 0], x[-1])),
        "base": np.flatnonzero(np.isclose(mesh.x[:, 2], z[0])),
    }
    write_mesh(path, mesh)


def press(case: Case, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Run a mesh; return settlement [m] and load over cohesion, on the width of the mesh."""
    size = HALF / n
    x = np.r_[np.linspace(0.0, HALF, n + 1), HALF + graded(size, WIDTH - HALF)[1:]]
    write_slice(case.folder / f"strip_{n}.h5", x, -graded(size, DEPTH)[::-1])
    text = (case.folder / "deck.nml").read_text().replace("MESH", f"strip_{n}")
    (case.folder / f"run_{n}.nml").write_text(text)
    case.run("talus-fem", f"run_{n}.nml")
    found = read_history(case.folder / f"run_{n}_reactions.csv")
    time = found["time"]
    down = np.interp(time, [0.0, 0.2, 1.0], [0.0, 0.01, 0.06])
    # the edge node carries half an element beyond the strip (van Langen and Vermeer)
    area = (HALF + 0.5 * HALF / n) * THICK
    return down, -found["strip z"] / area / COHESION


def press_friction(case: Case, element: str, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Run mesh k with friction; settlement [m], load over cohesion and the strip's own width."""
    size, growth = EDGES[k]
    x = np.r_[HALF - graded(size, HALF, growth)[::-1], HALF + graded(size, 3.5, growth)[1:]]
    name = f"{element}_{k}"
    path = case.folder / f"soil_{name}.h5"
    write_slice(path, x, -graded(size, 2.0, growth)[::-1], element.split("_")[0])
    text = (case.folder / "friction.nml").read_text()
    text = text.replace("MESH", path.stem).replace("ELEMENT", element)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    found = read_history(case.folder / f"{name}_reactions.csv")
    return 0.4 * found["time"], -found["strip z"] / (HALF * THICK) / COHESION


def judge_friction(case: Case, ax: object) -> None:
    """Judge the load with friction on three meshes, and where it tends to."""
    ends = []
    for k, mark in zip(range(len(EDGES)), "os^", strict=True):
        down, load = press_friction(case, "hex20", k)
        ends.append(load[-1] / FRICTIONAL)
        label = f"hex20, {1e3 * EDGES[k][0]:.0f} mm at the edge"
        ax.plot(1e3 * down, load, mark + "-", ms=4, mfc="none", label=label)
    case.below("friction: growth of the load over the last quarter", load[-1] / load[-5] - 1, 2e-3)
    down, load = press_friction(case, "hex8_bbar", 1)
    ax.plot(1e3 * down, load, "C3:", label="hex8_bbar, 40 mm")
    case.above("friction, hex8_bbar: load / exact, which locks", load[-1] / FRICTIONAL, 1.15)
    size = np.array([e[0] for e in EDGES])
    wide = ends[-1] / (1 + 0.5 * size[-1] / HALF)
    case.metric("friction, 28 mm: load on the width of the mesh / exact", float(wide), 1.0, 0.03)
    case.metric("friction: load where the mesh tends to / exact",
                float(np.polyfit(size, ends, 1)[1]), 1.0, 0.01)  # fmt: skip
    ax.axhline(FRICTIONAL, color="k", lw=1, label="Prandtl, 14.83")
    ax.set(xlabel="settlement [mm]", title="friction 20°")
    ax.legend()


def judge_newton(case: Case, n: int) -> None:
    """Judge the order of the last iterations: r_(k+1) ~ r_k^order, in all steps together."""
    table = read_history(case.folder / f"run_{n}_newton.csv")
    orders = []
    for t in np.unique(table["time"]):
        r = table["residual"][np.isclose(table["time"], t)]
        if len(r) >= 3 and r[-2] < 1e-3 and r[-1] > 1e-14:
            orders.append(np.log(r[-1] / r[-2]) / np.log(r[-2] / r[-3]))
    case.above("order of Newton's last iterations, median", float(np.median(orders)), 1.7)
    case.below("iterations of a step, most", float(table["iteration"].max()), 12.0)
    case.metric("steps that were cut", float((table["share of the step"] < 1.0).sum()), 0.0, 0.0)


def judge_threads(case: Case, n: int) -> None:
    """Judge that two threads give the same bits as one."""
    text = (case.folder / f"run_{n}.nml").read_text()
    (case.folder / "threads.nml").write_text(text)
    case.run("talus-fem", "threads.nml", "--threads=2")
    a = field_steps(case.folder / f"run_{n}.h5")[-1].solid
    b = field_steps(case.folder / "threads.h5")[-1].solid
    same = same_arrays(a, b)
    case.metric("two threads: every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge the load of three meshes, the iterations and the ledger; plot the loads."""
    fig, axes = case.figure(ncols=2)
    ax = axes[0]
    last = []
    for n, mark in zip(CELLS, "os^", strict=True):
        down, load = press(case, n)
        last.append(load[-1])
        ax.plot(1e3 * down, load, mark + "-", ms=4, mfc="none", label=f"{n} cells")
        case.below(f"{n} cells: growth of the load over the last quarter", load[-1] / load[-6] - 1,
                   2e-4)  # fmt: skip
        energy = read_history(case.folder / f"run_{n}_energy.csv")
        off = abs(energy["closure"]).max() / abs(energy["plastic"]).max()
        case.below(f"{n} cells: ledger, error / largest", float(off), 1e-8)
        growth = float(np.diff(energy["plastic"]).min())
        case.above(f"{n} cells: least growth of the dissipation [J]", growth, 0.0)
    case.metric("16 cells: load / Prandtl", last[-1] / PRANDTL, 1.0, 0.01)
    judge_newton(case, CELLS[0])
    judge_threads(case, CELLS[0])
    ax.axhline(PRANDTL, color="k", lw=1, label="Prandtl, 2 + π")
    ax.set(xlabel="settlement [mm]", ylabel="load / cohesion [-]", title="clay")
    ax.legend()
    judge_friction(case, axes[1])
    case.save(fig)
