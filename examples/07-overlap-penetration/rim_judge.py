"""Forces of the yielding surround with a free rim beside all grains, place by place, and cost.

Usage: rim_judge.py OUT. Reads OUT/place-*, prints a table and writes OUT/rim.csv and rim.png.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from talus.look import COLOURS, new_figure, save_figure
from talus.plots import force_curve

BANDS = ((0, 5), (5, 10), (10, 15), (15, 20), (10, 20))  # depth [mm]
RUNS = {"all grains": "truth_driven.csv", "overlap": "grains_driven.csv"}


def means(path: Path) -> list[float]:
    """Mean force of each band [N]."""
    curve = force_curve(path)
    inside = [(curve["depth"] >= low) & (curve["depth"] < high) for low, high in BANDS]
    return [float(curve["force"][rows].mean()) for rows in inside]


def seconds(folder: Path) -> dict[str, float]:
    """Seconds of processors of the two runs."""
    with (folder / "cost.csv").open() as file:
        return {row[0]: float(row[2]) for row in csv.reader(file)}


def draw(out: Path, places: list[Path]) -> None:
    """A panel a place."""
    fig, axes = new_figure(ncols=len(places), figsize=(3.0 * len(places), 3.2), sharey=True)
    for ax, folder in zip(np.atleast_1d(axes), places, strict=True):
        for colour, (name, file) in zip(COLOURS, RUNS.items(), strict=False):
            curve = force_curve(folder / file)
            ax.plot(curve["depth"], curve["mean"], color=colour, label=name)
        ax.set(title=folder.name, xlabel="depth [mm]")
    np.atleast_1d(axes)[0].set_ylabel("force [N]")
    np.atleast_1d(axes)[0].legend(fontsize=8)
    save_figure(fig, out / "rim.png")


def main() -> int:
    """Table, file and figure."""
    out = Path(sys.argv[1])
    places = sorted(out.glob("place-*"))
    force = {name: np.array([means(f / file) for f in places]) for name, file in RUNS.items()}
    ratio = force["overlap"] / force["all grains"]
    mean = force["overlap"].mean(axis=0) / force["all grains"].mean(axis=0)
    error = ratio.std(axis=0, ddof=1) / np.sqrt(len(places)) if len(places) > 1 else 0.0 * mean
    rows = [[f"{low}-{high}", *force["all grains"][:, k].round(1), *force["overlap"][:, k].round(1),
             *ratio[:, k].round(2), round(mean[k], 3), round(error[k], 3)]
            for k, (low, high) in enumerate(BANDS)]  # fmt: skip
    head = ["depth_mm", *(f"{run}_{f.name}" for run in ("all", "overlap", "ratio") for f in places),
            "ratio_of_means", "standard_error"]  # fmt: skip
    with (out / "rim.csv").open("w", newline="") as file:
        csv.writer(file).writerows([head, *rows])
    for row in [head, *rows]:
        print("  ".join(str(word) for word in row))
    for folder in places:
        cost = seconds(folder)
        print(f"{folder.name}: {cost['truth']:.0f} and {cost['overlap']:.0f} s of processors, "
              f"{cost['truth'] / cost['overlap']:.1f} times fewer")  # fmt: skip
    draw(out, places)
    return 0


if __name__ == "__main__":
    sys.exit(main())
