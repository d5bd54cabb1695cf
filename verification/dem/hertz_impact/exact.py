"""Head-on impact of two spheres against Hertz and against the cut damping law."""

import numpy as np

from talus.verification import Case, field_steps, write_packing

RADIUS, DENSITY, YOUNG, POISSON = 0.01, 2650.0, 29.0e9, 0.25
RATIOS = [0.0, 0.05, 0.10, 0.30]
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
M_STAR, R_STAR = MASS / 2.0, RADIUS / 2.0


def restitution_of_cut_law(ratio: float) -> float:
    """Integrate the scaled law x'' = -x^1.5 - 2 b x^(1/4) x' until the force is no longer positive.

    With k_n = 2 E* sqrt(R x) = 1.5 F/x, damping 2 ratio sqrt(m k_n) becomes
    2 ratio sqrt(1.5) x^(1/4).
    """
    c, h = 2.0 * ratio * 1.5**0.5, 1.0e-3

    def rate(x: float, v: float) -> float:
        x = max(x, 0.0)
        return -(x**1.5) - c * x**0.25 * v

    x, v = 0.0, 1.0
    while True:
        v1, a1 = v, rate(x, v)
        v2, a2 = v + 0.5 * h * a1, rate(x + 0.5 * h * v1, v + 0.5 * h * a1)
        v3, a3 = v + 0.5 * h * a2, rate(x + 0.5 * h * v2, v + 0.5 * h * a2)
        v4, a4 = v + h * a3, rate(x + h * v3, v + h * a3)
        x += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if v < 0.0 and rate(x, v) >= 0.0:
            return -v


def impact(case: Case, ratio: float, speed: float) -> tuple[float, float, float]:
    """Run one impact; return (largest overlap [m], contact time [s], restitution)."""
    gap = 2.0e-6 * speed
    x = np.array([[-RADIUS - gap / 2, 0, 0], [RADIUS + gap / 2, 0, 0]])
    v = np.array([[speed / 2, 0, 0], [-speed / 2, 0, 0]])
    write_packing(case.folder / "pack.h5", x, np.full((2, 3), RADIUS), v=v)
    deck = (case.folder / "deck.nml").read_text()
    name = f"impact_{ratio:.2f}_{speed:.1f}.nml"
    (case.folder / name).write_text(deck.replace("damping_ratio = 0.0", f"damping_ratio = {ratio}"))
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    time = np.array([step.time for step in steps])
    overlap = np.array(
        [2 * RADIUS - np.linalg.norm(s.grains["x"][1] - s.grains["x"][0]) for s in steps]
    )
    inside = np.flatnonzero(overlap > 0.0)
    first, last = inside[0], inside[-1]
    start = np.interp(0.0, overlap[first - 1 : first + 1], time[first - 1 : first + 1])
    end = np.interp(0.0, -overlap[last : last + 2], time[last : last + 2])
    peak = np.argmax(overlap)
    fit = np.polyfit(time[peak - 2 : peak + 3] - time[peak], overlap[peak - 2 : peak + 3], 2)
    rebound = steps[-1].grains["v"][1, 0] - steps[-1].grains["v"][0, 0]
    return float(fit[2] - fit[1] ** 2 / (4 * fit[0])), float(end - start), float(rebound / speed)


def run(case: Case) -> None:
    """Judge overlap, time and restitution; plot restitution against damping ratio."""
    speed = 1.0
    overlap, duration, rebound = impact(case, 0.0, speed)
    exact = (15.0 * M_STAR * speed**2 / (16.0 * E_STAR * np.sqrt(R_STAR))) ** 0.4
    case.metric(
        "largest overlap / exact", overlap / exact, 1.0, 1e-4, "parabola through five samples"
    )
    case.metric(
        "contact time / exact",
        duration / (2.9433 * exact / speed),
        1.0,
        1e-3,
        "2.9433 has five digits",
    )
    case.metric(
        "restitution without damping",
        rebound,
        1.0,
        1e-5,
        "symplectic, step 1/280 of the contact time",
    )
    measured = [rebound]
    for ratio in RATIOS[1:]:
        measured.append(impact(case, ratio, speed)[2])
        case.metric(
            f"restitution at {ratio}",
            measured[-1],
            restitution_of_cut_law(ratio),
            2e-3,
            "first order cut",
        )
    slow = impact(case, 0.10, 0.5)[2]
    case.metric("restitution at half the speed", slow, measured[2], 2e-3)
    fig, ax = case.figure()
    fine = np.linspace(0.0, 0.35, 36)
    ax.plot(fine, [restitution_of_cut_law(r) for r in fine], "-", label="exact (cut law)")
    ax.plot(RATIOS, measured, "o", label="Talus")
    ax.set(xlabel="damping ratio [-]", ylabel="restitution [-]")
    ax.legend()
    case.save(fig)
