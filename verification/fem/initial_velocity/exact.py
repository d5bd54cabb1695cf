"""Bars and micro-rotations from initial velocities, and from initial displacements."""

import shutil

import numpy as np
from solid import save

from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

YOUNG, RHO, LENGTH, V, SIDE, CELLS = 2.0e8, 2000.0, 5.0, 2.0, 0.25, 100
SPEED = np.sqrt(YOUNG / RHO)
PERIOD = 4.0 * LENGTH / SPEED
OMEGA = np.sqrt(2.0 * 3.0e4 / (1500.0 * 4.0e-4))
KINDS = {
    "explicit": "kind = 'explicit'",
    "newmark": "kind = 'newmark', dt = 5.0e-5",
    "hht": "kind = 'hht', dt = 5.0e-5, alpha = -0.05",
}
STRAIN = 1.0e-3
LAWS = {
    "linear": "law = 'linear_elastic'",
    "with a state": "law = 'drucker_prager', cohesion = 1.0e9, friction_deg = 0.0",
}
SPINS = {"explicit": "kind = 'explicit'", "newmark": "kind = 'newmark', dt = 2.0e-5"}
MARKS = {"explicit": "o", "newmark": "s", "hht": "^"}


def triangle(time: np.ndarray) -> np.ndarray:
    """End displacement over v L/c: a triangle that starts downwards."""
    phase = np.mod(time / PERIOD + 0.25, 1.0)
    return 4.0 * np.abs(phase - 0.5) - 1.0


def solve(case: Case, deck: str, kind: str, analysis: str, law: str = "") -> tuple[list, dict]:
    """Run one deck; judge its ledger; return the steps of its fields and its history."""
    name = f"{deck}_{kind}".replace(" ", "_").replace(",", "")
    text = (case.folder / f"{deck}.nml").read_text().replace("ANALYSIS", analysis)
    text = text.replace("LAW", law)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    energy = read_history(case.folder / f"{name}_energy.csv")
    start = float(energy["kinetic"][0] + energy["strain"][0])
    error = float(abs(energy["closure"]).max() / start)
    case.below(f"{deck}, {kind}: ledger, error / energy at the start", error, 1e-9)
    return field_steps(case.folder / f"{name}.h5"), energy


def judge_restart(case: Case, whole: list) -> None:
    """Go on from the checkpoint of the explicit bar; what follows must be the same bits."""
    shutil.copy(case.folder / "bar_explicit.chk.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", "bar_explicit.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / "bar_explicit.h5")
    same = all((a.solid["u"] == b.solid["u"]).all() for a, b in zip(whole, again, strict=True))
    case.metric("bar, explicit: restart repeats every bit", float(same), 1.0, 0)


def judge_stretched(case: Case, end: np.ndarray, ax: object) -> None:
    """Judge a bar that is let go stretched: its end goes from one side to the other and back."""
    for law, words in LAWS.items():
        for kind, analysis in KINDS.items():
            label = f"{kind}, {law}"
            steps, energy = solve(case, "stretched", label, analysis, words)
            time = np.array([s.time for s in steps])
            u = np.array([s.solid["u"][end, 2].mean() for s in steps]) / (STRAIN * LENGTH)
            exact = 4.0 * np.abs(np.mod(time / PERIOD, 1.0) - 0.5) - 1.0
            off = float(abs(u - exact).max())
            case.below(f"stretched, {label}: end displacement, error / (strain L)", off, 0.03)
            begun = float(energy["strain"][0] / (0.5 * YOUNG * SIDE**2 * LENGTH * STRAIN**2))
            case.metric(f"stretched, {label}: energy at the start / exact", begun, 1.0, 1e-9)
            stress = steps[0].solid["stress"][:, 2] / (YOUNG * STRAIN)
            off = float(abs(stress - 1.0).max())
            case.below(f"stretched, {label}: stress at the start / exact - 1", off, 1e-12)
    ax.plot(time / PERIOD, u, "C4.", ms=3, label="stretched bar, hht")
    ax.plot(time / PERIOD, exact, "C4-", lw=0.8)


def run(case: Case) -> None:
    """Judge end displacement and wall force of the bar, and the spin; plot both."""
    mesh = box(np.zeros(3), np.array([SIDE, SIDE, LENGTH]), (1, 1, CELLS))
    save(mesh, case.folder / "bar.h5")
    end = np.isclose(mesh.x[:, 2], LENGTH)
    fig, ax = case.figure()
    for kind, analysis in KINDS.items():
        steps, energy = solve(case, "bar", kind, analysis)
        time = np.array([s.time for s in steps])
        u = np.array([s.solid["u"][end, 2].mean() for s in steps]) * SPEED / (V * LENGTH)
        off = float(abs(u - triangle(time)).max())
        case.below(f"bar, {kind}: end displacement, error / (v L/c)", off, 0.03)
        begun = float(energy["kinetic"][0] / (0.5 * RHO * SIDE**2 * LENGTH * V**2))
        # the held end: half an element of lumped mass, two thirds of one of the consistent energy
        held = (1 / 2 if kind == "explicit" else 2 / 3) / CELLS
        case.metric(
            f"bar, {kind}: kinetic energy at the start / (m v^2/2)", begun, 1.0 - held, 1e-9
        )
        reaction = read_history(case.folder / f"bar_{kind}_reactions.csv")
        t, push = reaction["time"], reaction["z0 z"]
        early = (t > 0) & (t < 1.9 * LENGTH / SPEED)
        mean = float(push[early].mean() / (RHO * SPEED * V * SIDE**2))
        case.metric(f"bar, {kind}: mean wall force / (rho c v A)", mean, 1.0, 0.01)
        ax.plot(time / PERIOD, u, MARKS[kind], ms=3, mfc="none", markevery=6, label=f"bar, {kind}")
        if kind == "explicit":
            judge_restart(case, steps)
    ax.plot(time / PERIOD, triangle(time), "k-", lw=1, label="d'Alembert")
    judge_stretched(case, end, ax)
    save(converted(box(np.zeros(3), np.full(3, 0.1), (2, 2, 2)), "hex20"), case.folder / "block.h5")
    for kind, analysis in SPINS.items():
        steps, _ = solve(case, "spin", kind, analysis)
        time = np.array([s.time for s in steps])
        phi = np.array([s.solid["phi"][:, 2] for s in steps]) * OMEGA / 0.3
        off = float(abs(phi - np.sin(OMEGA * time)[:, None]).max())
        case.below(f"spin, {kind}: micro-rotation, error / amplitude", off, 1e-3)
        steps, _ = solve(case, "turned", kind, analysis)
        turned = np.array([s.solid["phi"][:, 2] for s in steps]) / 3.0e-4
        off = float(abs(turned - np.cos(OMEGA * time)[:, None]).max())
        case.below(f"turned, {kind}: micro-rotation, error / amplitude", off, 1e-3)
    ax.plot(time / PERIOD, phi.mean(axis=1), "C3+", ms=5, label="micro-rotation, newmark")
    ax.plot(time / PERIOD, np.sin(OMEGA * time), "C3-", lw=0.8, label="sine")
    ax.set(xlabel="time / (4 L/c) [-]", ylabel="displacement, rotation / amplitude [-]")
    ax.legend(fontsize=7)
    case.save(fig)
