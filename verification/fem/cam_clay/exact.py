"""Modified Cam-clay at a point against closed forms."""

import numpy as np

from talus.verification import Case, read_history

M, LAMBDA, KAPPA, V, P0, POISSON = 1.2, 0.2, 0.05, 1.9, 1.0e5, 0.3
CAP = 1 - KAPPA / LAMBDA
RATIO = 1.5 * (1 - 2 * POISSON) / (1 + POISSON)  # shear over bulk modulus
ETAS = np.array([0.36, 0.72, 1.08, 1.188])
STEPS = (1000, 2000, 4000)


def pressure(eta: np.ndarray) -> np.ndarray:
    """Mean stress of the undrained path from isotropic normal consolidation [Pa]."""
    return P0 * (1 + eta**2 / M**2) ** -CAP


def shear_strain(eta: float) -> float:
    """Plastic and elastic shear strain of the undrained path."""
    plastic = KAPPA * CAP / (V * M) * (np.log((M + eta) / (M - eta)) - 2 * np.arctan(eta / M))
    line = np.linspace(0.0, eta, 20001)
    q = line * pressure(line)
    middle = 0.5 * (line[1:] + line[:-1])
    shear = RATIO * V * pressure(middle) / KAPPA
    return float(plastic + np.sum(np.diff(q) / (3 * shear)))


def run_path(case: Case, name: str, steps: int) -> dict[str, np.ndarray]:
    """Run a path in some steps."""
    text = (case.folder / f"{name}.nml").read_text().replace("STEPS", str(steps))
    stem = f"{name}_{steps}"
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def order(errors: list[float]) -> float:
    """Observed order of the first and last of three errors."""
    return float(np.log2(errors[0] / errors[-1]) / 2)


def judge_undrained(case: Case) -> list[dict[str, np.ndarray]]:
    """Judge mean stress and shear strain at four stress ratios, and the critical state."""
    runs = [run_path(case, "undrained", n) for n in STEPS]
    exact = np.array([shear_strain(e) for e in ETAS])
    worst = []
    for found in runs:
        eta = found["q"] / found["p"]
        p = np.interp(ETAS, eta, found["p"]) / pressure(ETAS) - 1
        strain = np.interp(ETAS, eta, 2 / 3 * (found["strain xx"] - found["strain zz"]))
        worst.append((abs(p).max(), float(abs(strain / exact - 1).max())))
    case.below("undrained: p, error", float(worst[-1][0]), 1e-5, "any step is on the path nearly")
    case.below("undrained: shear strain, error", worst[-1][1], 5e-3)
    case.metric("undrained: order of the shear strain", order([w[1] for w in worst]), 1.0, 0.1)
    last = runs[-1]
    case.metric("undrained: p at the end / critical", last["p"][-1] / (P0 * 2**-CAP), 1.0, 5e-3)
    case.above("undrained: least growth of the dissipation",
               float(np.diff(last["dissipation"]).min()), 0.0)  # fmt: skip
    return runs


def judge_constant_p(case: Case) -> None:
    """Judge the plastic volume at four stress ratios."""
    worst = []
    for n in STEPS:
        found = run_path(case, "constant_p", n)
        eta = found["q"] / found["p"]
        volume = -(found["strain xx"] + found["strain yy"] + found["strain zz"])
        wanted = (LAMBDA - KAPPA) / V * np.log(1 + ETAS**2 / M**2)
        worst.append(float(abs(np.interp(ETAS, eta, volume) / wanted - 1).max()))
    case.below("constant p: volume, error", worst[-1], 5e-3)
    case.below("constant p: p, error", float(abs(found["p"] / P0 - 1).max()), 1e-9)


def judge_isotropic(case: Case) -> None:
    """Judge normal and swelling lines."""
    case.run("talus-fem", "isotropic.nml", "--point")
    found = read_history(case.folder / "isotropic_point.csv")
    volume = -(found["strain xx"] + found["strain yy"] + found["strain zz"])
    p = found["p"] / P0
    top = int(np.argmax(p))
    wanted = KAPPA / V * np.log(p) + (LAMBDA - KAPPA) / V * np.log(np.maximum(p / 2, 1.0))
    wanted[top:] = KAPPA / V * np.log(p[top:]) + (LAMBDA - KAPPA) / V * np.log(2.0)
    off = float(abs(volume - wanted).max() / volume.max())
    case.below("isotropic: volume, error / largest", off, 1e-10)
    case.metric("isotropic: preconsolidation / largest p", found["preconsolidation"][-1] / 4e5, 1.0,
                1e-10)  # fmt: skip


def run(case: Case) -> None:
    """Judge all; plot the undrained path."""
    runs = judge_undrained(case)
    judge_constant_p(case)
    judge_isotropic(case)
    fig, ax = case.figure()
    eta = np.linspace(0.0, M, 200)
    ax.plot(pressure(eta) / 1e3, eta * pressure(eta) / 1e3, "-", label="exact")
    found = runs[0]
    ax.plot(found["p"][::20] / 1e3, found["q"][::20] / 1e3, "o", mfc="none", label="Talus")
    p = np.linspace(0.0, 70.0, 2)
    ax.plot(p, M * p, "k--", lw=1, label="critical state")
    ax.set(xlabel="mean stress p [kPa]", ylabel="deviatoric stress q [kPa]")
    ax.legend()
    case.save(fig)
