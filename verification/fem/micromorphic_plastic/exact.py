"""Micromorphic friction at a point: triaxial compression to the closed form, five surfaces."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, read_history

YOUNG, POISSON, COHESION, CONFINED, HARDENING = 1.0e8, 0.25, 2.0e4, 1.0e5, 5.0e5
FRICTION, DILATION = np.deg2rad(35.0), np.deg2rad(10.0)
Q_YIELD = 345856.518293  # closed form of drained triaxial compression
# closed form of drained triaxial compression: axial compression, q, radial tension, hardening
# variable
LAST = (0.02, 418278.404831, 0.0122781070601, 0.0377004478705)
# unit tests of tardigrade-micromorphic-elasto-plasticity: angle [rad], shape, cohesion, and the
# factors of the cone
O14 = {"angle": 0.46, "shape": 0.34, "cohesion": 0.51, "A": 1.39315236742, "B": 0.690235625633}
STIFF = (1.0, 10.0, 100.0, 1000.0)


def moduli(stiff: float) -> dict[str, float]:
    """Return seven moduli that leave E and nu where chi is free and homogeneous."""
    shear, bulk = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
    m = {"ETA": 8e7, "TAU": 1e7, "KAPPA": 6e7, "NU": 4e7, "SIGMA": 2e7}
    s = m["KAPPA"] + m["NU"] - 2 * m["SIGMA"]
    b = m["KAPPA"] + m["NU"] + 3 * m["ETA"] - 3 * m["TAU"] - 2 * m["SIGMA"]
    m["MU"] = shear + 2 * m["SIGMA"] ** 2 / s
    m["LAMBDA"] = bulk + (3 * m["TAU"] + 2 * m["SIGMA"]) ** 2 / (3 * b) - 2 * m["MU"] / 3
    m["HARDENING"] = HARDENING
    return {name: stiff * value for name, value in m.items()}


def triaxial(case: Case, level: str, stiff: float) -> dict[str, np.ndarray]:
    """Run one compression; strains from the confined state, times the stiffness."""
    text = (case.folder / "triaxial.nml").read_text().replace("LEVEL", level)
    for name, value in moduli(stiff).items():
        text = text.replace(f" {name}", f" {float(value)!r}")
    name = f"{level}_{stiff:.0f}"
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", "--point")
    found = read_history(case.folder / f"{name}_point.csv")
    start = int(np.argmin(abs(found["time"] - 0.1)))
    z = found["Z 1"] if level == "macro" else found["Z 2"]
    rows = {
        "q": found["P 11"][start:] - found["P 33"][start:],
        "axial": -stiff * (found["F 33"][start:] - found["F 33"][start]),
        "radial": stiff * (found["F 11"][start:] - found["F 11"][start]),
        "Z": stiff * z[start:],
    }
    return rows | {"dissipated": found["dissipated"]}


def exact(q: np.ndarray) -> dict[str, np.ndarray]:
    """Return the strains of the closed form at a deviatoric stress."""
    past = np.maximum(0.0, (q - Q_YIELD) / (LAST[1] - Q_YIELD))
    elastic = np.minimum(q, Q_YIELD) / YOUNG
    return {
        "axial": elastic + past * (LAST[0] - Q_YIELD / YOUNG),
        "radial": POISSON * elastic + past * (LAST[2] - POISSON * Q_YIELD / YOUNG),
        "Z": past * LAST[3],
    }


def judge_triaxial(case: Case, level: str) -> tuple[dict, list[float]]:
    """Judge the limit of small strains and the order in which it is reached."""
    off = []
    for stiff in STIFF:
        found = triaxial(case, level, stiff)
        wanted = exact(found["q"])
        scale = {"axial": LAST[0], "radial": LAST[2], "Z": LAST[3]}
        inside = found["q"] <= LAST[1]
        errors = [float(abs(found[k] - wanted[k])[inside].max() / scale[k]) for k in scale]
        off.append(max_of(errors))
        if stiff == STIFF[0]:
            first = found
    for name, error in zip(("axial strain", "radial strain", "Z"), errors, strict=True):
        case.below(f"{level}, strains of 1e-5: {name}, error / largest", error, 1e-3)
    order = float(np.log10(off[-2] / off[-1]))
    case.metric(f"{level}: order of the difference in the strain", order, 1.0, 0.05)
    case.above(
        f"{level}: least growth of the dissipation", float(np.diff(found["dissipated"]).min()), 0.0
    )
    return first, off


def judge_levels(case: Case) -> None:
    """Judge yields, dissipation and the balance of energy with five surfaces."""
    missing = []
    for steps in (100, 200, 400):
        text = (case.folder / "levels.nml").read_text().replace("STEPS", str(steps))
        (case.folder / f"levels_{steps}.nml").write_text(text)
        case.run("talus-fem", f"levels_{steps}.nml", "--point")
        found = read_history(case.folder / f"levels_{steps}_point.csv")
        parts = found["stored"] + found["dissipated"] + found["shifted"]
        missing.append(float(1 - parts[-1] / found["work"][-1]))
    worst = max_of(float(found[f"yield {k}"].max()) for k in range(1, 6))
    case.below("five surfaces: largest yield function [MPa]", worst, 1e-9)
    for k in range(1, 6):
        case.above(f"five surfaces: steps on surface {k}", float(found[f"active {k}"].sum()), 20.0)
    case.above(
        "five surfaces: least growth of the dissipation",
        float(np.diff(found["dissipated"]).min()),
        0.0,
    )
    case.below("five surfaces: work not found, 400 steps / work", abs(missing[2]), 5e-3)
    limit = abs(2 * missing[2] - missing[1])
    case.below("five surfaces: work not found, in the limit / work", limit, 5e-4)


def judge_cone(case: Case) -> None:
    """Judge A and B of a cone by its yield function without stress and under pressure alone."""
    angle = float(np.rad2deg(O14["angle"]))
    text = f"""&run title = 'A cone' /
&micromorphic lambda = 10.0, mu = 7.0, eta = 3.0, tau = 1.0, kappa = 6.0, nu = 4.0, sigma = 0.5 /
&cone level = 'macro', cohesion = {O14["cohesion"]}, friction_deg = {angle!r},
  dilation_deg = {angle!r}, shape = {O14["shape"]} /
&curve id = 'ramp', times = 0.0, 1.0, values = 0.0, 1.0 /
&micro_point steps = 1 /
"""
    for k in "123":
        text += f"&micro_control component = 'F{k}{k}', curve = 'ramp', scale = -0.01 /\n"
    (case.folder / "cone.nml").write_text(text)
    case.run("talus-fem", "cone.nml", "--point")
    found = read_history(case.folder / "cone_point.csv")
    a = -found["yield 1"][0] / O14["cohesion"]
    case.metric("O14: A", float(a), O14["A"], 1e-10)
    pressure = found["F 11"][1] ** 2 * found["S 11"][1]
    b = (found["yield 1"][1] + a * O14["cohesion"]) / pressure
    case.metric("O14: B", float(b), O14["B"], 1e-10)


def run(case: Case) -> None:
    """Judge all; plot the compressions and how they reach the closed form."""
    first, off = judge_triaxial(case, "macro")
    _, micro = judge_triaxial(case, "micro")
    judge_levels(case)
    judge_cone(case)
    fig, ax = case.figure()
    q = np.array([0.0, Q_YIELD, LAST[1]])
    ax.plot(100 * exact(q)["axial"], q / 1e3, "-", label="closed form")
    stiff = triaxial(case, "macro", 100.0)
    for found, mark, label in ((first, "o", "100 MPa"), (stiff, "x", "10 GPa (strain x 100)")):
        few = np.r_[0 : len(found["q"]) - 12 : 6, len(found["q"]) - 12 : len(found["q"])]
        x, y = 100 * found["axial"][few], found["q"][few] / 1e3
        ax.plot(x, y, mark, mfc="none", label=f"Talus, E = {label}")
    ax.set(xlabel="axial compression [%]", ylabel="deviatoric stress q [kPa]")
    ax.legend()
    case.save(fig)
    fig, ax = case.figure()
    strain = 0.02 / np.array(STIFF)
    ax.loglog(strain, off[-1] * strain / strain[-1], "-", label="first order")
    ax.loglog(strain, off, "o", mfc="none", label="Talus, macro-cone")
    ax.loglog(strain, micro, "x", label="Talus, micro-cone")
    ax.set(xlabel="largest strain [-]", ylabel="difference from small strains [-]")
    ax.legend()
    case.save(fig, "limit.png")
