"""What tests of grains are judged by: criteria of failure, direct shear, sinkage of plates.

Stresses are positive in compression, angles are degrees, lengths metres.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError

STEEPEST = 200.0  # largest ratio of principal stresses that is searched for


def ratio_of(angle: float) -> float:
    """Ratio of the largest to the least principal stress at an angle of friction [deg]."""
    sine = np.sin(np.radians(angle))
    return float((1.0 + sine) / (1.0 - sine))


def angle_of(ratio: float) -> float:
    """Angle of friction [deg] at a ratio of the largest to the least principal stress."""
    return float(np.degrees(np.arcsin((ratio - 1.0) / (ratio + 1.0))))


def invariants(ratio: float, b: float) -> tuple[float, float, float]:
    """Invariants of the principal stresses ratio, 1 + b (ratio - 1) and 1."""
    one, two = ratio, 1.0 + b * (ratio - 1.0)
    return one + two + 1.0, one * two + two + one, one * two


def lade(ratio: float, b: float) -> float:
    """Lade's measure of failure I1^3/I3 (1977)."""
    first, _, third = invariants(ratio, b)
    return first**3 / third


def matsuoka_nakai(ratio: float, b: float) -> float:
    """Matsuoka and Nakai's measure of failure I1 I2/I3 (1974)."""
    first, second, third = invariants(ratio, b)
    return first * second / third


def angle_by(criterion: object, compression: float, b: float) -> float:
    """Angle of friction [deg] at b of a criterion that equals one in triaxial compression.

    b = (s2 - s3)/(s1 - s3); the angle is that of s1 and s3.
    """
    wanted = criterion(ratio_of(compression), 0.0)

    low, high = 1.0, STEEPEST
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if criterion(middle, b) < wanted else (low, middle)
    return angle_of(low)


def plane_strain_angle(criterion: object, compression: float) -> float:
    """Angle of friction [deg] in plane strain if the criterion is the potential of flow too.

    The middle stress is then where the criterion is least: the root of s1 s3 (Matsuoka-Nakai) or
    the mean of s1 and s3 (Lade).
    """
    places = np.linspace(0.0, 1.0, 401)
    return max(angle_by(criterion, compression, float(b)) for b in places)


def direct_shear_angle(plane_strain: float, dilation: float) -> float:
    """Angle [deg] of shear over normal stress on the plane of a direct shear test, by Davis (1968).

    Directions of stress and strain rate agree and the plane is not strained along itself:
    tan = sin phi cos psi/(1 - sin phi sin psi), phi the angle in plane strain, psi of dilation.
    """
    phi, psi = np.radians(plane_strain), np.radians(dilation)
    slope = np.sin(phi) * np.cos(psi) / (1.0 - np.sin(phi) * np.sin(psi))
    return float(np.degrees(np.arctan(slope)))


@dataclass
class ShearBox:
    """Curves of a direct shear test, one value a time."""

    way: np.ndarray  # of the lower half [m]
    shear: np.ndarray  # force that the grains carry from half to half [N]
    normal: np.ndarray  # force on the plane between the halves [N]
    rise: np.ndarray  # of the lid [m]


def read_shear_box(path: Path, upper: tuple[int, ...], lid: int, flange: int) -> ShearBox:
    """Read *_surfaces.csv of a box whose lower half moves along x under a lid that moves along z.

    Surfaces by their numbers in the deck: those of the upper half, the lid, and the flange of the
    lower half, whose share of the upper grains does not load the plane between the halves.
    """
    rows = histories.read(path)
    numbers = sorted({*upper, lid, flange})
    absent = [k for k in numbers if not (rows["surface"] == k).any()]
    if absent:
        text = f"{path} has no surface {absent[0]}"
        raise FaultError("E558", text, "surfaces count in the order of the deck, from 1")
    part = {
        k: {c: rows[c][rows["surface"] == k] for c in ("x", "z", "force_x", "force_z")}
        for k in numbers
    }
    own = {*upper, lid}
    return ShearBox(
        part[flange]["x"] - part[flange]["x"][0],
        np.abs(sum(part[k]["force_x"] for k in own)),
        np.abs(part[lid]["force_z"]) - np.abs(part[flange]["force_z"]),
        part[lid]["z"] - part[lid]["z"][0],
    )


@dataclass
class Bekker:
    """Pressure under a plate of width b at a sinkage z: p = (k_c/b + k_phi) z^n."""

    k_c: float  # [N/m^(n + 1)]
    k_phi: float  # [N/m^(n + 2)]
    exponent: float
    misfit: float  # rms of the curves fitted over their mean pressure

    def pressure(self, sinkage: np.ndarray, width: float) -> np.ndarray:
        """Pressure [Pa] at sinkages [m] under a plate [m]."""
        return (self.k_c / width + self.k_phi) * sinkage**self.exponent


def bekker(curves: list[tuple[float, np.ndarray, np.ndarray]]) -> Bekker:
    """Fit Bekker's law to curves (width [m], sinkages [m], pressures [Pa]) of several plates.

    For each exponent the two moduli follow from linear least squares; the exponent is the best of
    0.1 to 2.5. One width alone gives k_phi with k_c = 0.
    """
    width = np.concatenate([np.full(len(z), b) for b, z, _ in curves])
    sinkage = np.concatenate([z for _, z, _ in curves])
    pressure = np.concatenate([p for _, _, p in curves])
    if not sinkage.size or (sinkage <= 0.0).any():
        raise FaultError("E558", "a sinkage to be fitted is not above 0", "leave the start out")
    several = len({b for b, _, _ in curves}) > 1
    best = None
    for exponent in np.arange(0.1, 2.5, 0.002):
        power = sinkage**exponent
        columns = np.column_stack([power, power / width] if several else [power])
        moduli = np.linalg.lstsq(columns, pressure, rcond=None)[0]
        error = float(np.sqrt(np.mean((columns @ moduli - pressure) ** 2)))
        if best is None or error < best[0]:
            best = (error, float(exponent), moduli)
    error, exponent, moduli = best
    k_c = float(moduli[1]) if several else 0.0
    return Bekker(k_c, float(moduli[0]), exponent, error / float(pressure.mean()))
