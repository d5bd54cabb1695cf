"""Secant moduli of an element test, and the strain that a body makes beside it.

A linear surround has one modulus. Which one is a matter of the strain that it undergoes: the test
gives the secant to any strain, and the strain beside a body that is pushed in follows from the
volume that it displaces (theory: overlap coupling, Choosing the surround).
"""

from dataclasses import dataclass

import numpy as np

from talus.faults import FaultError
from talus.specimens import Specimen

PER_CENT, ROUNDING = 100.0, 1.0e-9


@dataclass
class Secant:
    """From the start of a test to a strain along its axis, other walls at constant stress."""

    strain: float  # shortening [-]
    young_Pa: float  # rise of the axial stress over the strain
    poisson: float  # lateral lengthening over it [-]
    of_strength: float  # rise of the axial stress over the largest of the test [-]


def secant_at(test: Specimen, strain: float) -> Secant:
    """Secant to a strain of the axis; E557: the test does not reach it."""
    shortening = test.axial_strain
    most = shortening.max()
    if not 0.0 < strain <= (1.0 + ROUNDING) * most:
        text = f"'{test.name}' reaches {PER_CENT * most:.4g} %, not {PER_CENT * strain:.4g} %"
        raise FaultError("E557", text, "choose another strain, or the axis that is shortened")
    reached = min(strain, float(most))
    last = max(int(np.argmax(shortening >= reached)), 1)
    before, after = shortening[last - 1 : last + 1]
    part = (reached - before) / (after - before)

    def at(curve: np.ndarray) -> float:
        """Value at the strain less that at the start."""
        return float((1.0 - part) * curve[last - 1] + part * curve[last] - curve[0])

    rise = at(test.axial)
    lateral = at(test.volumetric_strain) - strain
    strength = float((test.axial - test.axial[0]).max())
    return Secant(strain, rise / strain, -0.5 * lateral / strain, rise / strength)


def strain_to(test: Specimen, share: float) -> float:
    """Strain at which the axial stress has risen by a share of what it rises at most [-]."""
    rise = test.axial - test.axial[0]
    last = int(np.argmax(rise >= share * rise.max()))
    return float(test.axial_strain[last])


def strain_beside(volume: float, area: float, radius: float) -> float:
    """Hoop strain [-] at a radius [m] where a displaced volume [m3] leaves through an area [m2]."""
    return volume / (area * radius)
