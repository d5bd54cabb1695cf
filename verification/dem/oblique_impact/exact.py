"""Oblique impact of two equal spheres against gross sliding and an independent integration."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, write_packing

RADIUS, DENSITY, YOUNG, POISSON, FRICTION = 0.01, 2650.0, 29.0e9, 0.25, 0.3
SPEED = 0.01  # slow: the normal turns by v T/(2 R) = 1e-4 rad during the contact
ANGLES = [5.0, 15.0, 25.0, 35.0, 45.0, 60.0, 75.0, 80.0]
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
INERTIA = 0.4 * MASS * RADIUS**2
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
G_STAR = YOUNG / (2.0 * (1.0 + POISSON)) / (2.0 * (2.0 - POISSON))


def reference(normal: float, tangential: float) -> tuple[float, float]:
    """Integrate the law in the plane; return (tangential centre speed, spin) of sphere 1 after.

    Half the relative velocity belongs to each sphere. Unknowns: overlap, its rate, relative slip
    velocity at the contact; spheres turn alike, so the slip velocity is w = v_t - 2 R omega.
    """
    overlap, rate, v, spin = 0.0, normal, tangential, 0.0
    force, last_a, h = 0.0, 0.0, 2.0e-8
    r_e = RADIUS / 2
    while overlap >= 0.0:
        rate_mid = rate
        overlap_mid = overlap + 0.5 * h * rate_mid
        a = np.sqrt(max(r_e * overlap_mid, 0.0))
        f_n = 4.0 / 3.0 * E_STAR * np.sqrt(r_e) * max(overlap_mid, 0.0) ** 1.5
        if a < last_a and last_a > 0:
            force *= a / last_a
        last_a = a
        slip = v - 2.0 * RADIUS * spin
        force -= 8.0 * G_STAR * a * slip * h
        force = float(np.clip(force, -FRICTION * f_n, FRICTION * f_n))
        rate -= h * 2.0 * f_n / MASS
        v += h * 2.0 * force / MASS
        spin -= h * RADIUS * force / INERTIA
        overlap += h * rate
    return v / 2, spin


def impact(case: Case, angle: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Run one impact; return velocity and spin of sphere 1 after, and both losses of momentum."""
    vn, vt = SPEED * np.cos(np.radians(angle)), SPEED * np.sin(np.radians(angle))
    half = RADIUS + 0.5e-6 * vn
    x = np.array([[-half, 0, 0], [half, 0, 0]])
    v = np.array([[vn / 2, vt / 2, 0], [-vn / 2, -vt / 2, 0]])
    write_packing(case.folder / "pack.h5", x, np.full((2, 3), RADIUS), v=v)
    name = f"angle_{angle:.0f}.nml"
    (case.folder / name).write_text((case.folder / "deck.nml").read_text())
    case.run("talus-dem", name)
    steps = field_steps(case.folder / name.replace(".nml", ".h5"))
    momenta = []
    for step in (steps[0], steps[-1]):
        g = step.grains
        linear = MASS * g["v"].sum(axis=0)
        angular = (MASS * np.cross(g["x"], g["v"]) + INERTIA * g["omega"]).sum(axis=0)
        momenta.append((linear, angular))
    lost = np.abs(momenta[1][0] - momenta[0][0]).max() / (MASS * SPEED)
    turned = np.abs(momenta[1][1] - momenta[0][1]).max() / (MASS * SPEED * RADIUS)
    last = steps[-1].grains
    return last["v"][0], last["omega"][0], float(lost), float(turned)


def run(case: Case) -> None:
    """Judge every angle; plot the rebound of the contact point as Maw et al. do."""
    scale = 2 * (1 - POISSON) / (FRICTION * (2 - POISSON))
    incoming, measured, exact = [], [], []
    worst, lost, turned = 0.0, 0.0, 0.0
    for angle in ANGLES:
        vn, vt = SPEED * np.cos(np.radians(angle)), SPEED * np.sin(np.radians(angle))
        v, spin, a, b = impact(case, angle)
        lost, turned = max_of(lost, a), max_of(turned, b)
        wanted_v, wanted_spin = reference(vn, vt)
        if angle >= 75.0:
            loss = (vt / 2 - v[1]) / (FRICTION * vn)
            name = f"{angle:.0f} deg: tangential loss / (friction x normal)"
            case.metric(name, loss, 1.0, 2e-3, "gross sliding; the turning normal gives 6e-4")
            sliding_spin = -2.5 * FRICTION * vn / RADIUS
            case.metric(f"{angle:.0f} deg: spin / exact", spin[2] / sliding_spin, 1.0, 2e-3)
        worst = max_of(
            worst, abs(v[1] - wanted_v) / SPEED, abs(spin[2] + abs(wanted_spin)) * RADIUS / SPEED
        )
        incoming.append(vt / vn)
        measured.append((v[1] + RADIUS * spin[2]) * 2 / vn)
        exact.append((wanted_v - RADIUS * abs(wanted_spin)) * 2 / vn)
    case.below(
        "largest difference to the independent integration / speed",
        worst,
        5e-4,
        "steps 20 and 2 ns",
    )
    case.below("momentum lost / (m v)", lost, 1e-12)
    case.below(
        "angular momentum lost / (m v R)",
        turned,
        1e-11,
        "both arms end at one point: rounding",
    )
    fig, ax = case.figure()
    ax.plot(
        scale * np.array(incoming), scale * np.array(exact), "-", label="independent integration"
    )
    ax.plot(scale * np.array(incoming), scale * np.array(measured), "o", label="Talus")
    ax.set(
        xlabel="scaled tangent of the angle before [-]",
        ylabel="scaled rebound of the contact point [-]",
    )
    ax.legend()
    case.save(fig)
