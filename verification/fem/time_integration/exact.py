"""Recurrences of the schemes for m a + c v + k u = f, against the programs."""

import shutil

import numpy as np
from solid import save

from talus.mesh import box
from talus.verification import Case, field_steps, read_history

RAYLEIGH = ", rayleigh_mass = 1.5, rayleigh_stiffness = 0.002"
K, MASS, F, DT, STEPS = 1000.0, 1.0, -10.0, 0.02, 100
RUNS = {  # deck, then beta, gamma, -alpha, and Rayleigh's factors
    "newmark": ("kind = 'newmark'", 0.25, 0.5, 0.0, 0.0, 0.0),
    "dissipative newmark": (
        "kind = 'newmark', beta = 0.3025, gamma = 0.6", 0.3025, 0.6, 0.0, 0.0, 0.0
    ),
    "hht": ("kind = 'hht', alpha = -0.2", 0.36, 0.7, 0.2, 0.0, 0.0),
    "rayleigh": ("kind = 'hht', alpha = 0.0" + RAYLEIGH, 0.25, 0.5, 0.0, 1.5, 0.002),
    "damped hht": ("kind = 'hht', alpha = -0.1" + RAYLEIGH, 0.3025, 0.6, 0.1, 1.5, 0.002),
}  # fmt: skip


def implicit(beta: float, gamma: float, lag: float, a: float, b: float) -> np.ndarray:
    """Displacements of the recurrence of HHT (lag = -alpha); Newmark is lag = 0."""
    m = MASS
    c = a * m + b * K
    u, v, acc = 0.0, 0.0, F / m
    found = [u]
    for _ in range(STEPS):
        up = u + DT * v + DT * DT * (0.5 - beta) * acc
        vp = v + DT * (1 - gamma) * acc
        matrix = m + (1 - lag) * (gamma * DT * c + beta * DT * DT * K)
        right = (1 - lag) * (F - c * vp - K * up) + lag * (F - c * v - K * u)
        acc = right / matrix
        u, v = up + beta * DT * DT * acc, vp + gamma * DT * acc
        found.append(u)
    return np.array(found)


def central(mass: float, dt: float, a: float, b: float) -> np.ndarray:
    """Displacements of central differences; a M at whole steps, b K half a step late."""
    u, v, acc = 0.0, 0.0, F / mass
    found = [u]
    for _ in range(round(STEPS * DT / dt)):
        v += 0.5 * dt * acc
        u += dt * v
        acc = (F - K * u - b * K * v - a * mass * v) / (mass * (1 + 0.5 * dt * a))
        v += 0.5 * dt * acc
        found.append(u)
    return np.array(found)


def solve(case: Case, name: str, analysis: str) -> np.ndarray:
    """Run one scheme, whole and from its checkpoint; return the displacement of the top."""
    text = (case.folder / "deck.nml").read_text().replace("ANALYSIS", f"{analysis}, dt = {DT}")
    stem = name.replace(" ", "_")
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    whole = field_steps(case.folder / f"{stem}.h5")
    energy = read_history(case.folder / f"{stem}_energy.csv")
    scale = abs(energy["load"]).max()
    case.below(
        f"{name}: ledger, error / largest", float(abs(energy["closure"]).max() / scale), 1e-10
    )
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{stem}*.csv")}
    shutil.copy(case.folder / f"{stem}.chk.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / f"{stem}.h5")
    same = all((a.solid["u"] == b.solid["u"]).all() for a, b in zip(whole, again, strict=True))
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    case.metric(f"{name}: restart repeats every bit", float(same), 1.0, 0)
    return np.array([s.solid["u"][-1, 2] for s in whole]), energy


def run(case: Case) -> None:
    """Judge every scheme; plot the displacements."""
    save(box(np.zeros(3), np.ones(3), (1, 1, 1)), case.folder / "brick.h5")
    fig, ax = case.figure()
    time = DT * np.arange(STEPS + 1)
    for name, (analysis, *numbers) in RUNS.items():
        found, energy = solve(case, name, analysis)
        exact = implicit(*numbers)
        off = float(abs(found - exact).max() / abs(exact).max())
        case.below(f"{name}: displacement, error / largest", off, 1e-9)
        if name in ("hht", "newmark", "rayleigh"):
            ax.plot(time, exact * 1e3, "-", lw=1, color="0.6")
            ax.plot(time, found * 1e3, ".", ms=4, label=name)
        if name == "hht":
            case.above("hht: dissipated by the scheme [J]", float(energy["numerical"][-1]), 1e-3)
        if name == "newmark":
            lost = float(abs(energy["numerical"]).max())
            case.below("newmark: dissipated by the scheme [J]", lost, 1e-15)
    # central differences: the mass is lumped, half of the brick's mass moves
    lumped = 1.5
    for name, extra, a, b in (
        ("explicit", "", 0.0, 0.0),
        ("damped explicit", RAYLEIGH, 1.5, 0.002),
    ):
        found, _ = solve(case, name, "kind = 'explicit'" + extra)
        exact = central(lumped, DT, a, b)
        off = float(abs(found - exact).max() / abs(exact).max())
        case.below(f"{name}: displacement, error / largest", off, 1e-9)
    text = (case.folder / "deck.nml").read_text().replace("ANALYSIS", "kind = 'explicit', dt = 0.2")
    (case.folder / "long.nml").write_text(text)
    refused = case.run("talus-fem", "long.nml", expect=1)
    case.metric("a step above the critical one is refused", float("D324" in refused.stderr), 1.0, 0)
    ax.set(xlabel="time [s]", ylabel="displacement [mm]")
    ax.set_ylim(top=5.0)
    ax.legend(ncols=4, loc="upper center")
    case.save(fig)
