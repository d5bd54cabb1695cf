"""`talus compare`: two packings by solid fraction, coordination, height, fabric, screening."""

import argparse
from pathlib import Path

from talus import measure
from talus.arguments import counting
from talus.faults import FaultError
from talus.fields import read_grains
from talus.progress import watch

LIMITS = {
    "solid_fraction": 0.01,
    "coordination": 0.25,
    "height": 2.0e-3,
    "fabric": 0.05,
    "floor": 0.1,
}
LIMIT_OF = {
    "solid fraction": "solid_fraction",
    "coordination": "coordination",
    "bed height [m]": "height",
    "short axes, zz": "fabric",
    "short axes, xx": "fabric",
    "load on floor / weight": "floor",
}


def register(commands: argparse._SubParsersAction) -> None:
    """Add `compare`."""
    new = commands.add_parser("compare", help="compare two packings")
    new.add_argument("first", type=Path, help="packing, or field file of grains (last step)")
    new.add_argument("second", type=Path)
    new.add_argument("--layers", type=counting, default=5, help="layers of the solid fraction")
    text = ", ".join(f"{name}={value:g}" for name, value in LIMITS.items())
    new.add_argument(
        "--limits",
        nargs="*",
        default=[],
        metavar="NAME=VALUE",
        help=f"largest differences (default {text})",
    )
    new.set_defaults(run=compare)


def read_limits(texts: list[str]) -> dict[str, float]:
    """Return the limits, those that were given in place of the defaults."""
    limits = dict(LIMITS)
    for text in texts:
        name, _, value = text.partition("=")
        try:
            if name not in LIMITS:
                raise ValueError(f"no limit '{name}'")
            limits[name] = float(value)
        except ValueError as fault:
            hint = f"NAME=VALUE with {', '.join(LIMITS)}"
            raise FaultError("E551", f"'{text}' is no limit: {fault}", hint) from fault
    return limits


def compare(options: argparse.Namespace) -> int:
    """Print both columns, differences and limits; return 1 if a limit is passed."""
    limits = read_limits(options.limits)
    facts = []
    for path in (options.first, options.second):
        packing, force = read_grains(path)
        facts.append(measure.describe(packing, options.layers, watch, force))
    print(f"{'':28s} {'first':>12s} {'second':>12s} {'difference':>12s} {'limit':>10s}")
    beyond = 0
    for name, one in facts[0].items():
        if name not in facts[1]:  # forces are known of one only
            continue
        two = facts[1][name]
        limit = limits.get(LIMIT_OF.get(name, ""))
        far = limit is not None and not abs(two - one) <= limit
        beyond += far
        shown = "" if limit is None else f"{limit:10.4g}"
        print(
            f"{name:28s} {one:12.6g} {two:12.6g} {two - one:12.4g} {shown:>10s}{'  BEYOND' * far}"
        )
    print(f"{beyond} beyond their limits" if beyond else "within all limits")
    return int(beyond > 0)
