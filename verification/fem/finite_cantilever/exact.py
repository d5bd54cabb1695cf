"""A cantilever that bends like the elastica."""

import numpy as np
from solid import save

from talus.compare import max_of
from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

YOUNG, LENGTH, HEIGHT, WIDTH = 1.2e7, 10.0, 0.2, 0.2
BENDING = YOUNG * WIDTH * HEIGHT**3 / 12
# Mattiasson 1981, table 1: P L^2/EI, deflection and shortening over L
PUBLISHED = {1.0: (0.30172, 0.05643), 2.0: (0.49346, 0.16064), 5.0: (0.71379, 0.38763),
             10.0: (0.81061, 0.55500)}  # fmt: skip
MESHES = {"hex20": (40, 1, 1), "hex27": (40, 1, 1), "tet10": (40, 1, 1)}
TOP = 10.0


def elastica(load: float) -> tuple[float, float]:
    """Return deflection and shortening over L for a load P L^2/EI (Runge-Kutta, shooting)."""

    def shoot(moment: float) -> np.ndarray:
        y, n = np.array([0.0, moment, 0.0, 0.0]), 400  # angle, its slope, x, z over s/L
        h = 1.0 / n

        def slope(y: np.ndarray) -> np.ndarray:
            return np.array([y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

        for _ in range(n):
            a = slope(y)
            b = slope(y + 0.5 * h * a)
            c = slope(y + 0.5 * h * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + slope(y + h * c))
        return y

    low, high = 0.0, load
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shoot(middle)[1] < 0.0 else (low, middle)
    end = shoot(0.5 * (low + high))
    return float(end[3]), float(1 - end[2])


def bend(case: Case, element: str) -> tuple[np.ndarray, np.ndarray]:
    """Run a mesh; return loads and motion of the middle of the end, over L."""
    mesh = converted(box(np.zeros(3), np.array([LENGTH, WIDTH, HEIGHT]), MESHES[element]), element)
    save(mesh, case.folder / f"mesh_{element}.h5")
    text = (case.folder / "deck.nml").read_text().replace("MESH", f"mesh_{element}")
    pull = TOP * BENDING / LENGTH**2 / (WIDTH * HEIGHT)
    text = text.replace("ELEMENT", element).replace("LOAD", repr(pull))
    (case.folder / f"{element}.nml").write_text(text)
    case.run("talus-fem", f"{element}.nml")
    end = np.isclose(mesh.x[:, 0], LENGTH) & np.isclose(mesh.x[:, 2], 0.0)
    end |= np.isclose(mesh.x[:, 0], LENGTH) & np.isclose(mesh.x[:, 2], HEIGHT)
    steps = field_steps(case.folder / f"{element}.h5")
    moved = np.array([s.solid["u"][end].mean(axis=0) for s in steps]) / LENGTH
    return TOP * np.array([s.time for s in steps]), moved


def judge_newton(case: Case) -> None:
    """Judge and print the iterations of the last step."""
    table = read_history(case.folder / "hex20_newton.csv")
    case.below("iterations of a step, most", float(table["iteration"].max()), 12.0)
    case.metric("steps that were cut", float((table["share of the step"] < 1.0).sum()), 0.0, 0.0)
    last = table["residual"][np.isclose(table["time"], 1.0)]
    print("residuals of the last step:", " ".join(f"{r:.1e}" for r in last))


def run(case: Case) -> None:
    """Judge end motions against the elastica; plot them."""
    fig, ax = case.figure()
    exact = {load: elastica(load) for load in PUBLISHED}
    off = max_of(np.abs(np.subtract(exact[p], PUBLISHED[p])).max() for p in PUBLISHED)
    case.below("elastica by quadrature against the published table", float(off), 1.0e-5)
    line = np.linspace(0.05, TOP, 60)
    curve = np.array([elastica(p) for p in line])
    ax.plot(line, curve[:, 0], "-", label="elastica: deflection")
    ax.plot(line, curve[:, 1], "--", label="elastica: shortening")
    for element, mark in zip(MESHES, "os^", strict=True):
        loads, moved = bend(case, element)
        ax.plot(loads, moved[:, 2], mark, mfc="none", label=element)
        ax.plot(loads, -moved[:, 0], mark, mfc="none", color=ax.lines[-1].get_color())
        for p, (down, short) in exact.items():
            k = int(np.argmin(abs(loads - p)))
            case.metric(f"{element}, P L2/EI = {p:g}: deflection / L", float(moved[k, 2]), down,
                        1e-3)  # fmt: skip
            case.metric(f"{element}, P L2/EI = {p:g}: shortening / L", float(-moved[k, 0]), short,
                        1e-3)  # fmt: skip
    judge_newton(case)
    ax.set(xlabel="P L²/EI [-]", ylabel="motion of the end / L [-]")
    ax.legend(fontsize="small")
    case.save(fig)
