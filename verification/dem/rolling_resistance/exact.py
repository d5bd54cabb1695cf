"""A sphere with rolling and twisting resistance against rigid-body mechanics."""

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON, G = 0.01, 2650.0, 1.0e8, 0.25, 9.81
ROLL, TWIST = 0.1, 0.05
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))
SHEAR = YOUNG / (2.0 * (1.0 + POISSON)) / (2.0 * (2.0 - POISSON))
SLOPES = [2.0, 4.0, 5.5, 6.0, 8.0, 12.0, 16.0]  # stays up to atan(0.1) = 5.71 deg


def sunk(gz: float) -> float:
    """Static overlap [m]."""
    return (-MASS * gz / (4.0 / 3.0 * MODULUS * np.sqrt(RADIUS))) ** (2.0 / 3.0)


def moved(
    case: Case, name: str, slope: float, v: float, spin: tuple, end: float,
    spring: float = 1.0, damping: float = 0.2,
) -> tuple[np.ndarray, ...]:  # fmt: skip
    """Run from the static overlap; return time, place, speed along the plane and spins (n, 3)."""
    gx, gz = G * np.sin(np.radians(slope)), -G * np.cos(np.radians(slope))
    values = {"END": end, "GX": gx, "GZ": gz, "SPRING": spring, "DAMPING": damping}
    deck = (case.folder / "deck.nml").read_text()
    for word, value in values.items():
        deck = deck.replace(word, f"{value:.12g}")
    (case.folder / f"{name}.nml").write_text(deck)
    x = np.array([[0.0, 0.0, RADIUS - sunk(gz)]])
    write_packing(
        case.folder / "pack.h5", x, np.full((1, 3), RADIUS),
        v=np.array([[v, 0.0, 0.0]]), omega=np.array([spin]),
    )  # fmt: skip
    case.run("talus-dem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    grains = [s.grains for s in steps]
    return (
        np.array([s.time for s in steps]),
        np.array([g["x"][0, 0] for g in grains]),
        np.array([g["v"][0, 0] for g in grains]),
        np.array([g["omega"][0] for g in grains]),
    )


def run_out(case: Case, ax: object) -> None:
    """Judge rolling out and its energies."""
    note = "the overlap shortens the arm by 0.05 %"
    v0, rate = 0.2, 5 / 7 * ROLL * G
    t, x, v, _ = moved(case, "out", 0.0, v0, (0.0, v0 / RADIUS, 0.0), 0.4)
    inside = (t > 0.01) & (t < 0.9 * v0 / rate)
    case.metric("rolling out: deceleration / exact",
                -np.polyfit(t[inside], v[inside], 1)[0] / rate, 1.0, 2e-3, note)  # fmt: skip
    way = v0**2 / (2 * rate)
    case.metric("rolling out: way / exact", x[-1] / way, 1.0, 3e-3, note)
    rows = read_history(case.folder / "out_energy.csv")
    first = 0.7 * MASS * v0**2
    case.metric("lost by rolling / first energy", rows["rolling"][-1] / first, 1.0, 5e-3,
                "the rest swings out in the spring")  # fmt: skip
    closure = np.abs(rows["closure_error"]).max() / first
    case.below("rolling out: closure / first energy", closure, 1e-4)
    ax.plot(t, np.maximum(v0 - rate * t, 0), "-", label="exact")
    ax.plot(t[::8], v[::8], "o", label="speed")


def spin_down(case: Case, ax: object) -> None:
    """Judge spinning about the vertical."""
    rate, first = 2.5 * TWIST * G / RADIUS, 30.0
    t, _, _, spin = moved(case, "spin", 0.0, 0.0, (0.0, 0.0, first), 0.4)
    inside = (t > 0.01) & (t < 0.9 * first / rate)
    case.metric("spinning down: rate / exact",
                -np.polyfit(t[inside], spin[inside, 2], 1)[0] / rate, 1.0, 1e-3)  # fmt: skip
    rows = read_history(case.folder / "spin_energy.csv")
    energy = 0.2 * MASS * RADIUS**2 * first**2
    case.metric("lost by twisting / first energy", rows["rolling"][-1] / energy, 1.0, 5e-3)
    case.below("spinning: closure / first energy", np.abs(rows["closure_error"]).max() / energy,
               1e-4)  # fmt: skip
    ax.plot(t, np.maximum(first - rate * t, 0) * RADIUS, "-")
    ax.plot(t[::8], spin[::8, 2] * RADIUS, "s", label="spin about the vertical x radius")
    ax.set(xlabel="time [s]", ylabel="speed [m/s]")
    ax.legend()


def slopes(case: Case, ax: object) -> None:
    """Judge rest and acceleration on slopes."""
    found = []
    for slope in SLOPES:
        t, x, v, _ = moved(case, f"slope_{slope:g}", slope, 0.0, (0.0, 0.0, 0.0), 0.2)
        late = t > 0.05
        a = np.radians(slope)
        wanted = max(5 / 7 * G * (np.sin(a) - ROLL * np.cos(a)), 0.0)
        found.append(np.polyfit(t[late], v[late], 1)[0])
        if wanted > 0.0:
            case.metric(f"{slope:g} deg: acceleration / g", found[-1] / G, wanted / G, 2e-4)
        else:
            late = t > 0.1
            case.below(f"{slope:g} deg: creep / radius", np.ptp(x[late]) / RADIUS, 1e-5)
    fine = np.radians(np.linspace(0.0, 17.0, 200))
    wanted = np.maximum(5 / 7 * G * (np.sin(fine) - ROLL * np.cos(fine)), 0.0)
    ax.plot(np.degrees(fine), wanted, "-", label="exact")
    ax.plot(SLOPES, found, "o", label="Talus")
    ax.set(xlabel="slope [deg]", ylabel="acceleration [m/s2]")
    ax.legend()


def rocking(case: Case) -> None:
    """Judge the period of small rocking on a soft rolling spring."""
    soft = 1.0e-3
    radius = np.sqrt(RADIUS * sunk(-G))
    spring = soft * 8 * SHEAR * radius * RADIUS**2
    period = 2 * np.pi * np.sqrt(1.4 * MASS * RADIUS**2 / spring)
    t, x, _, _ = moved(case, "rock", 0.0, 1e-3, (0.0, 1e-3 / RADIUS, 0.0), 10 * period, soft, 0.0)
    change = np.flatnonzero(np.diff(np.sign(x[1:] - x[1:].mean())) > 0) + 1
    x = x - x.mean()
    crossing = [t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k]) for k in change]
    measured = (crossing[-1] - crossing[0]) / (len(crossing) - 1)
    note = "the tangential spring, 1000 times as stiff, adds 0.03 %"
    case.metric("rocking: period / exact", measured / period, 1.0, 2e-3, note)


def run(case: Case) -> None:
    """Judge rolling out, spinning down, slopes and rocking; plot the first three."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    run_out(case, axes[0])
    spin_down(case, axes[0])
    slopes(case, axes[1])
    rocking(case)
    case.save(fig)
