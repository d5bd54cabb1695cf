"""Sizes of the beds of this example, and which plan the folder of a run follows."""

from dataclasses import dataclass, field
from pathlib import Path

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
    box: str = "wide"  #: the zone whose free grains the rigid box has
    tests: tuple[int, ...] = (1, 2, 3)  #: borders of layers that are tested
    above: float = 0.04  #: height above which grains may be awake at first [m]


PLANS = {
    "deep": Plan(
        6, 0.13, (20, 20, 12), {"a": (0.108, 0.108), "b": (0.1188, 0.1296)}, 0.1, 0.06, 0.1305,
        0.04, 0.6099, 0.052,
        {"narrow": Zone(0.030, 0.0324, 0.0432), "wide": Zone(0.032, 0.0432, 0.054)},
    ),
    "shallow": Plan(
        4, 0.07, (16, 16, 8), {"a": (0.072, 0.072), "b": (0.081, 0.081), "c": (0.063, 0.072),
                               "d": (0.072, 0.054)},
        0.2, 0.02, 0.0715, 0.012, 0.1083, 0.0209,
        {"wide": Zone(0.027, 0.036, 0.045)}, tests=(1,), above=0.015,
    ),
}  # fmt: skip


def plan_here() -> Plan:
    """Return the plan that is named in the file `plan` of this folder, else the deep one."""
    named = Path("plan")
    return PLANS[named.read_text().strip() if named.exists() else "deep"]
