"""Draw sinkage, drawbar pull and torque of the hub over its way.

Usage: results.py FOLDER, that of run.sh. Prints means over the second half of the way.
"""

import sys
from pathlib import Path

import numpy as np

from talus.histories import read
from talus.look import new_figure, save_figure

WINDOW = 11  # rows of a running mean: 10 ms


def smooth(values: np.ndarray) -> np.ndarray:
    """Return running means; ends are those of fewer rows."""
    weight = np.ones(WINDOW)
    return np.convolve(values, weight, "same") / np.convolve(np.ones(len(values)), weight, "same")


def main() -> int:
    """Write hub.png."""
    folder = Path(sys.argv[1])
    found = read(folder / "solid_rigid.csv")
    way = 1e3 * found["hub x"]
    rows = {
        "sinkage [mm]": -1e3 * found["hub z"],
        "drawbar pull [N]": -found["hub force x"],
        "torque [N m]": found["hub moment y"],
        "load carried [N]": -found["hub force z"],
    }
    rolling = way > 0.0
    late = way > 0.5 * way.max()
    fig, axes = new_figure(nrows=len(rows), sharex=True, figsize=(6.4, 8.4))
    for ax, (label, values) in zip(axes, rows.items(), strict=True):
        ax.plot(way[rolling], values[rolling], "-", color="#bbbbbb", lw=0.8)
        ax.plot(way[rolling], smooth(values)[rolling], "-")
        ax.set(ylabel=label)
        print(f"{label}: {values[late].mean():.3g} +- {values[late].std():.2g}")
    axes[-1].set(xlabel="way of the hub [mm]")
    save_figure(fig, folder / "hub.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
