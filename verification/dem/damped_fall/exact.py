"""Two grains that fall and spin through background damping against the exponentials."""

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

AXES = np.array([[2.0e-3, 2.0e-3, 2.0e-3], [2.5e-3, 2.0e-3, 1.5e-3]])
GRAVITY, RATE, DENSITY = np.array([1.0, 2.0, -9.81]), 5.0, 2650.0
V0 = np.array([[0.3, -0.1, 0.2], [-0.2, 0.4, 0.1]])
SPIN0 = np.array([[30.0, -20.0, 10.0], [0.0, 0.0, 40.0]])  # the ellipsoid about a principal axis
X0 = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocities, paths and spins (n, 2, 3) at times t."""
    fade = np.exp(-RATE * t)[:, None, None]
    limit = GRAVITY / RATE
    v = limit + (V0 - limit) * fade
    x = X0 + limit * t[:, None, None] + (V0 - limit) * (1.0 - fade) / RATE
    return v, x, SPIN0 * fade


def errors(case: Case, step: float) -> np.ndarray:
    """Run with a time step; return the largest relative errors of velocity, path and spin."""
    name = f"fall_{step:.0e}.nml"
    deck = (case.folder / "deck.nml").read_text().replace("dt = 1.0e-4", f"dt = {step:.8e}")
    (case.folder / name).write_text(deck)
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    v, x, spin = exact(np.array([s.time for s in steps]))
    return np.array(
        [
            np.abs([s.grains["v"] for s in steps] - v).max() / np.abs(v).max(),
            np.abs([s.grains["x"] for s in steps] - x).max() / np.abs(x - X0).max(),
            np.abs([s.grains["omega"] for s in steps] - spin).max() / np.abs(spin).max(),
        ]
    )


def run(case: Case) -> None:
    """Judge the three quantities, their order and the ledger; plot the fall and the spin."""
    write_packing(case.folder / "pack.h5", X0, AXES, v=V0, omega=SPIN0)
    coarse, fine = errors(case, 4.0e-4), errors(case, 1.0e-4)
    for k, name in enumerate(("velocity", "path", "spin")):
        case.below(f"{name}: largest error / largest", float(fine[k]), 1e-7, "(a dt)^2/12 = 2e-8")
        order = float(np.log(coarse[k] / fine[k]) / np.log(4.0))
        case.metric(f"{name}: observed order", order, 2.0, 0.1)
    rows = read_history(case.folder / "fall_1e-04_energy.csv")
    scale = np.abs(rows["background_damping"]).max()
    kinetic = rows["kinetic"] - rows["kinetic"][0]
    closure = np.abs(rows["gravity"] - rows["background_damping"] - kinetic).max()
    case.below(
        "ledger, closure error / damping", float(closure / scale), 2e-7, "second order: 5e-8"
    )
    mass = DENSITY * 4.0 / 3.0 * np.pi * AXES.prod(axis=1)
    _, x, _ = exact(rows["time"])
    fallen = np.einsum("i,nij,j->n", mass, x - X0, GRAVITY)
    case.metric(
        "work of gravity / exact", rows["gravity"][-1] / fallen[-1], 1.0, 1e-6, "second order"
    )
    fig, ax = case.figure()
    t = np.linspace(0.0, 0.4, 81)
    v, _, spin = exact(t)
    steps = field_steps(case.folder / "fall_1e-04.h5")
    time = [s.time for s in steps]
    ax.plot(t, v[:, 0, 2], "-", label="vertical velocity [m/s], exact")
    ax.plot(time, [s.grains["v"][0, 2] for s in steps], "o", label="Talus")
    ax.plot(t, spin[:, 1, 2] / 40.0, "-", label="spin of the ellipsoid / first, exact")
    ax.plot(time, [s.grains["omega"][1, 2] / 40.0 for s in steps], "o", label="Talus")
    ax.set(xlabel="time [s]", ylabel="velocity [m/s], spin [-]")
    ax.legend()
    case.save(fig)
