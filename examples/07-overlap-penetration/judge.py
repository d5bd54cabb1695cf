"""Compare the coupled run with all grains and with the rigid box: forces by depth, and cost.

Usage: judge.py OUT. Reads *_driven.csv and *_summary.json of the three runs, writes force.png and
judge.csv and prints the table. The scatter of a band is that of its means over 1 mm of depth.
"""

import json
import sys
from pathlib import Path

import numpy as np

from talus.look import COLOURS, new_figure, save_figure
from talus.plots import force_curve

CHORD, YIELDING, STIFF = "overlap, chord", "overlap, yielding", "overlap, probed"
WIDE = "overlap, chord, wider"
RUNS = {"all grains": "truth", CHORD: "chord/grains", YIELDING: "plastic/grains", STIFF: "grains",
        "rigid box": "rigid", WIDE: "wide/grains"}  # fmt: skip
WALL = RUNS | {CHORD: "chord/chord", YIELDING: "plastic/plastic", STIFF: "coupled",
               WIDE: "wide/chord"}  # fmt: skip
BANDS = ((0.0, 5.0), (5.0, 10.0), (10.0, 20.0))  # depth [mm]
COUPLING = ("projection and maps", "pull-backs", "works", "audit and log", "exchange")
MODE = "gravity and 100 kPa on the surface, E = 2.9 GPa, 0.25 m/s, no background damping"


def band_of(curve: dict[str, np.ndarray], low: float, high: float) -> tuple[float, float]:
    """Mean force and the standard deviation of its means over 1 mm [N]; NaN beyond the end."""
    if curve["depth"][-1] < high - 0.5:
        return float("nan"), float("nan")
    edges = np.arange(low, high + 0.5)
    place = np.digitize(curve["depth"], edges)
    means = [curve["force"][place == k].mean() for k in range(1, len(edges))]
    return float(np.mean(means)), float(np.std(means, ddof=1))


def part_of(summary: dict, name: str) -> float:
    """Seconds of a timer."""
    value = summary["timers"].get(name, 0.0)
    return float(value["time_s"] if isinstance(value, dict) else value)


def main() -> int:
    """Judge a folder."""
    out = Path(sys.argv[1])
    curves, wall, share = {}, {}, float("nan")
    for name, stem in RUNS.items():
        if not (out / f"{stem}_driven.csv").exists():
            print(f"{name}: not run")
            continue
        curves[name] = force_curve(out / f"{stem}_driven.csv")
        path = out / f"{WALL[name]}_summary.json"
        if path.exists():
            summary = json.loads(path.read_text())
            wall[name] = float(summary["wall_time_s"])
            if name == CHORD:
                share = sum(part_of(summary, text) for text in COUPLING) / wall[name]
    lines = ["run,from [mm],to [mm],force [N],scatter [N],ratio to all grains,wall time [s]"]
    first = next(iter(curves.values()))
    fig, ax = new_figure(figsize=(7.0, 4.6))
    for k, (name, curve) in enumerate(curves.items()):
        ax.plot(curve["depth"], curve["force"], color=COLOURS[k], lw=0.4, alpha=0.5)
        ax.plot(curve["depth"], curve["mean"], color=COLOURS[k], lw=1.8, label=name)
        for low, high in BANDS:
            (mean, scatter), (whole, _) = band_of(curve, low, high), band_of(first, low, high)
            lines.append(
                f"{name},{low:g},{high:g},{mean:.5g},{scatter:.3g},{mean / whole:.3f},"
                f"{wall.get(name, float('nan')):.5g}"
            )
    ax.set(xlabel="penetration depth [mm]", ylabel="force on the penetrator, upwards [N]")
    ax.set_xlim(left=0.0)
    ax.set_title(MODE, fontsize=9)
    ax.legend(fontsize=8)
    save_figure(fig, out / "force.png")
    if {"all grains", CHORD} <= wall.keys():
        ratio = wall["all grains"] / wall[CHORD]
        lines += [f"wall time of all grains over that of {CHORD},,,,,{ratio:.2f},",
                  f"share of the coupling's timers in {CHORD},,,,,{share:.3f},"]  # fmt: skip
    (out / "judge.csv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
