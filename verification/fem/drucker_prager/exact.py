"""Drucker-Prager at a point: triaxial compression, the apex, plane strain."""

import numpy as np

from talus.verification import Case, read_history

YOUNG, POISSON, COHESION, HARDENING, CONFINED = 1.0e8, 0.25, 2.0e4, 5.0e5, 1.0e5
BULK, SHEAR = YOUNG / (3 * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
# closed form of drained triaxial compression: axial compression, q, radial tension, hardening
# variable
PATH = [
    (0.001, 100000.0, 0.00025, 0.0),
    (0.002, 200000.0, 0.0005, 0.0),
    (0.004, 348227.03399, 0.00123822725225, 0.00123401236482),
    (0.006, 356983.455346, 0.00261821222823, 0.00579231680304),
    (0.01, 374496.298056, 0.0053781821802, 0.0149089256795),
    (0.02, 418278.404831, 0.0122781070601, 0.0377004478705),
]
Q_YIELD = 345856.518293


def constants(degrees: float) -> tuple[float, float]:
    """A and B of the cone of triaxial compression."""
    angle = np.deg2rad(degrees)
    beta = 2 * np.sqrt(6) / (3 - np.sin(angle))
    return beta * np.cos(angle), beta * np.sin(angle)


def judge_growth(case: Case, name: str, found: dict[str, np.ndarray]) -> None:
    """Judge that dissipation never falls and that the works add up."""
    growth = float(np.diff(found["dissipation"]).min())
    case.above(f"{name}: least growth of the dissipation", growth, 0.0)
    work = 0.0
    for kl in ("xx", "yy", "zz", "xy", "yz", "zx"):
        stress, strain = found[f"stress {kl}"], found[f"strain {kl}"]
        work += np.sum(0.5 * (stress[1:] + stress[:-1]) * np.diff(strain))
    parts = found["stored_energy"] + found["dissipation"] + found["numerical"]
    case.metric(f"{name}: works / trapezoids of the path", float(parts[-1] / work), 1.0, 1e-10)


def judge_triaxial(case: Case) -> dict[str, np.ndarray]:
    """Judge against the closed form of the reference."""
    case.run("talus-fem", "triaxial.nml", "--point")
    found = read_history(case.folder / "triaxial_point.csv")
    row = [int(np.argmin(abs(found["strain zz"] + p[0]))) for p in PATH]
    wanted = np.array(PATH)
    for name, values, exact in (
        ("q", found["q"][row], wanted[:, 1]),
        ("radial strain", found["strain xx"][row], wanted[:, 2]),
        ("hardening variable", found["hardening"][row], wanted[:, 3]),
    ):
        off = float(abs(values - exact).max() / abs(exact).max())
        case.below(f"triaxial: {name}, error / largest", off, 1e-8)
    plastic = found["yield"] > 0
    slope = np.polyfit(-found["strain zz"][plastic], found["q"][plastic], 1)
    at_yield = slope[1] / (1 - slope[0] / YOUNG)  # where the line meets E strain
    case.metric("triaxial: q at yield / Mohr-Coulomb", float(at_yield) / Q_YIELD, 1.0, 1e-8)
    judge_growth(case, "triaxial", found)
    judge_tangent(case, found)
    return found


def judge_tangent(case: Case, found: dict[str, np.ndarray]) -> None:
    """Judge the elastic tangent, that of the flow along the path, which is linear, and in shear."""
    names = ("xx", "yy", "zz", "xy", "yz", "zx")
    tangent = np.array([[found[f"stress {a} by strain {b}"] for b in names] for a in names])
    elastic = np.zeros((6, 6))
    elastic[:3, :3] = BULK - 2 / 3 * SHEAR + 2 * SHEAR * np.eye(3)
    elastic[3:, 3:] = SHEAR * np.eye(3)
    off = max(abs(tangent[..., k] - elastic).max() for k in (0, 1))
    case.below("tangent before yield, error / largest", float(off / elastic.max()), 1e-12)
    strain = np.array([found[f"strain {a}"] for a in names])
    stress = np.array([found[f"stress {a}"] for a in names])
    flowing = np.flatnonzero((found["yield"][1:] > 0) & (found["yield"][:-1] > 0)) + 1
    off = max(
        abs(tangent[..., k] @ (strain[:, k] - strain[:, k - 1]) - stress[:, k] + stress[:, k - 1])
        .max() for k in flowing
    )  # fmt: skip
    case.below("tangent of flow by the step, error / largest stress", float(off / 5e5), 1e-9)
    off = []
    for k in flowing:  # the return shortens the deviator and leaves its direction
        step = strain[:3, k] - strain[:3, k - 1]
        deviator, before = (s - s.mean() for s in (stress[:3, k], stress[:3, k - 1]))
        trial = before + 2 * SHEAR * (step - step.mean())
        wanted = SHEAR * np.linalg.norm(deviator) / np.linalg.norm(trial)
        off.append(abs(tangent[3, 3, k] / wanted - 1))
    case.below("tangent of flow in shear / exact - 1", float(max(off)), 1e-9)
    skew = abs(tangent[0, 2, -1] - tangent[2, 0, -1]) / SHEAR
    case.above("tangent of flow: not symmetric where dilation is not friction", float(skew), 0.05)


def judge_expansion(case: Case) -> None:
    """Judge the mean stress at the apex, which hardens with the dilation."""
    case.run("talus-fem", "expansion.nml", "--point")
    found = read_history(case.folder / "expansion_point.csv")
    (a, b), (a_flow, b_flow) = constants(35.0), constants(10.0)
    volume = 3 * found["strain xx"]
    share = a / b * a_flow / b_flow * HARDENING
    grown = np.maximum(0.0, (BULK * volume - a / b * COHESION) / (BULK + share))
    off = abs(-found["p"] - (BULK * volume - BULK * grown)).max()
    case.below("apex: mean stress, error / largest", float(off / abs(found["p"]).max()), 1e-8)
    case.metric("apex: flag at the end", float(found["yield"][-1]), 2.0, 0.0)
    judge_growth(case, "apex", found)


def judge_plane(case: Case, friction: float, dilation: float) -> None:
    """Judge the strength in plane strain: Mohr and Coulomb's of the same constants."""
    name = f"plane_{friction:.0f}_{dilation:.0f}"
    text = (case.folder / "plane.nml").read_text()
    text = text.replace("FRICTION", str(friction)).replace("DILATION", str(dilation))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", "--point")
    found = read_history(case.folder / f"{name}_point.csv")
    s = np.sin(np.deg2rad(friction))
    wanted = CONFINED * (1 + s) / (1 - s) + 2 * COHESION * np.sqrt((1 + s) / (1 - s))
    label = f"plane strain, {friction:.0f} / {dilation:.0f} degrees"
    case.metric(f"{label}: peak / exact", float(-found["stress zz"][-1] / wanted), 1.0, 1e-6)
    judge_growth(case, label, found)


def run(case: Case) -> None:
    """Judge all; plot the triaxial path."""
    found = judge_triaxial(case)
    judge_expansion(case)
    for friction, dilation in ((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (35.0, 10.0), (35.0, -8.0)):
        judge_plane(case, friction, dilation)
    fig, ax = case.figure()
    exact = np.array([(0.0, 0.0), (Q_YIELD / YOUNG, Q_YIELD), PATH[-1][:2]])
    ax.plot(100 * exact[:, 0], exact[:, 1] / 1e3, "-", label="exact")
    ax.plot(-100 * found["strain zz"], found["q"] / 1e3, "o", mfc="none", label="Talus")
    ax.set(xlabel="axial compression [%]", ylabel="deviatoric stress q [kPa]")
    ax.legend()
    case.save(fig)
