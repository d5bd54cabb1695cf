"""Whether an element test is slow enough: the inertial number among its measures."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.lights import AMBER, GREEN, Light
from talus.specimens import CELL_ENDING, ENDING, SHORT, Specimen, angles, read_test

QUASI_STATIC = 2.0e-3  # inertial number up to which strength hardly depends on the rate [-]
FAST = 5.0e-3  # above it a report is amber [-]
COLUMN = "inertial_number"
CURE = (
    "Shear more slowly and longer (rate of &cell_rate or velocity of the walls, and t_end): the "
    "inertial number goes with the rate."
)


def inertial_number(history: Path, test: Specimen) -> float:
    """Return the median inertial number of a test [-]; NaN where it has no &measure."""
    for path in sorted(history.parent.glob(f"{test.name}_measure_*.csv")):
        try:
            values = histories.read(path)[COLUMN]
        except (FaultError, KeyError):
            continue
        if np.isfinite(values).any():
            return float(np.nanmedian(values))
    return float("nan")


def sheared(test: Specimen) -> bool:
    """Return whether a history is a test of strength: more shape than volume changed."""
    axial, volume = test.axial_strain[-1], test.volumetric_strain[-1]
    return bool(axial >= SHORT and abs(volume) < 0.5 * axial)


def said(number: float) -> str:
    """Return what follows the friction angle in a line: the inertial number, and what it means."""
    if not np.isfinite(number):
        return ""
    text = f"; inertial number {number:.1e} (median)"
    return text + (f", above {FAST:g}: too fast, the angle depends on the rate"
                   if number > FAST else "")  # fmt: skip


def tests_of(folder: Path) -> dict[str, tuple[Path, Specimen]]:
    """Return the tests of strength of a folder by the name of their run."""
    found = {}
    for ending in (ENDING, CELL_ENDING):
        for path in sorted(folder.glob(f"*{ending}.csv")):
            try:
                test = read_test(path)
            except FaultError:
                continue
            if sheared(test):
                found[test.name] = (path, test)
    return found


def lines(tests: dict[str, tuple[Path, Specimen]]) -> list[str]:
    """Return a sentence a test: friction angles and inertial number."""
    return [f"{name}: {angles(test)}{said(inertial_number(path, test))}."
            for name, (path, test) in tests.items()]  # fmt: skip


def judged(light: Light, test: tuple[Path, Specimen] | None) -> Light:
    """Return a run's light, amber at least where its test was too fast to be quasi-static."""
    number = inertial_number(*test) if test else float("nan")
    if not number > FAST:
        return light
    why = (f"The inertial number is {number:.1e} (limit {FAST:g}; a test is quasi-static below "
           f"about {QUASI_STATIC:g}): its strength depends on the rate.")  # fmt: skip
    if light.colour == GREEN:
        return Light(AMBER, ["It finished, but its test was too fast.", why], [CURE])
    return Light(light.colour, [*light.why, why], [*light.cure, CURE])
