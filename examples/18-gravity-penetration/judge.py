"""Draw the forces of the three runs over depth, and write their means by bands of depth.

Usage: judge.py OUT. Writes force.png and judge.csv and prints the table. The scatter of a band is
that of its means over 1 mm of depth.
"""

import json
import sys
from pathlib import Path

import numpy as np

from talus.look import COLOURS, new_figure, save_figure
from talus.plots import force_curve

RUNS = {"all grains": ("all_grains", "all_grains"), "overlap": ("core", "overlap"),
        "rigid box": ("box", "box")}  # fmt: skip
BANDS = ((0.0, 5.0), (5.0, 10.0), (10.0, 15.0), (15.0, 20.0))  # depth [mm]
MODE = "gravity, free surface, 0.1 m/s, E = 29 MPa, no background damping"
WINDOW = 1.0  # of the bold lines [mm]


def band_of(curve: dict[str, np.ndarray], low: float, high: float) -> tuple[float, float]:
    """Mean force and the standard deviation of its means over 1 mm [N]."""
    edges = np.arange(low, high + 0.5)
    place = np.digitize(curve["depth"], edges)
    means = [curve["force"][place == k].mean() for k in range(1, len(edges))]
    return float(np.mean(means)), float(np.std(means, ddof=1))


def smooth(curve: dict[str, np.ndarray]) -> np.ndarray:
    """Mean of the force over a window of depth [N]."""
    depth, force = curve["depth"], curve["force"]
    total = np.concatenate([[0.0], np.cumsum(force)])
    low = np.searchsorted(depth, depth - 0.5 * WINDOW)
    high = np.searchsorted(depth, depth + 0.5 * WINDOW, side="right")
    return (total[high] - total[low]) / (high - low)


def main() -> int:
    """Judge a folder."""
    out = Path(sys.argv[1])
    curves = {name: force_curve(out / f"{stem}_driven.csv") for name, (stem, _) in RUNS.items()}
    lines = ["run,from [mm],to [mm],force [N],scatter [N],ratio to all grains,wall time [s]"]
    fig, ax = new_figure(figsize=(7.0, 4.4))
    for k, (name, curve) in enumerate(curves.items()):
        wall = json.loads((out / f"{RUNS[name][1]}_summary.json").read_text())["wall_time_s"]
        ax.plot(curve["depth"], curve["force"], color=COLOURS[k], lw=0.4, alpha=0.5)
        ax.plot(curve["depth"], smooth(curve), color=COLOURS[k], lw=1.8, label=name)
        for low, high in BANDS:
            mean, scatter = band_of(curve, low, high)
            whole = band_of(curves["all grains"], low, high)[0]
            lines.append(f"{name},{low:g},{high:g},{mean:.4g},{scatter:.3g},{mean / whole:.3f},"
                         f"{wall:.4g}")  # fmt: skip
    ax.set(xlabel="penetration depth [mm]", ylabel="force on the penetrator, upwards [N]",
           xlim=(0.0, None))  # fmt: skip
    ax.set_title(MODE, fontsize=9)
    ax.legend(fontsize=8)
    save_figure(fig, out / "force.png")
    (out / "judge.csv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
