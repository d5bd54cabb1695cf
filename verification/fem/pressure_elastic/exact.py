"""Pressure-dependent elasticity in confined compression."""

import numpy as np

from talus.verification import Case, read_history

YOUNG, POISSON, REFERENCE, LEAST, START = 5.0e7, 0.25, 1.0e5, 5.0e3, 1.0e3
BULK = YOUNG / (3 * (1 - 2 * POISSON))
RATIO = 1.5 * (1 - 2 * POISSON) / (1 + POISSON)  # shear over bulk modulus


def pressure(exponent: float, compression: np.ndarray) -> np.ndarray:
    """Mean stress from START: a straight line up to LEAST, then the integral of dp/K [Pa]."""
    soft = BULK * (LEAST / REFERENCE) ** exponent
    beyond = np.maximum(compression - (LEAST - START) / soft, 0.0)
    line = START + soft * np.minimum(compression, (LEAST - START) / soft)
    if exponent == 1.0:
        return (
            line
            - LEAST * (beyond > 0)
            + np.where(beyond > 0, LEAST * np.exp(BULK / REFERENCE * beyond), 0.0)
        )
    power = 1 - exponent
    grown = (LEAST / REFERENCE) ** power + power * BULK / REFERENCE * beyond
    return line + REFERENCE * grown ** (1 / power) - LEAST


def judge(case: Case, exponent: float, steps: int) -> dict[str, np.ndarray]:
    """Judge mean and deviatoric stress; q = 2 G_mean strain = 2 ratio (p - START)."""
    name = f"n_{exponent}_{steps}".replace(".", "_")
    text = (case.folder / "deck.nml").read_text()
    text = text.replace("EXPONENT", str(exponent)).replace("STEPS", str(steps))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", "--point")
    found = read_history(case.folder / f"{name}_point.csv")
    wanted = pressure(exponent, -found["strain zz"])
    label = f"n = {exponent}, {steps} steps"
    off = abs(found["p"] - wanted).max() / wanted.max()
    case.below(f"{label}: p, error / largest", float(off), 1e-11)
    q = 2 * RATIO * (wanted - START)
    off = abs(found["q"] - q).max() / q.max()
    case.below(f"{label}: q, error / largest", float(off), 1e-11)
    return found


def run(case: Case) -> None:
    """Judge three exponents in few and in many steps; plot."""
    fig, ax = case.figure()
    line = np.linspace(0.0, 0.004, 200)
    for exponent, mark in ((0.0, "o"), (0.5, "s"), (1.0, "^")):
        judge(case, exponent, 4)
        found = judge(case, exponent, 40)
        ax.plot(100 * line, pressure(exponent, line) / 1e3, "-", label=f"exact, n = {exponent}")
        ax.plot(-100 * found["strain zz"], found["p"] / 1e3, mark, mfc="none", label="Talus")
    ax.set(xlabel="compression [%]", ylabel="mean stress p [kPa]")
    ax.legend()
    case.save(fig)
