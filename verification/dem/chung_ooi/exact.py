"""The eight tests of Chung and Ooi (2011) against Hertz, Coulomb and an independent integration."""

from dataclasses import dataclass, replace

import numpy as np

from talus.verification import Case, Step, field_steps, write_packing

FINE = 4000  # steps of the independent integration in a contact time


@dataclass
class Test:
    """One test: material, geometry and the impacts that run side by side."""

    number: int
    young: float
    poisson: float
    density: float
    friction: float
    restitution: float
    radius: float
    partner: float  # radius of the second sphere [m]; 0: a rigid plane
    normal: np.ndarray  # approach speed of each impact [m/s]
    tangential: np.ndarray  # tangential speed of the first sphere [m/s]
    spin: np.ndarray  # spin of each sphere [rad/s]; positive: its contact point lags
    steps: int = 1000  # in a contact time

    def modulus(self) -> float:
        """E* [Pa]."""
        return self.young / (1 - self.poisson**2) / (2 if self.partner else 1)

    def shear(self) -> float:
        """G* [Pa]."""
        one = self.young / (2 * (1 + self.poisson)) / (2 - self.poisson)
        return one / (2 if self.partner else 1)

    def mass(self, radius: float) -> float:
        """Mass of a sphere [kg]."""
        return self.density * 4 / 3 * np.pi * radius**3

    def reduced(self) -> tuple[float, float]:
        """Return reduced mass [kg] and radius [m]."""
        if not self.partner:
            return self.mass(self.radius), self.radius
        a, b = self.mass(self.radius), self.mass(self.partner)
        return a * b / (a + b), self.radius * self.partner / (self.radius + self.partner)

    def hertz(self, speed: float) -> tuple[float, float, float]:
        """Largest force [N], overlap [m] and time [s] of an elastic head-on impact."""
        m, r = self.reduced()
        e = self.modulus()
        overlap = (15 * m * speed**2 / (16 * e * np.sqrt(r))) ** 0.4
        return 4 / 3 * e * np.sqrt(r) * overlap**1.5, overlap, 2.9432683 * overlap / speed


ZERO = np.zeros(1)
SPINS = np.array([0.175, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 14.0, 18.0, 21.0])
ANGLES = np.radians([5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0])
SLIDES = np.array([0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0])
T1 = Test(1, 4.8e10, 0.20, 2800.0, 0.35, 1.0, 0.01, 0.01, np.array([20.0]), ZERO, ZERO)
T2 = Test(2, 7.0e10, 0.30, 2699.0, 0.0, 1.0, 0.1, 0.0, np.array([0.2]), ZERO, ZERO)
T3 = Test(3, 3.8e11, 0.23, 4000.0, 0.0, 1.0, 0.0025, 0.0, np.array([3.9]), ZERO, ZERO)
T4 = Test(
    4, 3.8e11, 0.23, 4000.0, 0.092, 0.98, 0.0025, 0.0,
    3.9 * np.cos(ANGLES), 3.9 * np.sin(ANGLES), 0 * ANGLES,
)  # fmt: skip
T5 = Test(
    5, 2.08e11, 0.3, 7850.0, 0.3, 1.0, 1.0e-5, 0.0, 5.0 + 0 * SLIDES, SLIDES, 0 * SLIDES
)  # fmt: skip
T6 = Test(6, 7.0e10, 0.33, 2700.0, 0.4, 0.5, 0.1, 0.0, 0.2 + 0 * SPINS, 0 * SPINS, SPINS)
T7 = replace(T6, number=7, partner=0.1)
T8 = replace(T6, number=8, partner=0.5)


def damping_of(restitution: float) -> float:
    """Damping ratio of the law that may not pull: bisection on its closed form."""
    low, high = 0.0, 0.99 / np.sqrt(1.2)
    for _ in range(100):
        ratio = (low + high) / 2
        b = ratio * np.sqrt(1.2)
        e = np.exp(-b * (np.pi - 2 * np.arcsin(b)) / np.sqrt(1 - b * b))
        low, high = (ratio, high) if e > restitution else (low, ratio)
    return ratio


def reference(test: Test) -> np.ndarray:
    """Integrate the impacts of a test in the plane, all at once.

    Rows: impulse [N s], its moment about the first sphere / R, the most that friction could carry.
    The arms end at the contact point, which the overlap shortens by its softer side's share.
    """
    m, r = test.reduced()
    e, g = test.modulus(), test.shear()
    h = test.hertz(float(test.normal.max()))[2] / FINE
    ratio = damping_of(test.restitution) if test.restitution < 1 else 0.0
    share = 0.5 if test.partner else 1.0
    radii = [test.radius] + ([test.partner] if test.partner else [])
    inertia = [0.4 * test.mass(radius) * radius**2 for radius in radii]
    overlap, rate, v = 0 * test.normal, -test.normal, test.tangential.copy()
    spins = [test.spin.copy() for _ in radii]
    last, force, total = 0 * v, 0 * v, 0 * v
    sums = np.zeros((3, len(v)))
    while True:
        rate = rate + 0.5 * h * total / m
        overlap = overlap - h * rate
        inside = overlap > 0
        if not inside.any():
            return sums
        depth = np.maximum(overlap, 0)
        a = np.sqrt(r * depth)
        elastic = 4 / 3 * e * a * depth
        total = np.maximum(elastic - 2 * ratio * np.sqrt(m * 2 * e * a) * rate, 0) * inside
        rate = rate + 0.5 * h * total / m
        arms = [radius - share * depth for radius in radii]
        slip = v + sum(w * arm for w, arm in zip(spins, arms, strict=True))
        force = force * np.where(a < last, a / np.maximum(last, 1e-300), 1) + 8 * g * a * slip * h
        last = a
        force = np.clip(force, -test.friction * elastic, test.friction * elastic)
        v = v - h * force / m
        for w, arm, i in zip(spins, arms, inertia, strict=True):
            w -= h * force * arm / i
        sums += h * np.stack([force, force * arms[0] / test.radius, test.friction * elastic])


def impacts(case: Case, test: Test, samples: int) -> list[Step]:
    """Run all impacts of a test side by side; return the steps of the field file."""
    n = len(test.normal)
    gap = 1e-9 * test.radius
    apart = 6 * max(test.radius, test.partner) * np.arange(n)
    zero = np.zeros(n)
    first = np.stack([zero, apart, zero + test.radius + gap], axis=1)
    v = np.stack([test.tangential, zero, -test.normal], axis=1)
    omega = np.stack([zero, -test.spin, zero], axis=1)
    x, radius, plane = first, np.full((n, 3), test.radius), 0.0
    if test.partner:
        second = np.stack([zero, apart, zero - test.partner], axis=1)
        x, plane = np.concatenate([first, second]), -6 * test.partner
        radius = np.concatenate([radius, np.full((n, 3), test.partner)])
        v = np.concatenate([0.5 * v, -0.5 * v])
        omega = np.concatenate([omega, omega])
    write_packing(case.folder / f"pack{test.number}.h5", x, radius, v=v, omega=omega)
    time = test.hertz(float(test.normal.min()))[2]
    step = test.hertz(float(test.normal.max()))[2] / test.steps
    end = (2.0 if test.restitution < 1 else 1.1) * time
    values = {
        "NUMBER": test.number, "END": end, "DENSITY": test.density, "YOUNG": test.young,
        "POISSON": test.poisson, "FRICTION": test.friction, "RETURN": test.restitution,
        "PLANE": plane, "STEP": step, "EVERY": end / samples,
    }  # fmt: skip
    deck = (case.folder / "deck.nml").read_text()
    for word, value in values.items():
        text = str(value) if isinstance(value, int) else f"{value:.10e}"
        deck = deck.replace(word, text)
    name = f"test{test.number}.nml"
    (case.folder / name).write_text(deck)
    case.run("talus-dem", name)
    return field_steps(case.folder / f"test{test.number}.h5")


def head_on(case: Case, test: Test) -> tuple[np.ndarray, np.ndarray]:
    """Judge the largest force and overlap and the contact time; return overlaps and forces."""
    steps = impacts(case, test, 400)
    time = np.array([s.time for s in steps])
    if test.partner:
        apart = np.array([np.linalg.norm(s.grains["x"][1] - s.grains["x"][0]) for s in steps])
        overlap = test.radius + test.partner - apart
    else:
        overlap = np.array([test.radius - s.grains["x"][0, 2] for s in steps])
    force = np.array([np.linalg.norm(s.grains["force"][0]) for s in steps])
    top = int(np.argmax(overlap))
    force_fit = np.polyfit(time[top - 3 : top + 4] - time[top], force[top - 3 : top + 4], 2)
    depth_fit = np.polyfit(time[top - 3 : top + 4] - time[top], overlap[top - 3 : top + 4], 2)
    inside = np.flatnonzero(overlap > 0)
    last = inside[-1]
    end = np.interp(0.0, -overlap[last : last + 2], time[last : last + 2])
    exact = test.hertz(float(test.normal[0]))
    peak = force_fit[2] - force_fit[1] ** 2 / (4 * force_fit[0])
    depth = depth_fit[2] - depth_fit[1] ** 2 / (4 * depth_fit[0])
    name = f"test {test.number}:"
    case.metric(f"{name} largest force [kN]", peak / 1e3, exact[0] / 1e3, 2e-4 * exact[0] / 1e3)
    case.metric(f"{name} overlap [um]", depth * 1e6, exact[1] * 1e6, 1e-4 * exact[1] * 1e6)
    case.metric(f"{name} time [us]", end * 1e6, exact[2] * 1e6, 1e-3 * exact[2] * 1e6)
    return overlap, force


def oblique(case: Case, test: Test) -> tuple[np.ndarray, ...]:
    """Judge a test with slip; return the slip before, impulses measured, of the law, of Coulomb."""
    last = impacts(case, test, 2)[-1].grains
    n = len(test.normal)
    m, _ = test.reduced()
    share = 0.5 if test.partner else 1.0
    own = test.mass(test.radius)
    impulse = own * (share * test.tangential - last["v"][:n, 0])
    turned = 0.4 * own * test.radius * (last["omega"][:n, 1] + test.spin)
    slip = test.tangential + test.spin * (test.radius + test.partner)
    exact = reference(test)
    scale = test.friction * (1 + test.restitution) * m * test.normal
    name = f"test {test.number}:"
    worst = np.abs(impulse - exact[0]) / scale
    case.below(f"{name} impulse, largest difference to the integration", worst.max(), 2e-3)
    worst = np.abs(turned - exact[1]) / scale
    case.below(f"{name} spin, largest difference to the integration", worst.max(), 2e-3)
    slides = exact[0] > (1 - 1e-9) * exact[2]
    worst = np.abs(impulse / exact[2] - 1)[slides]
    case.below(f"{name} impulse of sliding / Coulomb's, less 1", worst.max(), 1.5e-3)
    return slip, impulse / scale, exact[0] / scale


def run(case: Case) -> None:
    """Judge the eight tests; plot the force of test 2 and the impulses of tests 4 to 8."""
    head_on(case, T1)
    overlap, force = head_on(case, T2)
    for e in (0.2, 0.4, 0.6, 0.8, 1.0):
        steps = impacts(case, replace(T3, restitution=e), 2)
        case.metric(f"test 3: rebound at {e}", steps[-1].grains["v"][0, 2] / 3.9, e, 1e-3)
    law = 4 / 3 * T2.modulus() * np.sqrt(T2.radius)
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    fine = np.linspace(0, overlap.max(), 200)
    axes[0].plot(fine * 1e6, law * fine**1.5 / 1e3, "-", label="Hertz")
    axes[0].plot(overlap[::12] * 1e6, force[::12] / 1e3, "o", label="Talus, test 2")
    axes[0].set(xlim=(0, None), xlabel="overlap [um]", ylabel="force [kN]")
    axes[0].legend()
    for test in (T4, T5, T6, T7, T8):
        slip, impulse, exact = oblique(case, test)
        scaled = slip / (3.5 * test.friction * (1 + test.restitution) * test.normal)
        line = axes[1].plot(scaled, exact, "-")[0]
        axes[1].plot(scaled, impulse, "o", color=line.get_color(), label=f"test {test.number}")
        if test.number == 4:
            f = 1 - impulse * test.friction * 1.98 / np.tan(ANGLES)
            case.metric("test 4: f at 30 deg", f[5], 0.6845, 2e-4, "1 - mu (1 + e)/tan")
            spin = 2.5 * impulse[5] * test.friction * 1.98 * test.normal[5] / test.radius
            case.metric("test 4: spin at 30 deg [rad/s]", spin, 615.2, 0.6)
    axes[1].set(
        xlim=(0, 2.5),
        xlabel="slip before / slip that sliding takes away [-]",
        ylabel="tangential impulse / (friction x normal) [-]",
    )
    axes[1].legend()
    case.save(fig)
