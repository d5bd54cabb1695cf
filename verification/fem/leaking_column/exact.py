"""Leaks and seepage faces in one dimension."""

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HEIGHT, MOBILITY, LOAD = 1.0, 1.0e-9, 1.0e4
CONFINED = 1.0e7 * 0.7 / (1.3 * 0.4)
C = MOBILITY * CONFINED
BIOT_NUMBER = 2.0
COEFFICIENT = BIOT_NUMBER * MOBILITY / HEIGHT
END = 0.5 * HEIGHT**2 / C
STEPS = 200


def run_deck(case: Case, name: str, values: dict[str, object]) -> list:
    """Run a deck with its values; return its fields."""
    text = (case.folder / "deck.nml").read_text()
    values = {"T_END": END, "STEP": END / STEPS, "OUTPUT": END / 5, "LOAD": LOAD,
              "UNLOAD": f"{2 * END!r}, {3 * END!r}"} | values  # fmt: skip
    for key in sorted(values, key=len, reverse=True):
        value = values[key]
        text = text.replace(key, value if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    return field_steps(case.folder / f"{name}.h5")


def leaking(z: np.ndarray, t: float) -> np.ndarray:
    """Pressure over that of the load at heights z."""
    low = np.arange(100) * np.pi + 1e-9
    high = low + np.pi / 2 - 2e-9
    for _ in range(60):
        middle = (low + high) / 2
        below = middle * np.tan(middle) < BIOT_NUMBER
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    decay = np.exp(-(low**2) * C * t / HEIGHT**2)
    return np.cos(np.outer(z / HEIGHT, low)) @ (
        4 * np.sin(low) / (2 * low + np.sin(2 * low)) * decay
    )


def judge_leak(case: Case, z: np.ndarray, ax: object) -> None:
    """Judge consolidation through a leak, and the steady flow."""
    line = f"&leak group = 'z1', coefficient = {COEFFICIENT!r} /"
    off = []
    order = np.argsort(z)
    for step in run_deck(case, "leak", {"DRIVE": line})[1:]:
        exact = leaking(z, step.time)
        off.append(np.abs(step.solid["pore_pressure"] / LOAD - exact).max())
        ax.plot(exact[order], z[order], "k-", lw=1)
        ax.plot(step.solid["pore_pressure"] / LOAD, z, "o", ms=4, mfc="none")
    case.below("leak: pressure, error / p0", max_of(off), 0.01)
    judge_balance(case, "leak", "z1 leak")
    line = (f"&leak group = 'z1', coefficient = {COEFFICIENT!r}, pressure = 2.0e3 /\n"
            "&pore_pressure group = 'z0', value = 1.0e4 /")  # fmt: skip
    last = run_deck(case, "steady", {"DRIVE": line, "LOAD": 0.0, "T_END": 400 * END,
                                     "STEP": 20 * END, "OUTPUT": 400 * END})[-1].solid  # fmt: skip
    flow = 8.0e3 / (HEIGHT / MOBILITY + 1 / COEFFICIENT)
    off = float(np.abs(last["darcy"][:, 2] / flow - 1).max())
    case.below("leak: steady flow, error", off, 1e-9)
    off = float(np.abs(last["pore_pressure"] - (1e4 - flow / MOBILITY * z)).max() / 1e4)
    case.below("leak: steady pressure, error", off, 1e-9)


def judge_balance(case: Case, name: str, column: str) -> None:
    """Judge mass and energy."""
    books = read_history(case.folder / f"{name}_pore.csv")
    off = abs(books["balance"]).max() / abs(books[f"{column} entered"]).max()
    case.below(f"{name}: liquid unaccounted for", float(off), 1e-12)
    energy = read_history(case.folder / f"{name}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{name}: ledger", float(abs(energy["closure"]).max() / largest), 1e-12)


def judge_seepage(case: Case, z: np.ndarray, ax: object) -> None:
    """Judge a seepage face under a load that goes after half of the time."""
    half = {"UNLOAD": f"{END / 2!r}, {END / 2 + END / STEPS / 2!r}", "OUTPUT": END / 10}
    seeping = run_deck(case, "seepage", half | {"DRIVE": "&seepage group = 'z1' /"})
    held = run_deck(case, "held", half | {"DRIVE": "&pore_pressure group = 'z1', value = 0.0 /"})
    loaded = [k for k, s in enumerate(held) if 0 < s.time < END / 2 * 1.001]
    p, wanted = ([s.solid["pore_pressure"] for s in steps] for steps in (seeping, held))
    off = [np.abs(p[k] - wanted[k]).max() for k in loaded]
    case.below("seepage: pressure against a held one, difference / p0", max_of(off) / LOAD, 1e-12)
    books = read_history(case.folder / "seepage_pore.csv")
    flow = books["z1 seepage inflow"]
    case.below("seepage: largest inflow [m3/s]", float(flow.max()), 0.0)
    sink = [-s.solid["u"][np.isclose(z, HEIGHT), 2].mean() for s in seeping]
    late = sink[loaded[-1] + 1 :]
    kept = max_of(abs(s / sink[loaded[-1]] - 1) for s in late)
    case.below("seepage: settlement that comes back without load", kept, 1e-9)
    suction = -CONFINED * late[-1] / HEIGHT
    line, first = np.unique(np.round(z, 9), return_index=True)
    mean = float(np.trapezoid(seeping[-1].solid["pore_pressure"][first], line) / HEIGHT)
    case.metric("seepage: mean suction left / exact", mean / suction, 1.0, 1e-9)
    judge_balance(case, "seepage", "z1 seepage")
    time = np.array([s.time for s in seeping]) / END
    for name, steps in (("seepage", seeping), ("held", held)):
        base = [s.solid["pore_pressure"][np.isclose(z, 0.0)].mean() / LOAD for s in steps]
        ax.plot(time, base, "o-", ms=4, mfc="none", label=name)
    ax.set(xlabel="time / end [-]", ylabel="p at the base / load [-]")
    ax.legend()


def run(case: Case) -> None:
    """Judge leaks and seepage; plot pressures."""
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, HEIGHT]), (1, 1, 10))
    mesh = converted(mesh, "hex20")
    meshes.write_mesh(case.folder / "column.h5", mesh)
    fig, (ax, bx) = case.figure(ncols=2)
    judge_leak(case, mesh.x[:, 2], ax)
    ax.set(xlabel="p / load [-]", ylabel="height [m]", title="leak")
    judge_seepage(case, mesh.x[:, 2], bx)
    case.save(fig)
