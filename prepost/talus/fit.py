"""Constants of a law of solids from element tests, by least squares of the stress.

The law is talus-fem's own (`--point`), driven along the strain of each test from its first stress.
Nothing is assumed of a test but that its material is uniform: drained or not, any direction.
Levenberg and Marquardt's method in the constants over their starts, within bounds; uncertainties
are those of the linear model about the best fit, with the scatter of the residuals.
"""

import os
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fit_decks import with_constants
from talus.fit_tests import COMPONENTS, Test, deck_of, misfit
from talus.programs import find_program

ONE_THREAD = os.environ | {"OMP_NUM_THREADS": "1"}  # tests run beside each other
PROBE = 1.0e-4  # of a constant, for differences
MOST_STEPS = 40
STILL = 1.0e-7  # of the constants, in a step
GAIN = 1.0e-6  # of the sum of squares, in the last step
MOST_DAMPING = 1.0e10
DIM = 1.0e-10  # of the largest influence, below which a constant has none
APART = 1.0e-7  # least singular value over the largest: below, constants are not told apart
PART = 0.1  # of the combination that the tests do not see, of a constant that is named


@dataclass
class Fit:
    """The best constants with their standard deviations and what is left."""

    names: list[str]
    values: np.ndarray
    deviations: np.ndarray  # NaN where a constant is at its bound
    correlation: np.ndarray  # NaN in the rows and columns of these
    residual: float  # rms over the largest stress of each test
    steps: int
    points: int
    misfits: dict[str, float] = field(default_factory=dict)  # by test
    at_bound: list[str] = field(default_factory=list)
    converged: bool = True  # False: the steps were used up

    def loose(self) -> list[str]:
        """Return constants whose standard deviation is larger than they are."""
        wide = self.deviations > np.abs(self.values)
        return [name for name, yes in zip(self.names, wide, strict=True) if yes]

    def pairs(self, least: float) -> list[tuple[str, str, float]]:
        """Return pairs of constants whose correlation is `least` or more in size, largest first."""
        found = [(self.names[i], self.names[j], float(self.correlation[i, j]))
                 for i in range(len(self.names)) for j in range(i)
                 if abs(self.correlation[i, j]) >= least]  # fmt: skip
        return sorted(found, key=lambda pair: -abs(pair[2]))


@dataclass
class Bounds:
    """Least and largest values of constants, infinite where there are none."""

    low: np.ndarray
    high: np.ndarray

    def clip(self, values: np.ndarray) -> np.ndarray:
        """Return values within the bounds."""
        return np.clip(values, self.low, self.high)

    def pressed(self, values: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return which constants are at a bound that the gradient presses them to."""
        below = (values <= self.low) & (gradient > 0.0)
        return below | ((values >= self.high) & (gradient < 0.0))


def bounds_of(names: list[str], given: dict[str, tuple[float, float]]) -> Bounds:
    """Return the bounds of constants in their order."""
    pairs = [given.get(name, (-np.inf, np.inf)) for name in names]
    return Bounds(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs]))


class Model:
    """Stress of a law along tests, by runs of talus-fem."""

    def __init__(self, material: str, names: list[str], tests: list[Test]):
        """Keep the text of the material, the constants to be fitted and the tests."""
        self.material, self.names, self.tests = material, names, tests
        self.labels = {v for test in tests for v in test.own.values() if isinstance(v, str)}
        self.program = find_program("talus-fem")
        self.message = ""
        unknown = sorted(self.labels - set(names))
        if unknown:
            hint = f"--free {unknown[0]}=START, or give the test a number"
            raise FaultError("E560", f"'{unknown[0]}' of a test is no free constant", hint)

    def constants(self, test: Test, values: np.ndarray) -> dict[str, float]:
        """Return the constants of a test: those of all tests, then its own."""
        free = dict(zip(self.names, map(float, values), strict=True))
        shared = {name: value for name, value in free.items() if name not in self.labels}
        own = {n: free[v] if isinstance(v, str) else v for n, v in test.own.items()}
        return shared | own

    def run(self, test: Test, values: np.ndarray, folder: Path) -> np.ndarray | None:
        """Return the stress of the law along a test (n, 6) [Pa]; None if it fails.

        The table of the law is left in the folder as fit_point.csv.
        """
        deck = folder / "fit.nml"
        deck.write_text(deck_of(with_constants(self.material, self.constants(test, values)), test))
        command = [str(self.program), str(deck), "--point"]
        done = subprocess.run(command, capture_output=True, text=True, env=ONE_THREAD)
        if done.returncode != 0:
            self.message = (done.stderr + done.stdout).strip()
            return None
        table = histories.read(folder / "fit_point.csv").columns
        return np.stack([table[f"stress {c}"] for c in COMPONENTS], axis=1)

    def stresses(self, values: np.ndarray) -> list[np.ndarray] | None:
        """Return the stress of the law along all tests; None if it fails along one."""

        def alone(test: Test) -> np.ndarray | None:
            with tempfile.TemporaryDirectory() as folder:
                return self.run(test, values, Path(folder))

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = list(pool.map(alone, self.tests))
        return None if any(stress is None for stress in found) else found

    def residuals(self, values: np.ndarray) -> np.ndarray | None:
        """Return stress of the law less that of the tests, over its largest; None if it fails."""
        stresses = self.stresses(values)
        if stresses is None:
            return None
        parts = [(stress - test.stress)[1:] / np.abs(test.stress).max()
                 for stress, test in zip(stresses, self.tests, strict=True)]  # fmt: skip
        return np.concatenate([p.ravel() for p in parts])

    def slopes(self, values: np.ndarray, scale: np.ndarray, here: np.ndarray,
               bounds: Bounds) -> np.ndarray:  # fmt: skip
        """Return the slopes of the residuals by the constants over their scales."""
        columns = []
        for k, name in enumerate(self.names):
            for side in (PROBE, -PROBE):
                moved = values.copy()
                moved[k] += side * scale[k]
                inside = bounds.low[k] <= moved[k] <= bounds.high[k]
                there = self.residuals(moved) if inside else None
                if there is not None:
                    break
            else:
                raise FaultError("E562", f"the law fails on both sides of {name} = {values[k]:g}",
                                 self.message)  # fmt: skip
            columns.append((there - here) / side)
        return np.stack(columns, axis=1)


def fit(material: str, start: dict[str, float], tests: list[Test],
        given: dict[str, tuple[float, float]] | None = None) -> Fit:  # fmt: skip
    """Return the constants within bounds that bring the law nearest to the tests."""
    names, values = list(start), np.array(list(start.values()))
    scale = np.where(values == 0.0, 1.0, np.abs(values))
    model, bounds = Model(material, names, tests), bounds_of(names, given or {})
    here = model.residuals(values)
    if here is None:
        raise FaultError("E562", "the law does not follow a test with the constants to begin with",
                         model.message)  # fmt: skip
    damping, steps, still = 1.0e-3, 0, False
    slopes = model.slopes(values, scale, here, bounds)
    check_influence(names, slopes)
    while steps < MOST_STEPS and not still and damping < MOST_DAMPING:
        steps += 1
        held = bounds.pressed(values, slopes.T @ here)
        trial = bounds.clip(values + scale * change_of(slopes, here, damping, held))
        still = np.abs((trial - values) / scale).max() < STILL
        there = model.residuals(trial)
        if there is None or there @ there >= here @ here:
            damping *= 10.0
            continue
        small = there @ there > (1.0 - GAIN) * (here @ here)
        still = still or (small and damping < 1.0)
        values, here, damping = trial, there, damping / 10.0
        slopes = model.slopes(values, scale, here, bounds)
    held = bounds.pressed(values, slopes.T @ here)
    found = judged(names, values, scale, slopes, here, held)
    found.steps, found.converged = steps, bool(still or damping >= MOST_DAMPING)
    found.misfits = judge(material, found, tests)
    return found


def change_of(slopes: np.ndarray, here: np.ndarray, damping: float, held: np.ndarray) -> np.ndarray:
    """Return the damped step of the constants over their scales; held ones stay."""
    change, free = np.zeros(len(held)), ~held
    if free.any():
        part = slopes[:, free]
        normal = part.T @ part
        weights = damping * np.diag(np.diag(normal))
        change[free] = -np.linalg.solve(normal + weights, part.T @ here)
    return change


def check_influence(names: list[str], slopes: np.ndarray) -> None:
    """Refuse constants that the tests say nothing about, alone or beside the others."""
    size = np.linalg.norm(slopes, axis=0)
    for name, own in zip(names, size, strict=True):
        if own <= DIM * size.max() or own == 0.0:
            hint = "leave it out, or add a test that depends on it"
            raise FaultError("E563", f"the tests say nothing about {name}", hint)
    _, share, axes = np.linalg.svd(slopes / size)
    if share[-1] <= APART * share[0]:
        unseen = np.abs(axes[-1])
        group = [n for n, part in zip(names, unseen, strict=True) if part > PART * unseen.max()]
        hint = f"hold one of them, or add tests on other paths (singular value {share[-1]:.1e})"
        raise FaultError("E563", f"the tests do not tell {', '.join(group)} apart", hint)


def judged(names: list[str], values: np.ndarray, scale: np.ndarray, slopes: np.ndarray,
           here: np.ndarray, held: np.ndarray) -> Fit:  # fmt: skip
    """Return the fit with standard deviations and correlations of the constants."""
    free, count = ~held, len(names)
    deviations, correlation = np.full(count, np.nan), np.full((count, count), np.nan)
    if free.any():
        part = slopes[:, free]
        freedom = max(np.count_nonzero(np.abs(part).max(axis=1) > 0) - int(free.sum()), 1)
        covariance = np.linalg.inv(part.T @ part) * (here @ here) / freedom
        spread = np.sqrt(np.diag(covariance))
        safe = np.where(spread > 0, spread, 1.0)
        correlation[np.ix_(free, free)] = covariance / np.outer(safe, safe)
        deviations[free] = spread * scale[free]
    rms = float(np.sqrt(np.mean(here**2)))
    bound = [name for name, yes in zip(names, held, strict=True) if yes]
    return Fit(names, values, deviations, correlation, rms, 0, len(here), {}, bound)


def judge(material: str, found: Fit, tests: list[Test],
          points: Path | None = None) -> dict[str, float]:  # fmt: skip
    """Return the misfit of the law to each test; tables of the law go to the folder `points`."""
    model, misfits = Model(material, found.names, tests), {}
    with tempfile.TemporaryDirectory() as folder:
        for test in tests:
            stress = model.run(test, found.values, Path(folder))
            misfits[test.name] = np.nan if stress is None else misfit(stress, test)
            if points and stress is not None:
                table = (Path(folder) / "fit_point.csv").read_text()
                points.mkdir(parents=True, exist_ok=True)
                (points / f"{test.name}_point.csv").write_text(table)
    return misfits
