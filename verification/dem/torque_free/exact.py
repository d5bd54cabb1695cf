"""Free rotation of a triaxial body against Jacobi's elliptic functions."""

import numpy as np

from talus.verification import Case, field_steps, write_packing

AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])


def inertia() -> np.ndarray:
    """Principal moments of inertia per unit mass [m2], least first."""
    a2, b2, c2 = AXES**2
    return np.array([b2 + c2, a2 + c2, a2 + b2]) / 5.0


def jacobi(u: np.ndarray, m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """sn, cn, dn of u with parameter m by descending Landen steps (Abramowitz & Stegun 16.4)."""
    a, b, c = [1.0], [np.sqrt(1.0 - m)], [np.sqrt(m)]
    while c[-1] > 1e-16:
        a.append((a[-1] + b[-1]) / 2)
        c.append((a[-2] - b[-1]) / 2)
        b.append(np.sqrt(a[-2] * b[-1]))
    n = len(a) - 1
    phi = 2.0**n * a[n] * u
    for k in range(n, 0, -1):
        last = phi
        phi = (phi + np.arcsin(c[k] / a[k] * np.sin(phi))) / 2
    sn, cn = np.sin(phi), np.cos(phi)
    dn = np.where(
        np.abs(np.cos(last - phi)) > 1e-12, cn / np.cos(last - phi), np.sqrt(1 - m * sn**2)
    )
    return sn, cn, dn


def exact_axis_spin(time: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Body-frame spin (n, 3) with spin about the middle axis zero at t = 0."""
    i1, i2, i3 = inertia()
    energy2 = float(np.sum(inertia() * start**2))
    momentum2 = float(np.sum((inertia() * start) ** 2))
    if momentum2 < energy2 * i2:
        raise ValueError("choose a start on the side of the largest axis")
    rate = np.sqrt((i3 - i2) * (momentum2 - energy2 * i1) / (i1 * i2 * i3))
    m = (i2 - i1) * (energy2 * i3 - momentum2) / ((i3 - i2) * (momentum2 - energy2 * i1))
    sn, cn, dn = jacobi(rate * time, m)
    w1 = np.sqrt((energy2 * i3 - momentum2) / (i1 * (i3 - i1))) * cn
    w2 = np.sqrt((energy2 * i3 - momentum2) / (i2 * (i3 - i2))) * sn
    w3 = np.sqrt((momentum2 - energy2 * i1) / (i3 * (i3 - i1))) * dn
    return np.column_stack([w1, w2, w3])


def rotation(quat: np.ndarray) -> np.ndarray:
    """Matrix body -> space of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def history(case: Case, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run with a time step; return times, body-frame spins and |L| over |L| at the start."""
    deck = (case.folder / "deck.nml").read_text().replace("dt = 1.0e-5", f"dt = {step:.8e}")
    name = f"spin_{step:.0e}.nml"
    (case.folder / name).write_text(deck)
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    body = np.array([rotation(s.grains["quat"][0]).T @ s.grains["omega"][0] for s in steps])
    momentum = np.linalg.norm(body * inertia(), axis=1)
    return np.array([s.time for s in steps]), body, momentum / momentum[0]


def run(case: Case) -> None:
    """Judge |L|, the spin and its order; plot the three spins."""
    start = np.array([4.0, 0.0, 9.0])
    write_packing(case.folder / "pack.h5", np.zeros((1, 3)), AXES[None, :], omega=start[None, :])
    error = {}
    for step in (4.0e-4, 2.0e-4):
        time, spin, _ = history(case, step)
        error[step] = np.abs(spin - exact_axis_spin(time, start)).max()
    time, spin, length = history(case, 1.0e-5)
    case.below(
        "drift of |L| over 1e6 steps", float(np.abs(length - 1).max()), 1e-10, "rounding, 1e6 steps"
    )
    case.below(
        "spin error / largest spin",
        float(np.abs(spin - exact_axis_spin(time, start)).max() / 9.0),
        2e-7,
        "(largest spin x step)^2 x turns",
    )
    order = float(np.log2(error[4.0e-4] / error[2.0e-4]))
    case.metric("observed order in time", order, 2.0, 0.1)
    fig, ax = case.figure()
    fine = np.linspace(0, 10, 1001)
    for k, line in enumerate(exact_axis_spin(fine, start).T):
        ax.plot(fine, line, "-", label=f"exact, axis {k + 1}")
        ax.plot(time, spin[:, k], "o", ms=4, label=f"Talus, axis {k + 1}")
    ax.set(xlabel="time [s]", ylabel="spin in the body frame [1/s]")
    ax.set_ylim(top=16.0)
    ax.legend(ncols=2, loc="upper center")
    case.save(fig)
