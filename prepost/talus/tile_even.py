"""Equal normal stresses at edges that keep their ratio: small cycles of strain at a held mean.

A pressed packing of some hundred grains bears normal stresses that differ by some per cent. A servo
an axis would make them equal, but leave edges apart. Here the cell is strained without change of
volume against the wanted change of stress and back to where it was, while the mean is held: loading
is softer than unloading, so some of the stress of the way back stays. A cycle that made the
stresses more equal is kept and the next goes on from there; another is dropped and tried with less
strain. Where no strain helps, a large one begins the search anew.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

EVEN = 5.0e-3  # normal stresses are equal within this part of their mean
MOST_CYCLES = 30
FIRST = 3.0  # amplitude over the root of the relative error, in strains of a Hertz contact
LEAST, MOST = 0.05, 2.0  # amplitudes in those
LEAST_CHANGE, MOST_CHANGE = 0.4, 1.8  # of the amplitude from one cycle to the next
DROPPED = 0.6  # of the amplitude after a cycle that is dropped
CORNER = 1.0e-3  # of the time of half a cycle, in which the rate begins, turns (twice) and ends
AFTER = 1.5  # of the time of a cycle, until its run ends: rates are means over the next 10 steps
CYCLE = """&cell_rate component = 'xx', rate = {rates[0]:.12g}, curve = 'cycle' /
&cell_rate component = 'yy', rate = {rates[1]:.12g}, curve = 'cycle' /
&cell_rate component = 'zz', rate = {rates[2]:.12g}, curve = 'cycle' /
&curve     id = 'cycle', values = 0.0, 1.0, 1.0, -1.0, -1.0, 0.0, times = {times} /
"""


class Cycles(Protocol):
    """What is used here of the stages of a tile: one cycle from the last one that was kept."""

    def cycle(self, number: int, strain: np.ndarray) -> np.ndarray:
        """Strain the cell by (3) and back; return its normal stresses at rest (3) [Pa]."""

    def keep(self) -> None:
        """Let the next cycle begin where the last one ended."""


def cycle_text(strain: np.ndarray, rate: float) -> tuple[str, float]:
    """Return the groups of a cycle with strains (3) at a largest rate [1/s], and its time [s]."""
    half = float(np.abs(strain).max()) / rate
    c = CORNER
    times = half * np.array([0.0, c, 1.0, 1.0 + 2.0 * c, 2.0 + c, 2.0 + 2.0 * c])
    words = ", ".join(f"{time:.12g}" for time in times)
    return CYCLE.format(rates=strain / half, times=words), AFTER * float(times[-1])


def even(stages: Cycles, normal: np.ndarray, young: float, say: Callable[[str], None]) -> float:
    """Cycle until the normal stresses (3) [Pa] are equal, and return by how much they are not.

    Young's modulus [Pa] scales the strain.
    The residual of a cycle is about quadratic in its amplitude as long as that is small.
    """
    scale = float((normal.mean() / young) ** (2.0 / 3.0))
    apart = normal / normal.mean() - 1.0
    amplitude = min(FIRST * np.linalg.norm(apart) ** 0.5, MOST)
    number = kept = 0
    shaken = False
    while np.abs(apart).max() > EVEN and number < MOST_CYCLES:
        number += 1
        size = np.linalg.norm(apart)
        # a normal stress that is too low: longer first, then back
        normal = stages.cycle(number, -amplitude * scale * apart / size)
        after = normal / normal.mean() - 1.0
        left = np.linalg.norm(after)
        if left >= size and not shaken:
            amplitude *= DROPPED
            shaken = amplitude < LEAST
            amplitude = MOST if shaken else amplitude
            continue
        stages.keep()
        shaken = False
        change = (left / max(size - left, 1.0e-6)) ** 0.5
        amplitude = min(amplitude * float(np.clip(change, LEAST_CHANGE, MOST_CHANGE)), MOST)
        apart, kept = after, kept + 1
    error = float(np.abs(apart).max())
    if number:
        part = f"{100.0 * error:.2g} %"
        say(f"normal stresses equal to {part} by {kept} of {number} cycles of strain")
    return error
