"""Impacts under the laws linear, hertz_no_history and hertz_mindlin against closed forms."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON = 5.0e-3, 2650.0, 1.0e8, 0.25
MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3
KN, KT = 2.0e4, 1.2e4
E_STAR = YOUNG / (2 * (1 - POISSON**2))
LINEAR = f"'linear', normal_stiffness = {KN}, tangential_stiffness = {KT}"
LAWS = {"linear": LINEAR, "hertz_no_history": "'hertz_no_history'",
        "hertz_mindlin": "'hertz_mindlin'"}  # fmt: skip


def contact_time(law: str, speed: float) -> float:
    """Duration of an elastic impact [s]."""
    if law == "linear":
        return np.pi * np.sqrt(MASS / KN)
    overlap = (15 * MASS * speed**2 / (16 * E_STAR * np.sqrt(RADIUS))) ** 0.4
    return 2.9432683 * overlap / speed


def thrown(case: Case, name: str, law: str, v: list[float], mu: float, damping: str) -> tuple:
    """Throw a sphere on the plane; return velocity and spin after, and the energies."""
    time = contact_time(law, -v[2])
    words = {
        "LAW": LAWS[law], "MU": f"{mu}", "DAMPING": damping, "END": f"{2.5 * time:.12e}",
        "STEP": f"{time / 4000:.12e}", "ROW": f"{time / 400:.12e}",
    }  # fmt: skip
    deck = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        deck = deck.replace(word, value)
    (case.folder / f"{name}.nml").write_text(deck)
    write_packing(
        case.folder / "pack.h5", np.array([[0.0, 0.0, RADIUS]]), np.full((1, 3), RADIUS),
        v=np.array([v]),
    )  # fmt: skip
    case.run("talus-dem", f"{name}.nml")
    last = field_steps(case.folder / f"{name}.h5")[-1].grains
    rows = read_history(case.folder / f"{name}_energy.csv")
    closure = np.abs(rows["closure_error"]).max() / (0.5 * MASS * sum(c * c for c in v))
    case.below(f"{name}: closure / first energy", float(closure), 1e-5)
    return last["v"][0], last["omega"][0], rows


def head_on(case: Case, ax: object) -> None:
    """Judge restitution of all laws, and the linear impact along its way."""
    asked = [0.95, 0.7, 0.4, 0.2]
    for law, mark in zip(LAWS, "osx", strict=True):
        found = []
        for e in asked:
            v, _, _ = thrown(case, f"{law}_{e}", law, [0, 0, -0.5], 0.3, f"restitution = {e}")
            found.append(v[2] / 0.5)
            case.metric(f"{law}: restitution {e}", found[-1], e, 1e-3)
        ax.plot(asked, found, mark, label=law)
    ax.plot([0, 1], [0, 1], "-", label="asked for")
    ax.set(xlabel="restitution asked for", ylabel="restitution")
    ax.legend()


def linear_way(case: Case, ax: object) -> None:
    """Judge duration and largest energy of linear impacts at two speeds, and their course."""
    for speed in (0.05, 1.0):
        v, _, rows = thrown(case, f"way_{speed}", "linear", [0, 0, -speed], 0.0,
                            "damping_ratio = 0.1")  # fmt: skip
        ratio, w = 0.1, np.sqrt(KN / MASS)
        damped = w * np.sqrt(1 - ratio**2)
        end = np.arctan2(2 * ratio * np.sqrt(1 - ratio**2), 2 * ratio**2 - 1) / damped
        swing = np.cos(damped * end) - ratio * w / damped * np.sin(damped * end)
        e = -np.exp(-ratio * w * end) * swing
        case.metric(f"linear, {speed} m/s: restitution / exact", v[2] / speed / e, 1.0, 1e-3)
        time = rows["time"]
        depth = speed / damped * np.exp(-ratio * w * time) * np.sin(damped * time)
        wanted = np.where(time < end, 0.5 * KN * depth**2, 0.0) / (0.5 * MASS * speed**2)
        got = rows["elastic"] / (0.5 * MASS * speed**2)
        early = time < 0.98 * end
        off = np.abs(got - wanted)[early].max()
        case.below(f"linear, {speed} m/s: largest error of the energy / first", off, 2e-3)
    ax.plot(time * 1e3, wanted, "-", label="damped oscillator")
    ax.plot(time[::20] * 1e3, got[::20], "o", label="Talus")
    ax.set(xlabel="time [ms]", ylabel="elastic / first energy")
    ax.legend()


def oblique(case: Case, ax: object) -> None:
    """Judge tangential forces: a spring of its own stiffness, dashpots, sliding."""
    v, _, _ = thrown(case, "stuck", "linear", [0.008, 0, -0.02], 1e3, "damping_ratio = 0.0")
    # the contact point swings: 1/m + R^2/I = 7/(2 m), for half a period of the normal motion
    swing = np.sqrt(3.5 * KT / MASS) * contact_time("linear", 0.5)
    taken = 0.008 / 3.5 * (1 - np.cos(swing))
    case.metric("linear, stuck: speed taken / exact", (0.008 - v[0]) / taken, 1.0, 5e-3,
                "the overlap shortens the arm by 0.05 % at most")  # fmt: skip
    speeds = np.array([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
    for law, mark in (("hertz_no_history", "s"), ("linear", "o")):
        lost = []
        for speed in speeds:
            v, _, _ = thrown(case, f"{law}_oblique_{speed}", law, [speed, 0, -0.5], 0.1,
                                   "damping_ratio = 0.0")  # fmt: skip
            lost.append((speed - v[0]) / (0.1 * 2 * 0.5))
            if law == "linear" and speed >= 1.0:
                case.metric(f"linear, {speed} m/s: sliding impulse / exact", lost[-1], 1.0, 2e-3)
        if law == "hertz_no_history":
            case.metric("no history, no dashpot: impulse", max_of(map(abs, lost)), 0.0, 1e-12)
        ax.plot(speeds, lost, mark, label=f"{law}, no dashpot")
    lost = []
    for speed in speeds:
        v, _, _ = thrown(case, f"dashpot_{speed}", "hertz_no_history", [speed, 0, -0.5], 0.1,
                               "damping_ratio = 0.0, tangential_damping = 0.5")  # fmt: skip
        lost.append((speed - v[0]) / (0.1 * 2 * 0.5))
    case.metric("no history, dashpot, 2 m/s: sliding impulse / exact", lost[-1], 1.0, 5e-2,
                "a dashpot that is weak where the contact is")  # fmt: skip
    case.below("no history: impulse beyond friction", max_of(lost) - 1, 1e-6)
    ax.plot(speeds, lost, "x", label="hertz_no_history, dashpot")
    ax.axhline(1.0, ls=":", color="0.5", label="friction x normal impulse")
    ax.set(xlabel="tangential speed [m/s]", ylabel="impulse / that of sliding")
    ax.legend()


def run(case: Case) -> None:
    """Judge head-on and oblique impacts; plot restitution, course and impulses."""
    fig, axes = case.figure(ncols=3, figsize=(13.0, 4.0))
    head_on(case, axes[0])
    linear_way(case, axes[1])
    oblique(case, axes[2])
    case.save(fig)
