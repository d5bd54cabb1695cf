"""A sphere on a level and on an inclined plane against a rigid sphere with Coulomb friction."""

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON, FRICTION, G = 0.01, 2650.0, 1.0e8, 0.25, 0.2, 9.81
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
SLOPES = [5.0, 15.0, 25.0, 30.0, 40.0, 50.0, 60.0]  # rolls up to atan(0.7) = 35 deg


def rolled(case: Case, slope: float, speed: float) -> tuple[np.ndarray, ...]:
    """Run from the static overlap; return time, place, speed along the plane and spin."""
    name = f"slope_{slope:.0f}.nml"
    gx, gz = G * np.sin(np.radians(slope)), -G * np.cos(np.radians(slope))
    deck = (case.folder / "deck.nml").read_text()
    deck = deck.replace("GX", f"{gx:.12f}").replace("GZ", f"{gz:.12f}")
    (case.folder / name).write_text(deck)
    modulus = YOUNG / (2.0 * (1.0 - POISSON**2))
    sunk = (-MASS * gz / (4.0 / 3.0 * modulus * np.sqrt(RADIUS))) ** (2.0 / 3.0)
    x = np.array([[0.0, 0.0, RADIUS - sunk]])
    v = np.array([[speed, 0.0, 0.0]])
    write_packing(case.folder / "pack.h5", x, np.full((1, 3), RADIUS), v=v)
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    columns = [(s.time, s.grains["x"][0, 0], s.grains["v"][0, 0], s.grains["omega"][0, 1])
               for s in steps]  # fmt: skip
    return tuple(np.array(columns).T)


def accelerations(slope: float) -> tuple[float, float]:
    """Exact acceleration [m/s^2] and spin rate [rad/s^2] on a slope."""
    a = np.radians(slope)
    if np.tan(a) <= 3.5 * FRICTION:
        return 5 / 7 * G * np.sin(a), 5 / 7 * G * np.sin(a) / RADIUS
    return G * (np.sin(a) - FRICTION * np.cos(a)), 2.5 * FRICTION * G * np.cos(a) / RADIUS


def run(case: Case) -> None:
    """Judge the throw along the floor and the slopes; plot both."""
    speed = 0.5
    t, x, v, spin = rolled(case, 0.0, speed)
    stop = 2 * speed / (7 * FRICTION * G)
    exact = np.where(t < stop, speed - FRICTION * G * t, 5 / 7 * speed)
    late = t > 1.5 * stop
    note = "the overlap shortens the arm by 0.1 %"
    case.metric("speed at the end / first", v[-1] / speed, 5 / 7, 1e-3, note)
    case.metric("spin x radius / speed at the end", spin[-1] * RADIUS / v[-1], 1.0, 2e-3, note)
    roll = np.polyfit(t[late], x[late], 1)
    slide = np.polyfit(t[t < 0.9 * stop], x[t < 0.9 * stop], 2)
    case.metric("sliding: deceleration / (mu g)", -2 * slide[0] / (FRICTION * G), 1.0, 1e-3)

    way = 12 * speed**2 / (49 * FRICTION * G)
    case.metric("way at the change / exact", (roll[0] * stop + roll[1]) / way, 1.0, 2e-3, note)
    rows = read_history(case.folder / "slope_0_energy.csv")
    lost = 0.5 * MASS * speed**2 * 2 / 7
    spent = rows["friction"] + rows["contact_damping"] + rows["tangential_relaxation"]
    case.metric("energy lost / (2/7 of the first)", spent[-1] / lost, 1.0, 2e-3, note)
    case.below(
        "ledger, closure / first energy", np.abs(rows["closure_error"]).max() / (3.5 * lost), 1e-4
    )
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    axes[0].plot(t, exact, "-", label="exact")
    axes[0].plot(t[::4], v[::4], "o", label="speed")
    axes[0].plot(t, np.minimum(2.5 * FRICTION * G * t, 5 / 7 * speed), "-")
    axes[0].plot(t[::4], RADIUS * spin[::4], "s", label="spin x radius")
    axes[0].set(xlabel="time [s]", ylabel="speed [m/s]")
    axes[0].legend()
    found = []
    for slope in SLOPES:
        t, x, v, spin = rolled(case, slope, 0.0)
        late = t > 0.02
        a = np.polyfit(t[late], v[late], 1)[0]
        turning = np.polyfit(t[late], spin[late], 1)[0]
        found.append((a, turning))
        wanted = accelerations(slope)
        case.metric(f"{slope:.0f} deg: acceleration / exact", a / wanted[0], 1.0, 2e-3, note)
        case.metric(f"{slope:.0f} deg: spin rate / exact", turning / wanted[1], 1.0, 2e-3, note)
    fine = np.linspace(0.0, 65.0, 200)
    lines = np.array([accelerations(s) for s in fine])
    axes[1].plot(fine, lines[:, 0], "-", label="exact")
    axes[1].plot(SLOPES, [f[0] for f in found], "o", label="acceleration")
    axes[1].plot(fine, RADIUS * lines[:, 1], "-")
    axes[1].plot(SLOPES, [RADIUS * f[1] for f in found], "s", label="spin rate x radius")
    axes[1].set(xlabel="slope [deg]", ylabel="acceleration [m/s2]")
    axes[1].legend()
    case.save(fig)
