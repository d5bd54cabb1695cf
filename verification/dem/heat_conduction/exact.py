"""Heat through chains and lattices of spheres, against the equations that they obey."""

import itertools
import shutil

import numpy as np
from same_bits import same_fields

from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, DENSITY, CAPACITY = 1.0e-3, 2650.0, 0.74
K_QUARTZ, K_STEEL = 7.7, 45.0
OVERLAP = 4.0e-6  # of spheres [m]
AT_END = OVERLAP * 0.5 ** (1.0 / 3.0)  # at walls: the same force
NUMBER, HOT, COLD, START = 12, 330.0, 310.0, 300.0
PITCH = 2.0 * RADIUS - OVERLAP
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
HEAT = MASS * CAPACITY  # J/K
BETWEEN = 2.0 * K_QUARTZ * np.sqrt(0.5 * RADIUS * OVERLAP)  # W/K, 2 k a
AT_WALL = 4.0 * K_QUARTZ * K_STEEL / (K_QUARTZ + K_STEEL) * np.sqrt(RADIUS * AT_END)
AT_QUARTZ = 2.0 * K_QUARTZ * np.sqrt(RADIUS * AT_END)
STEPS, ROWS = 4000, 8
ROUND = 1.0e-10


def run(case: Case) -> None:
    """Judge the chain between walls, the chain without them, the lattice."""
    judge_chain(case)
    judge_alone(case)
    judge_cell(case)
    judge_lattice(case)


def fill(case: Case, deck: str, words: dict[str, object], name: str = "") -> None:
    """Write a deck with its words."""
    text = (case.folder / deck).read_text()
    for word, value in words.items():
        text = text.replace(word, value if isinstance(value, str) else f"{value:.17g}")
    (case.folder / (name or deck)).write_text(text)


def chain_matrix(ends: float) -> np.ndarray:
    """Return A of dT/dt = A T + b of the chain, ends with this conductance to the walls [1/s]."""
    a = np.zeros((NUMBER, NUMBER))
    for i in range(NUMBER - 1):
        a[i, i + 1] = a[i + 1, i] = BETWEEN
    np.fill_diagonal(a, -a.sum(1))
    a[0, 0] -= ends
    a[-1, -1] -= ends
    return a / HEAT


def integrate(a: np.ndarray, b: np.ndarray, first: np.ndarray, t: float) -> np.ndarray:
    """Return T(t) of dT/dt = A T + b by the eigenvectors of A, which is symmetric."""
    steady = np.linalg.solve(a, -b)
    values, vectors = np.linalg.eigh(a)
    return steady + vectors @ (np.exp(values * t) * (vectors.T @ (first - steady)))


def integral(a: np.ndarray, b: np.ndarray, first: np.ndarray, t: float) -> np.ndarray:
    """Return the integral of T(t) of dT/dt = A T + b."""
    steady = np.linalg.solve(a, -b)
    values, vectors = np.linalg.eigh(a)
    decay = (np.exp(values * t) - 1.0) / values
    return steady * t + vectors @ (decay * (vectors.T @ (first - steady)))


def chain_words(dt: float, steps: int, walls: str) -> dict[str, object]:
    """Return the words of the chain's deck."""
    low = -RADIUS + AT_END
    high = (NUMBER - 1) * PITCH + RADIUS - AT_END
    words = {"T_END": steps * dt, "ROW": steps // ROWS * dt, "DT": dt, "WALLS": walls}
    return words | {"LOW": low, "HIGH": high}


def judge_chain(case: Case) -> None:
    """Compare with the discrete steps, with exact integration at three steps, and the balance."""
    x = np.column_stack([np.zeros((NUMBER, 2)), np.arange(NUMBER) * PITCH])
    write_h5(case.folder / "spheres.h5", make_packing(x, np.full((NUMBER, 3), RADIUS)))
    walls = "".join(f"&temperature wall = '{n}', value = {v} /\n"
                    for n, v in (("hot", HOT), ("cold", COLD)))  # fmt: skip
    a = chain_matrix(AT_WALL)
    b = np.zeros(NUMBER)
    b[0], b[-1] = AT_WALL * HOT / HEAT, AT_WALL * COLD / HEAT
    whole, errors = 0.2 * NUMBER**2 / 4.0 * HEAT / BETWEEN, []
    for steps in (STEPS, 2 * STEPS, 4 * STEPS):
        dt = whole / steps
        name = f"chain{steps}"
        fill(case, "chain.nml", chain_words(dt, steps, walls), f"{name}.nml")
        case.run("talus-dem", f"{name}.nml", "--threads=1")
        t = temperatures(case, name)
        exact = integrate(a, b, np.full(NUMBER, START), whole)
        errors.append(float(np.abs(t[-1] - exact).max()))
    stepped = np.full(NUMBER, START)
    for _ in range(4 * STEPS):
        stepped = stepped + dt * (a @ stepped + b)
    off = np.abs(t[-1] - stepped).max() / (HOT - COLD)
    case.below("chain: error against the same steps / (hot - cold)", float(off), ROUND)
    case.below("chain: error against exact integration [K]", errors[-1], 1.0e-3)
    order = np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])
    case.metric("chain: order in the step, 1 and 2", float(order[0]), 1.0, 0.02)
    case.metric("chain: order in the step, 2 and 3", float(order[1]), 1.0, 0.02)
    judge_balance(case, name, t)
    rows = read_history(case.folder / f"{name}_heat.csv")
    mean = integral(a, b, np.full(NUMBER, START), whole)
    for wall, value, end in (("hot", HOT, 0), ("cold", COLD, -1)):
        exact = AT_WALL * (value * whole - mean[end])
        off = abs(rows[f"given_{wall}"][-1] / exact - 1.0)
        case.below(f"chain: heat of the {wall} wall / exact - 1", off, 1.0e-3, "first order in dt")
    case.chain = (t, [integrate(a, b, np.full(NUMBER, START), whole * k / ROWS)
                      for k in range(ROWS + 1)])  # fmt: skip
    judge_bits(case, name)


def temperatures(case: Case, name: str) -> np.ndarray:
    """Return the temperatures of all steps of a field file (steps, grains) [K]."""
    return np.array(
        [step.grains["temperature"] for step in field_steps(case.folder / f"{name}.h5")]
    )


def judge_balance(case: Case, name: str, t: np.ndarray) -> None:
    """Heat that walls have given is that of the grains, and that of the flow at the walls."""
    rows = read_history(case.folder / f"{name}_heat.csv")
    gained = HEAT * (t[-1] - START).sum()
    scale = np.abs(rows["given_hot"][-1])
    case.below("balance: closure / heat of the hot wall",
               float(np.abs(rows["closure"]).max() / scale), 1.0e-9)  # fmt: skip
    off = abs(rows["given"][-1] / gained - 1.0)
    case.below("balance: heat given / heat of the grains - 1", off, 1.0e-9)
    case.metric(
        "mean temperature - that of the field file", rows["mean"][-1] - t[-1].mean(), 0, 1e-9
    )


def judge_bits(case: Case, name: str) -> None:
    """Run on two threads and from a checkpoint."""
    kept = {f"{name}_heat.csv": (case.folder / f"{name}_heat.csv").read_text()}
    shutil.copy(case.folder / f"{name}.h5", case.folder / "one.h5")
    chosen = sorted(case.folder.glob(f"{name}.chk*.h5"), key=lambda p: p.stat().st_mtime)[2]
    shutil.copy(chosen, case.folder / "middle.chk.h5")
    case.run("talus-dem", f"{name}.nml", "--threads=2")
    case.same_histories("two threads", kept, 0.0)
    case.run("talus-dem", f"{name}.nml", "--threads=1", "--restart=middle.chk.h5")
    case.same_histories("restart", kept, 0.0)
    same = float(same_fields(case.folder / "one.h5", case.folder / f"{name}.h5"))
    case.metric("restart: the same bits of temperatures", same, 1.0, 0.0)


def judge_alone(case: Case) -> None:
    """A chain without warm walls, some of which begins hot: the mean stays, modes decay."""
    hot = "&temperature ids = 1, 2, 3, value = 340.0, hold = .false. /\n"
    dt = 0.002 * HEAT / BETWEEN
    fill(case, "chain.nml", chain_words(dt, STEPS, hot), "alone.nml")
    case.run("talus-dem", "alone.nml", "--threads=1")
    t = temperatures(case, "alone")
    first = np.where(np.arange(NUMBER) < 3, 340.0, START)
    case.below("alone: first temperatures [K]", float(np.abs(t[0] - first).max()), 0.0)
    change = abs(t[-1].mean() / first.mean() - 1.0)
    case.below("alone: change of the mean / mean", change, 1.0e-12)
    n, modes = np.arange(NUMBER), np.arange(NUMBER)
    shapes = np.cos(np.pi * np.outer(modes, n + 0.5) / NUMBER)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    decay = (1.0 - 4.0 * 0.002 * np.sin(0.5 * np.pi * modes / NUMBER) ** 2) ** STEPS
    exact = shapes.T @ (decay * (shapes @ first))
    case.below("alone: error against the modes of the chain [K]",
               float(np.abs(t[-1] - exact).max()), 1.0e-8)  # fmt: skip


def judge_cell(case: Case) -> None:
    """A hot sphere of a periodic lattice: heat spreads over the faces of the cell."""
    edge, steps = np.array([5, 4, 3]), 100
    grid = np.array(list(itertools.product(*map(range, edge))))
    x = (grid + 0.25) * PITCH
    write_h5(case.folder / "cell.h5", make_packing(x, np.full((len(x), 3), RADIUS)))
    dt = 0.01 * HEAT / BETWEEN
    edges = ", ".join(f"{v:.17g}" for v in edge * PITCH)
    words = {"T_END": steps * dt, "ROW": steps * dt, "DT": dt, "EDGES": edges}
    fill(case, "torus.nml", words)
    case.run("talus-dem", "torus.nml", "--threads=1")
    exact = np.full(edge, 300.0)
    exact[0, 0, 0] = 400.0
    for _ in range(steps):
        ways = [np.roll(exact, sense, axis) for axis in range(3) for sense in (1, -1)]
        exact = exact + 0.01 * (sum(ways) - 6.0 * exact)
    off = np.abs(temperatures(case, "torus")[-1] - exact.ravel()).max() / 100.0
    case.below("cell: error against the same steps / 100 K", float(off), ROUND)
    case.above("cell: spread of the temperatures at the end [K]", float(np.ptp(exact)), 0.1)


def judge_lattice(case: Case) -> None:
    """Steady flow through a cubic lattice: contacts in series, columns side by side."""
    side, height = 4, 6
    grid = np.array(list(itertools.product(range(side), range(side), range(height))))
    x = grid * PITCH
    write_h5(case.folder / "cubic.h5", make_packing(x, np.full((len(x), 3), RADIUS)))
    low, high = -RADIUS + AT_END, (height - 1) * PITCH + RADIUS - AT_END
    dt = 0.05 * HEAT / BETWEEN
    steps = 8000
    words = {"T_END": steps * dt, "ROW": steps // ROWS * dt, "DT": dt, "LOW": low, "HIGH": high}
    fill(case, "lattice.nml", words)
    case.run("talus-dem", "lattice.nml", "--threads=1")
    rows = read_history(case.folder / "lattice_heat.csv")
    span = rows["time"][-1] - rows["time"][-2]
    flow = np.diff(rows["given_floor"])[-1] / span
    exact = side**2 * 10.0 / (2.0 / AT_QUARTZ + (height - 1) / BETWEEN)
    case.below("lattice: flow of the floor / closed form - 1", abs(flow / exact - 1.0), 1.0e-9)
    out = -np.diff(rows["given_lid"])[-1] / span
    case.below("lattice: flow of the lid / closed form - 1", abs(out / exact - 1.0), 1.0e-9)
    t = temperatures(case, "lattice")[-1].reshape(side, side, height)
    drop = (t[..., 0] - t[..., -1]).mean()
    found = flow / (side * PITCH) ** 2 * (height - 1) * PITCH / drop
    exact = BETWEEN / PITCH
    case.metric("lattice: conductivity [W/(m K)]", float(found), float(exact), 1.0e-9 * exact)
    draw(case, t)


def draw(case: Case, lattice: np.ndarray) -> None:
    """Draw temperatures of the chain over time, and of the lattice over its height."""
    fig, axes = case.figure(ncols=2, figsize=(10.0, 3.8))
    place = np.arange(NUMBER)
    for k in (1, 2, 4, 8):
        line = axes[0].plot(place + 1, case.chain[1][k])[0]
        label = f"{k}/{ROWS} of the time"
        axes[0].plot(place + 1, case.chain[0][k], "o", color=line.get_color(), label=label)
    axes[0].set(xlabel="sphere of the chain", ylabel="temperature [K]")
    axes[0].legend()
    height = lattice.shape[2]
    flow = 10.0 / (2.0 / AT_QUARTZ + (height - 1) / BETWEEN)
    layers = np.arange(height)
    axes[1].plot(layers + 1, 320.0 - flow / AT_QUARTZ - flow / BETWEEN * layers, label="series")
    axes[1].plot(layers + 1, lattice.mean(axis=(0, 1)), "o", label="layers of the lattice")
    axes[1].set(xlabel="layer", ylabel="temperature [K]")
    axes[1].legend()
    case.save(fig)
