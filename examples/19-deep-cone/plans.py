"""Sizes of the beds of this example, and which plan the folder of a run follows."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

EDGE, RADIUS = 0.036, 6.0e-3  # width of a column and radius of the cone [m]


@dataclass(frozen=True)
class Zone:
    """Half-widths of the free grains of a zone and of its ghosts, `free_within` of its deck [m]."""

    within: float
    free: float
    ghost: float


@dataclass(frozen=True)
class Plan:
    """A bed, the way of the cone, and the zones around it."""

    copies: int  #: columns along x and y
    height: float  #: of the bed [m]
    elements: tuple[int, int, int]
    places: dict[str, tuple[float, float]]  #: of the cone: corners of elements [m]
    speed: float  #: of the cone [m/s]
    stroke: float  #: [m]
    tip: float  #: at the start [m]
    middle: float  #: depth in the middle of the way that is judged [m]
    end: float  #: of the runs: a number of exchanges of 0.19 ms [s]
    every: float  #: time between conversions [s]
    zones: dict[str, Zone] = field(default_factory=dict)
    boxes: tuple[str, ...] = ("wide",)  #: zones whose free grains the rigid boxes have
    tests: tuple[int, ...] = (1, 2, 3)  #: borders of layers that are tested
    above: float = 0.04  #: height above which grains may be awake at first [m]
    beyond: tuple[float, ...] = ()  #: widths of elements from the fine middle to the sides [m]

    def lines(self) -> np.ndarray:
        """Return where planes of the mesh cross x and y (n + 1) [m]."""
        wide, number = self.copies * EDGE, self.elements[0]
        sides = np.array(self.beyond)
        fine = (wide - 2.0 * sides.sum()) / (number - 2 * len(sides))
        widths = [*sides[::-1], *[fine] * (number - 2 * len(sides)), *sides]
        return np.concatenate([[0.0], np.cumsum(widths)])


PLACES = {"a": (0.0, 0.0), "b": (0.009, 0.009), "c": (-0.009, 0.0), "d": (0.0, -0.018)}


def shallow(copies: int, elements: int, **more: object) -> Plan:
    """Return a bed of so many columns each way, 70 mm deep, for a way of 20 mm from its middle.

    The grains around a place are those of each such bed, so that forces in two of them compare.
    """
    middle = copies // 2 * EDGE
    places = {name: (middle + x, middle + y) for name, (x, y) in PLACES.items()}
    return Plan(copies, 0.07, (elements, elements, 8), places, 0.2, 0.02, 0.0715, 0.012, 0.1083,
                0.0209, tests=(1,), above=0.015, **more)  # fmt: skip


ZONES = {"near": Zone(0.018, 0.027, 0.036), "mid": Zone(0.027, 0.036, 0.045),
         "far": Zone(0.036, 0.045, 0.054)}  # fmt: skip
PLANS = {
    "deep": Plan(
        6, 0.13, (20, 20, 12), {"a": (0.108, 0.108), "b": (0.1188, 0.1296)}, 0.1, 0.06, 0.1305,
        0.04, 0.6099, 0.052,
        {"narrow": Zone(0.030, 0.0324, 0.0432), "wide": Zone(0.032, 0.0432, 0.054)},
    ),
    "shallow": shallow(4, 16, zones={"wide": Zone(0.027, 0.036, 0.045)}),
    "bed4": shallow(4, 16, zones={"mid": ZONES["mid"]}, boxes=()),
    "bed8": shallow(8, 26, zones=ZONES, boxes=("near", "mid", "far"), beyond=(0.012, 0.018, 0.024)),
    "bed13": shallow(13, 30, zones={"mid": ZONES["mid"]}, boxes=(),
                     beyond=(0.012, 0.018, 0.026, 0.038, 0.05)),
}  # fmt: skip


def plan_here() -> Plan:
    """Return the plan that is named in the file `plan` of this folder, else the deep one."""
    named = Path("plan")
    return PLANS[named.read_text().strip() if named.exists() else "deep"]
