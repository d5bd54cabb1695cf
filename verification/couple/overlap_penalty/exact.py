"""A penalty in place of multipliers: gap of grains and nodes, limit of stiff springs, ledger."""

import numpy as np
from coupled import audit_of, write_deck
from overlap_bars import ACROSS, CUT_OFF, DENSITY, SIDE, SPEED, A, Bar, deck_values

from talus.verification import Case, field_steps

BAR = Bar(grains=360, free=2, ghosts=16, rest=100, n=2)
DEPTH = BAR.h * BAR.ghosts
CENTRE, WIDTH, PEAK = -70 * A, 20 * A, 2.0e-3 * SPEED
STEP = 0.5 * 2 / CUT_OFF
MIDDLE = BAR.h * BAR.free + 0.5 * DEPTH  # of the domain
STEPS = round((MIDDLE - CENTRE) / (SPEED * STEP))  # until the pulse is there; it runs on as long
FACTORS = (0.03, 0.1, 0.3, 0.6)
LEAST = "least_weight = 0.1"  # so that springs at the ends of the domain are no weaker than a third
ENERGY = 0.5 * DENSITY * (ACROSS * SIDE) ** 2 * PEAK**2 * WIDTH * np.sqrt(np.pi / 2)
MOMENTUM = DENSITY * (ACROSS * SIDE) ** 2 * PEAK * WIDTH * np.sqrt(np.pi)


def pulse(z: np.ndarray) -> np.ndarray:
    """Velocity at the start; half of it runs each way."""
    return PEAK * np.exp(-(((z - CENTRE) / WIDTH) ** 2))


def exact_gap(z: np.ndarray, factor: float) -> np.ndarray:
    """Gap of grains and nodes when the pulse is in the middle of the domain [m].

    Weights 1 - a of grains and a of the continuum, a' = 1/DEPTH, leave a' S of the force S of a
    long wave unbalanced a layer; the spring w^2 a (1 - a) m of a grain carries it.
    """
    a = (z - BAR.h * BAR.free) / DEPTH
    v = 0.5 * pulse(z - SPEED * STEPS * STEP)
    return SPEED * v / (DEPTH * (4 * factor / STEP**2) * a * (1 - a))


def gap_of(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Places and gaps of the grains in the middle half of the domain, when the pulse is there."""
    import h5py

    with h5py.File(case.folder / "solid.h5") as file:
        x = file["mesh/x"][...]
    first, now = (field_steps(case.folder / "grains.h5")[i].grains["x"][:, 2] for i in (0, 1))
    u = field_steps(case.folder / "solid.h5")[1].solid["u"][:, 2]
    edge = np.flatnonzero((x[:, 0] < 0) & (x[:, 1] < 0))
    edge = edge[np.argsort(x[edge, 2])]
    inside = np.abs(first - BAR.start - MIDDLE) < 0.25 * DEPTH
    moved = now[inside] - first[inside] - np.interp(first[inside], x[edge, 2], u[edge])
    return first[inside] - BAR.start, moved


def velocities(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Velocities along the bar at the end, of all grains and of the nodes of the elements."""
    grains = field_steps(case.folder / "grains.h5")[-1].grains["v"][:, 2]
    return grains, field_steps(case.folder / "solid.h5")[-1].solid["v"][:, 2]


def couple(case: Case, method: str) -> dict[str, np.ndarray]:
    """Run the bar; return the audit."""
    values = deck_values(STEP, 1, 2 * STEPS, method=method, density=f"{BAR.density:.17g}")
    values["output"] = f"{STEP * STEPS:.17g}"
    write_deck(case, "grains.nml", "bar_grains.nml", **values)
    write_deck(case, "solid.nml", "bar_solid.nml", **values)
    case.run("talus-couple", write_deck(case, "run.nml", "coupled.nml", **values))
    return audit_of(case, "run")


def ledger(case: Case, label: str, audit: dict[str, np.ndarray]) -> None:
    """Judge momentum, energy and works."""
    drift = np.abs(audit["momentum_z"] - audit["momentum_z"][0]).max() / MOMENTUM
    case.below(f"{label}: momentum", drift, 1e-9, "round-off of positions times stiffness")
    swing = np.ptp(audit["total_energy"]) / ENERGY
    case.below(f"{label}: energy", swing, 2e-3, "bounded, second order in the step")
    works = audit["interface_work_given"] - audit["interface_work_taken"]
    case.below(f"{label}: works of both sides", np.abs(works).max() / ENERGY, 1e-5, "second order")


def run(case: Case) -> None:
    """Judge gap, distance from multipliers and ledger for springs of several stiffness."""
    BAR.write(case.folder, pulse)
    couple(case, f"method = 'bridging_domain', {LEAST}")
    bound = velocities(case)
    fig, ax = case.figure()
    off, gaps = [], []
    for factor in FACTORS:
        audit = couple(case, f"method = 'penalty', penalty = {factor}, {LEAST}")
        ledger(case, f"penalty {factor}", audit)
        z, gap = gap_of(case)
        wanted = exact_gap(z, factor)
        ratio = gap.mean() / wanted.mean()
        case.metric(f"penalty {factor}: gap in the middle", ratio, 1.0, 0.06, "-")
        gaps.append(gap.mean())
        pairs = zip(velocities(case), bound, strict=True)
        off.append([np.abs(v - w).max() / (0.5 * PEAK) for v, w in pairs])
        order = np.argsort(z)
        ax.plot(z[order], factor * wanted[order], color="C0", label="exact" * (factor == 0.03))
        ax.plot(z, factor * gap, ".", ms=4, label=f"penalty {factor}")
    log = np.log(FACTORS)
    case.metric("order of the gap", np.polyfit(log, np.log(gaps), 1)[0], -1.0, 0.02, "-")
    for k, side in enumerate(("grains", "nodes")):
        far = np.array(off)[:, k]
        name = f"distance from multipliers, {side}"
        case.metric(f"{name}: order", np.polyfit(log, np.log(far), 1)[0], -1.0, 0.03, "-")
        case.below(f"{name}: stiffest", far[-1], 1e-3, "as 1/penalty")
    audit = couple(case, f"method = 'penalty', penalty = 0.1, penalty_damping = 0.2, {LEAST}")
    ledger(case, "dashpots", audit)
    lost = audit["fine_scale_damping"][-1] / ENERGY
    case.below("dashpots: energy taken", lost, 1e-3, "a wave that nodes can carry")
    case.above("dashpots: energy taken", lost, 0.0, "they take, never give")
    ax.set(xlabel="place along the bar [m]", ylabel="gap times penalty [m]")
    ax.legend()
    case.save(fig)
