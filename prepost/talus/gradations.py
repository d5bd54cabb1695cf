"""Gradations by a law: the share of the mass that passes an opening, between two sizes."""

from math import erf

import numpy as np

from talus.faults import FaultError

FINE = 200  # openings of a curve
#: Parameters of each law, for help and messages.
LAWS = {
    "normal": "mean and standard deviation [m]",
    "lognormal": "median [m] and standard deviation of ln d",
    "rosin-rammler": "size that 63.2 % pass [m] and exponent",
}


def passes(law: str, first: float, second: float, size: np.ndarray) -> np.ndarray:
    """Return the share of the mass that passes each size (n) [m] by a law without limits.

    Normal and lognormal distribution of the mass; Rosin and Rammler (1933, J. Inst. Fuel 7, 29):
    1 - exp(-(d / first)^second), Weibull's distribution of the mass.
    """
    if law == "rosin-rammler":
        return -np.expm1(-((size / first) ** second))
    away = (size - first) / second
    if law == "lognormal":
        away = np.log(size / first) / second
    return np.array([0.5 * (1.0 + erf(x / np.sqrt(2.0))) for x in away])


def law_curve(words: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return openings [m] and shares of the mass of the words LAW FIRST SECOND LEAST LARGEST.

    All of the mass lies between the least and the largest size. Raises E514 for an unknown law or
    numbers that make none.
    """
    law, hint = words[0], f"{'; '.join(f'{law}: {text}' for law, text in LAWS.items())}; limits [m]"
    try:
        first, second, least, largest = (float(word) for word in words[1:])
    except ValueError as fault:
        raise FaultError("E514", f"'{' '.join(words)}' is no law of sizes", hint) from fault
    if law not in LAWS or not (first > 0.0 and second > 0.0 and 0.0 < least < largest < np.inf):
        raise FaultError("E514", f"'{' '.join(words)}' is no law of sizes", hint)
    openings = np.geomspace(least, largest, FINE + 1)
    passing = passes(law, first, second, openings)
    within = passing[-1] - passing[0]
    if not within > 1.0e-6:
        text = f"the law '{' '.join(words)}' has no mass between {least:g} and {largest:g} m"
        raise FaultError("E514", text, "take limits around the middle of the law")
    passing = (passing - passing[0]) / within
    passing[-1] = 1.0
    return openings, passing


def quarters(openings: np.ndarray, passing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return five openings of a curve: the limits and where quarters of the mass pass."""
    shares = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    return np.interp(shares, passing, openings), shares
