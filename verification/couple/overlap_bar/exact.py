"""A pulse through an overlap, against grains alone, elements alone and d'Alembert's solution."""

import numpy as np
from coupled import audit_of, write_deck
from overlap_bars import ACROSS, CUT_OFF, DENSITY, SIDE, SPEED, A, Bar, deck_values

from talus.verification import Case, field_steps

BAR = Bar(grains=340, free=4, ghosts=1, rest=40)
CENTRE, WIDTH, PEAK = -70 * A, 20 * A, 2.0e-3 * SPEED
STEP = 0.5 * 2 / CUT_OFF
STEPS = 280  # of the grains: the pulse travels 140 layers
BEYOND = 24 * A  # from here on all that is seen has passed the overlap


def pulse(z: np.ndarray) -> np.ndarray:
    """Velocity at the start; half of it runs each way."""
    return PEAK * np.exp(-(((z - CENTRE) / WIDTH) ** 2))


def exact(z: np.ndarray) -> np.ndarray:
    """Velocity at the end, beyond the overlap: the half that runs to the right."""
    return 0.5 * pulse(z - SPEED * STEPS * STEP)


def elements_of(case: Case, stem: str) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities of the nodes on an edge of the bar at the end."""
    import h5py

    with h5py.File(case.folder / f"{stem}.h5") as file:
        x = file["mesh/x"][...]
    v = field_steps(case.folder / f"{stem}.h5")[-1].solid["v"]
    edge = (x[:, 0] < 0) & (x[:, 1] < 0)
    order = np.argsort(x[edge, 2])
    return x[edge, 2][order] - BAR.start, v[edge, 2][order]


def alone(case: Case) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Grains alone and elements alone."""
    BAR.write(case.folder, pulse, alone=True)
    values = deck_values(STEP, 1, STEPS)
    case.run("talus-dem", write_deck(case, "only_grains.nml", "bar_grains.nml", **values))
    grains = field_steps(case.folder / "only_grains.h5")[-1].grains
    first = slice(None, None, ACROSS**2)
    deck = case.folder / write_deck(case, "only_solid.nml", "bar_solid.nml", **values)
    low = -BAR.grains * A
    lines = [
        f"&initial group = '{k}', component = 'z', value = {pulse(low + k * BAR.h):.9e} /"
        for k in range(1, BAR.grains // BAR.n + BAR.free + BAR.ghosts + BAR.rest)
    ]
    deck.write_text(deck.read_text() + "\n".join(lines) + "\n")
    case.run("talus-fem", deck.name)
    return {
        "grains alone": (grains["x"][first, 2] - BAR.start, grains["v"][first, 2]),
        "elements alone": elements_of(case, "only_solid"),
    }


def profile(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities beyond the overlap at the end of the coupled run."""
    x, v = elements_of(case, "solid")
    return x[x > BEYOND], v[x > BEYOND]


def judge(case: Case, label: str, audit: dict[str, np.ndarray], scales: tuple) -> None:
    """Momentum, energy and works of one run."""
    momentum, energy = scales
    drift = np.abs(audit["momentum_z"] - audit["momentum_z"][0]).max() / momentum
    swing = np.ptp(audit["total_energy"]) / energy
    works = audit["interface_work_given"] - audit["interface_work_taken"]
    if label.startswith("symmetric"):
        case.below(f"{label}: momentum", drift, 1e-10, "round-off of positions times stiffness")
        case.below(f"{label}: energy", swing, 2e-3, "bounded, second order in the step")
    else:
        case.above(f"{label}: momentum", drift, 1e-4, "the scheme is meant to fail")
    case.below(f"{label}: works of both sides", np.abs(works).max() / energy, 1e-10, "transposes")


def run(case: Case) -> None:
    """Judge profiles at the end, and the audits of both schemes."""
    profiles = alone(case)
    BAR.write(case.folder, pulse)
    area = (ACROSS * SIDE) ** 2
    energy = 0.5 * DENSITY * area * PEAK**2 * WIDTH * np.sqrt(np.pi / 2)
    scales = (DENSITY * area * PEAK * WIDTH * np.sqrt(np.pi), energy)
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for scheme in ("symmetric", "state_at_n"):
        for steps in (1, 2, 4):
            values = deck_values(STEP, steps, STEPS // steps, scheme=scheme)
            write_deck(case, "grains.nml", "bar_grains.nml", **values)
            write_deck(case, "solid.nml", "bar_solid.nml", **values)
            stem = f"{scheme}{steps}"
            case.run("talus-couple", write_deck(case, f"{stem}.nml", "coupled.nml", **values))
            audit = audit_of(case, stem)
            judge(case, f"{scheme}, {steps} steps", audit, scales)
            total = (audit["total_energy"] - audit["total_energy"][0]) / energy
            style = "-" if scheme == "symmetric" else "--"
            right.plot(1e3 * audit["time"], 100 * total, style, label=f"{scheme}, m = {steps}")
            if stem == "symmetric2":
                profiles["coupled"] = profile(case)
    peak = 0.5 * PEAK
    z = np.linspace(BEYOND, BAR.h * (BAR.free + BAR.ghosts + BAR.rest), 400)
    left.plot(z, exact(z) / PEAK, label="exact")
    for name, (x, v) in profiles.items():
        far = x > BEYOND
        worst = np.abs(v[far] - exact(x[far])).max() / peak
        case.below(f"{name}: velocities over the peak", worst, 0.05, "dispersion of both lattices")
        left.plot(x[far][::4 if "grains" in name else 1], v[far][::4 if "grains" in name else 1]
                  / PEAK, ".", ms=4, label=name)  # fmt: skip
    left.set(xlabel="place along the bar [m]", ylabel="velocity / peak at the start [-]")
    right.set(xlabel="time [ms]", ylabel="change of energy / energy [%]")
    left.legend()
    right.legend(fontsize=7)
    case.save(fig)
