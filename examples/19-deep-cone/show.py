"""Draw the demo: the cone in all grains, in the opened bed, and the force on it in all three runs.

Usage, in the folder of the run: show.py; cone.png, cone.txt.
"""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from forces import force_curve  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from plans import EDGE, RADIUS, plan_here  # noqa: E402

from talus.verification import field_steps  # noqa: E402

PLAN, PLACE = plan_here(), "a"
RUNS = {
    f"whole_{PLACE}": "all grains",
    f"wide_{PLACE}/grains": "grains, ghosts and continuum",
    f"box_wide_{PLACE}": "the same grains in a rigid box",
}
FEW = 8  # free grains over an element that is open
BAND = (0.5, 1.0)  # of the stroke, in which forces are compared


def draw_slice(ax: Axes, stem: str, title: str) -> None:
    """Draw grains near the plane through the axis, coloured by their speed; ghosts are grey."""
    steps = field_steps(Path(f"{stem}.h5"))
    g, (x, y) = steps[-1].grains, PLAN.places[PLACE]
    near = np.abs(g["x"][:, 1] - y) < 3e-3
    ghost = near & (g["kind"] == 3)
    free = near & ~ghost
    speed = np.linalg.norm(g["v"], axis=1) / PLAN.speed
    awake = {"c": speed[free], "vmin": 0.0, "vmax": 0.3, "cmap": "viridis"}
    for chosen, shown in ((free, awake), (ghost, {"c": "0.65"})):
        ax.scatter(1e3 * (g["x"][chosen, 0] - x), 1e3 * g["x"][chosen, 2], s=13, lw=0, **shown)
    tip = 1e3 * (PLAN.tip - PLAN.speed * steps[-1].time)
    r, top = 1e3 * RADIUS, 1e3 * (PLAN.height + 0.02)
    slope = r * np.sqrt(3.0)
    outline = ([0, r, r, -r, -r, 0], [tip, tip + slope, top, top, tip + slope, tip])
    ax.fill(*outline, "0.85", ec="k", lw=1.0, zorder=3)
    half = 500.0 * PLAN.copies * EDGE
    ax.set(xlabel="x [mm]", aspect="equal", xlim=(-half, half), ylim=(-2.0, top),
           title=f"{title} ({len(g['id'])})")  # fmt: skip


def draw_elements(ax: Axes, stem: str) -> None:
    """Draw the mesh in the plane through the axis where continuum is: no free grain is there."""
    g, (x, y) = field_steps(Path(f"{stem}.h5"))[-1].grains, PLAN.places[PLACE]
    edges = [np.linspace(0.0, PLAN.copies * EDGE, PLAN.elements[0] + 1) - x,
             np.linspace(0.0, PLAN.height, PLAN.elements[2] + 1)]  # fmt: skip
    inner = (g["kind"] == 0) & (np.abs(g["x"][:, 1] - y) < 0.5 * EDGE)
    count = np.histogram2d(g["x"][inner, 0] - x, g["x"][inner, 2], edges)[0]
    for k, j in zip(*np.nonzero(count < FEW), strict=True):
        corner, size = (1e3 * edges[0][k], 1e3 * edges[1][j]), 1e3 * np.diff(edges[0])[k]
        ax.add_patch(plt.Rectangle(corner, size, 1e3 * np.diff(edges[1])[j], fill=False,
                                   ec="tab:red", lw=0.5))  # fmt: skip


def main() -> None:
    """Write picture and table."""
    with Path("cost.csv").open() as file:
        cost = {row[0]: float(row[2]) for row in csv.reader(file)}
    fig, axes = plt.subplots(ncols=3, figsize=(13.0, 3.9), layout="constrained",
                             width_ratios=(1.35, 1.35, 1.0))  # fmt: skip
    lines, truth = [], None
    for stem, label in RUNS.items():
        way, force = force_curve(stem, PLAN)
        band = (way > BAND[0] * 1e3 * PLAN.stroke) & (way < BAND[1] * 1e3 * PLAN.stroke)
        mean, spent = force[band].mean(), cost[stem.split("/")[0]]
        truth = truth or (mean, spent)
        lines.append(f"{label:32s} {mean:8.3f} N, {mean / truth[0]:5.2f} of all grains; "
                     f"{spent:6.1f} s of processors, {truth[1] / spent:4.1f} times fewer")  # fmt: skip
        axes[2].plot(way, force, label=label)
    draw_slice(axes[0], f"whole_{PLACE}", "all grains")
    draw_slice(axes[1], f"wide_{PLACE}/grains", "grains awake")
    draw_elements(axes[1], f"wide_{PLACE}/grains")
    axes[0].set(ylabel="z [mm]")
    axes[2].set(xlabel="way of the cone [mm]", ylabel="force on the cone [N]", xlim=(0.0, None),
                ylim=(0.0, None))  # fmt: skip
    axes[2].legend(fontsize=8)
    fig.savefig("cone.png", dpi=120)
    Path("cone.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
