"""A strip footing on ideally plastic clay."""

import numpy as np

from talus.mesh import Mesh, structured, write_mesh
from talus.verification import Case, field_steps, read_history

HALF, WIDTH, DEPTH, THICK, COHESION = 0.5, 5.0, 4.0, 0.1, 1.0e4
PRANDTL = 2.0 + np.pi
CELLS = (4, 8, 16)  # under half of the strip


def graded(first: float, length: float) -> np.ndarray:
    """Distances from 0 to length in steps that grow by 15 %."""
    line, step = [0.0], first
    while line[-1] < length:
        line.append(line[-1] + step)
        step *= 1.15
    return np.array(line) * length / line[-1]


def write_slice(case: Case, n: int) -> Mesh:
    """Write the slice of soil with n cells under half of the strip."""
    size = HALF / n
    x = np.r_[np.linspace(0.0, HALF, n + 1), HALF + graded(size, WIDTH - HALF)[1:]]
    nodes, hex8 = structured((x, np.array([0.0, THICK]), -graded(size, DEPTH)[::-1]))
    top = np.isclose(nodes[:, 2], 0.0)
    groups = {
        "strip": np.flatnonzero(top & (nodes[:, 0] < HALF + 1e-9)),
        "left": np.flatnonzero(np.isclose(nodes[:, 0], 0.0)),
        "right": np.flatnonzero(np.isclose(nodes[:, 0], WIDTH)),
        "base": np.flatnonzero(np.isclose(nodes[:, 2], -DEPTH)),
    }
    mesh = Mesh(nodes, hex8, {"all": np.arange(len(hex8))}, {}, groups)
    write_mesh(case.folder / f"strip_{n}.h5", mesh)
    return mesh


def press(case: Case, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Run a mesh; return settlement [m] and load over cohesion, on the width of the mesh."""
    write_slice(case, n)
    text = (case.folder / "deck.nml").read_text().replace("MESH", f"strip_{n}")
    (case.folder / f"run_{n}.nml").write_text(text)
    case.run("talus-fem", f"run_{n}.nml")
    found = read_history(case.folder / f"run_{n}_reactions.csv")
    time = found["time"]
    down = np.interp(time, [0.0, 0.2, 1.0], [0.0, 0.01, 0.06])
    # the edge node carries half an element beyond the strip (van Langen and Vermeer)
    area = (HALF + 0.5 * HALF / n) * THICK
    return down, -found["strip z"] / area / COHESION


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
    same = all(np.array_equal(a[k], b[k]) for k in a)
    case.metric("two threads: every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge the load of three meshes, the iterations and the ledger; plot the loads."""
    fig, ax = case.figure()
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
    ax.set(xlabel="settlement [mm]", ylabel="load / cohesion [-]")
    ax.legend()
    case.save(fig)
