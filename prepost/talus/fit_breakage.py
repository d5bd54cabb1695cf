"""Constants of the law `breakage` from gradings and the compression of a bed that crushes.

Breakage is read from the second moment of the grading by mass, which is what the energy of the law
goes with (eq. F.85); the critical energy from the stress at yield (eq. F.86); the angle from the
plastic work of the volume over that of breakage (eq. F.87).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fit_tests import Test, norms
from talus.grading_plots import sieves_of

WHOLE_YET = 0.01  # breakage up to which a bed is elastic, for its modulus
YIELD = 0.05  # a twentieth of full breakage, at which a bed has yielded
SMALL = 1.0e-6
WHOLE = 1.0 - 1.0e-9  # of the mass


@dataclass
class Crushing:
    """What gradings and a compression tell about the law, before any fit."""

    index: float  # theta [-]
    young: float  # [Pa], of the secant to yield
    energy: float  # E_c [J/m3]
    angle_deg: float  # omega
    pressure: float  # p at yield [Pa]
    largest: float  # x_M [m]

    def constants(self) -> dict[str, float]:
        """Return the constants by their keys in &material."""
        return {"young": self.young, "breakage_energy": self.energy,
                "breakage_angle_deg": self.angle_deg, "grading_index": self.index}  # fmt: skip


def second_moments(sizes: np.ndarray, passing: np.ndarray) -> np.ndarray:
    """Return <x^2> by mass (times) [m2] of gradings (times, n), even in size between sieves (n)."""
    low = np.concatenate([[0.0], sizes[:-1]])
    part = np.diff(np.concatenate([np.zeros((len(passing), 1)), passing], axis=1), axis=1)
    return part @ ((low**2 + low * sizes + sizes**2) / 3.0)


def ultimate_moment(least: float, largest: float, fractal: float) -> float:
    """Return <x^2> by mass [m2] of the ultimate grading, fractal between two sizes [m]."""
    a, b = 3.0 - fractal, 5.0 - fractal
    return a / b * (largest**b - least**b) / (largest**a - least**a)


def read_breakage(path: Path, least: float, fractal: float) -> tuple[np.ndarray, ...]:
    """Return times [s], breakage B (times), theta and x_M [m] of a history of gradings. eq. F.85

    x_M is the smallest sieve that everything passes at the start.
    """
    rows = histories.read(path)
    sizes, passing, _ = sieves_of(rows)
    whole = np.flatnonzero(passing[0] >= WHOLE)
    if not len(whole) or not least < sizes[whole[0]]:
        hint = "give &grading a sieve that all grains pass at the start, above grain_size_min"
        raise FaultError("E642", "no sieve is known to be the largest size", hint, str(path))
    largest = sizes[whole[0]]
    moments = second_moments(sizes, passing)
    index = 1.0 - ultimate_moment(least, largest, fractal) / moments[0]
    if not index > 0.0:
        hint = f"a smaller grain_size_min than {least:g} m, or a larger fractal_dimension"
        raise FaultError("E642", "the ultimate grading is coarser than that of the start", hint,
                         str(path))  # fmt: skip
    return rows["time"], (1.0 - moments / moments[0]) / index, float(index), float(largest)


def invariants(test: Test) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return p, q [Pa] and the compression from the first row [-] of a test (rows)."""
    p = -test.stress[:, :3].mean(axis=1)
    s = test.stress.copy()
    s[:, :3] += p[:, None]
    return p, np.sqrt(1.5) * norms(s), -test.strain[:, :3].sum(axis=1)


def find(test: Test, grading: Path, constants: dict[str, float]) -> Crushing:
    """Return the constants that the grading and the compression tell. eq. F.86, F.87

    `constants` has poisson, critical_slope, grain_size_min [m] and fractal_dimension of the deck.
    """
    if not len(test.time):
        hint = "gradings belong to its rows by their times"
        raise FaultError("E642", f"the test {test.name} has no column 'time [s]'", hint)
    times, breakage, index, largest = read_breakage(
        grading, constants["grain_size_min"], constants["fractal_dimension"]
    )
    b = np.interp(test.time, times, np.maximum.accumulate(breakage))
    p, q, volume = invariants(test)
    before, at = yield_rows(p, b, test.name)
    left = 1.0 - (q / (constants["critical_slope"] * np.maximum(p, SMALL * p[at]))) ** 2
    if not left[at] > 0.0:
        hint = f"q/p is {q[at] / p[at]:.3g} there: a larger critical_slope"
        raise FaultError("E642", "the bed yields by friction before it crushes", hint)
    per_young = 1.0 / (3.0 * (1.0 - 2.0 * constants["poisson"]))
    bulk = float((p[before] - p[0]) / volume[before])
    shear = bulk / per_young / (2.0 * (1.0 + constants["poisson"]))
    energy = index * (0.5 * p[at] ** 2 / bulk + q[at] ** 2 / (6.0 * shear)) / left[at]
    plastic = volume - p / ((1.0 - index * b) * bulk)  # but for that of the start
    released = energy * np.maximum(left, 0.0) / np.maximum(1.0 - b, SMALL) ** 2
    ratio = over(p, plastic, at) / over(released, b, at)
    angle = float(np.degrees(np.arctan(np.sqrt(max(ratio, 0.0)))))
    return Crushing(float(index), bulk / per_young, float(energy), angle, float(p[at]), largest)


def yield_rows(p: np.ndarray, b: np.ndarray, name: str) -> tuple[int, int]:
    """Return the rows of the largest pressure while grains are whole, and up to yield."""
    whole, k = int(np.argmax(b >= WHOLE_YET)), int(np.argmax(b >= YIELD))
    if b[-1] < YIELD or whole < 2 or k > len(b) - 3:
        hint = f"breakage must pass {WHOLE_YET} and {YIELD}, some rows from the ends of the test"
        raise FaultError("E642", f"breakage goes from {b[0]:.2g} to {b[-1]:.2g} in {name}", hint)
    return 1 + int(np.argmax(p[1:whole])), int(np.argmax(p[: k + 1]))


def over(values: np.ndarray, path: np.ndarray, start: int) -> float:
    """Return the integral of values over a path from a row on."""
    mean = 0.5 * (values[start:-1] + values[start + 1 :])
    return float(mean @ np.diff(path[start:]))
