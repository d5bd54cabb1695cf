"""Compare the force on the cone and the cost of all beds; draw them.

Usage: judge.py PLACE ..., in the folder of the run; result.txt, force.png, bed.png.
"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from forces import force_curve  # noqa: E402
from plans import PLANS  # noqa: E402

from talus.verification import field_steps, read_history  # noqa: E402

PLAN = PLANS["deep"]
RUNS = {"whole": "whole bed", "narrow": "opened, 32 mm", "wide": "opened, 43 mm",
        "box_wide": "rigid box, 43 mm"}  # fmt: skip
BANDS = ((0, 20), (20, 40), (40, 60), (20, 60))  # depth [mm]


def files_of(name: str, place: str) -> str:
    """Return the beginning of the names of the grains' results."""
    return f"{name}_{place}/grains" if name in PLAN.zones else f"{name}_{place}"


def mean_in(force: np.ndarray, band: tuple[int, int]) -> float:
    """Return the mean force in a band of depth [N]."""
    return float(force[band[0]:band[1]].mean())


def main(places: list[str]) -> None:
    """Write the table and both pictures."""
    curves = {(name, place): force_curve(files_of(name, place), PLAN)[1] for place in places for name in RUNS
              if (Path(f"{name}_{place}.finished")).exists()}  # fmt: skip
    with Path("cost.csv").open() as file:
        cost = {row[0]: (float(row[1]), float(row[2])) for row in csv.reader(file)}
    lines = ["bed                        place  force [N] at 0-20, 20-40, 40-60, 20-60 mm   over the whole bed's"
             "      wall [s]  processors [s]"]  # fmt: skip
    for (name, place), curve in curves.items():
        force = [mean_in(curve, band) for band in BANDS]
        ratio = [f / mean_in(curves["whole", place], band)
                 for f, band in zip(force, BANDS, strict=True)]  # fmt: skip
        wall, spent = cost.get(f"{name}_{place}", (np.nan, np.nan))
        lines.append(f"{RUNS[name]:28s} {place}  " + " ".join(f"{f:9.4f}" for f in force) + "     "
                     + " ".join(f"{r:7.3f}" for r in ratio) + f"  {wall:8.0f} {spent:8.0f}")  # fmt: skip
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    draw_forces(curves, places)
    draw_beds(places[0])


def draw_forces(curves: dict, places: list[str]) -> None:
    """Draw the forces over depth, a panel a place, and the grains that are awake."""
    fig, axes = plt.subplots(ncols=len(places) + 1, figsize=(4.2 * (len(places) + 1), 4.0),
                             layout="constrained")  # fmt: skip
    for ax, place in zip(axes, places, strict=False):
        for name, label in RUNS.items():
            if (name, place) in curves:
                force = curves[name, place]
                ax.plot(force, np.arange(len(force)) + 0.5, lw=1.0, label=label)
        ax.set(xlabel="force on the cone [N]", ylabel="way of the cone [mm]", ylim=(60.0, 0.0),
               xlim=(0.0, None), title=f"place {place}")  # fmt: skip
    axes[0].legend(fontsize=8)
    rows = read_history(Path(f"wide_{places[0]}/coupled_conversions.csv"))
    axes[-1].step(rows["awake"], 1e3 * PLAN.speed * rows["time"], where="pre")
    axes[-1].set(xlabel="grains awake", ylabel="way of the cone [mm]", ylim=(60.0, 0.0),
                 xlim=(0.0, None), title=RUNS["wide"])  # fmt: skip
    fig.savefig("force.png", dpi=110)


def draw_beds(place: str) -> None:
    """Draw a slice through the axis of the cone at the end: how fast grains move."""
    fig, axes = plt.subplots(ncols=2, figsize=(12.0, 4.2), sharey=True, layout="constrained")
    x, y = PLAN.places[place]
    for ax, name in zip(axes, ("whole", "wide"), strict=True):
        steps = field_steps(Path(f"{files_of(name, place)}.h5"))
        g = steps[-1].grains
        near = np.abs(g["x"][:, 1] - y) < 3e-3
        speed = np.linalg.norm(g["v"], axis=1) / PLAN.speed
        dots = ax.scatter(1e3 * (g["x"][near, 0] - x), 1e3 * g["x"][near, 2], s=9, c=speed[near],
                          vmin=0.0, vmax=0.5, cmap="viridis")  # fmt: skip
        ghost = near & (g["kind"] == 3)
        ax.scatter(1e3 * (g["x"][ghost, 0] - x), 1e3 * g["x"][ghost, 2], s=9, c="0.7")
        tip = 1e3 * (PLAN.tip - PLAN.speed * steps[-1].time)
        ax.plot([0, 6, 6, -6, -6, 0], [tip, tip + 10.4, 140, 140, tip + 10.4, tip], "k", lw=1.0)
        ax.set(xlabel="x [mm]", aspect="equal", xlim=(-108, 108), ylim=(-6, 145),
               title=f"{RUNS[name]}: {len(g['id'])} grains")  # fmt: skip
    axes[0].set(ylabel="z [mm]")
    fig.colorbar(dots, ax=axes, label="speed / that of the cone")
    fig.savefig("bed.png", dpi=110)


if __name__ == "__main__":
    main(sys.argv[1:])
