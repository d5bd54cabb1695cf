"""Judge the penetration's curves: mean force over 30-60 mm depth, ordered as PENETRATION asks.

Usage: judge.py containers.csv moduli.csv. Prints a table and whether each order holds; nothing is
tuned, so an order that does not hold is printed as such and the exit code stays 0.
"""

import csv
import sys
from pathlib import Path

import numpy as np

COLUMNS = ("depth [mm]", "force [N]")
WINDOW = (30.0, 60.0)  # depth [mm]
TIE = 0.02


def means(path: Path) -> dict[str, float]:
    """Return label -> mean force [N] over the window, from rows run, depth, force, mean."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for label in dict.fromkeys(row["run"] for row in rows):
        own = [row for row in rows if row["run"] == label]
        depth, force = (np.array([float(row[name]) for row in own]) for name in COLUMNS)
        inside = (depth >= WINDOW[0]) & (depth <= WINDOW[1])
        if not inside.any():
            raise SystemExit(f"judge: '{label}' of {path} has no rows at {WINDOW} mm depth")
        found[label] = float(force[inside].mean())
    return found


def report(title: str, found: dict[str, float]) -> None:
    """Print means and whether they fall from first to last (ties within 2 %)."""
    values = list(found.values())
    ordered = all(b <= a * (1 + TIE) for a, b in zip(values, values[1:], strict=False))
    print(f"{title}: mean force over {WINDOW[0]:.0f}-{WINDOW[1]:.0f} mm")
    for name, value in found.items():
        print(f"  {name:20s} {value:12.2f} N  {value / values[0]:8.3f}")
    print("  the order holds" if ordered else "  THE ORDER DOES NOT HOLD")


def main() -> int:
    """Judge both tables."""
    report("containers, rigid (small > medium > large)", means(Path(sys.argv[1])))
    report("coupled, falling modulus", means(Path(sys.argv[2])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
