"""Compare the force against the bar and the cost of the three beds; draw them.

Usage: judge.py WAY, in the folder of the run; result.txt, force.png, bed.png.
"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from talus.verification import field_steps, read_history  # noqa: E402

SPEED, SKIP, BLOCK = 0.4, 0.04, 0.02  # [m/s], before the mean begins [m], for errors [m]
RUNS = {"whole": "whole bed", "opened": "opened before the bar", "closed": "and closed behind it",
        "held": "held ends, 40 to 80 mm"}  # fmt: skip
FILES = {"whole": "whole", "opened": "grains", "closed": "grains_closed", "held": "held"}


def force_of(name: str, way: float) -> dict:
    """Return the force over the way, its mean, standard error and scatter."""
    rows = read_history(Path(f"{FILES[name]}_surfaces.csv"))
    place, force = SPEED * rows["time"], -rows["force_x"]
    edges = np.arange(SKIP, way + 1e-9, BLOCK)
    pairs = zip(edges[:-1], edges[1:], strict=True)
    block = np.array([force[(place > a) & (place <= b)].mean() for a, b in pairs])
    return {"place": place, "force": force, "mean": block.mean(),
            "error": block.std(ddof=1) / np.sqrt(len(block)),
            "scatter": force[place > SKIP].std()}  # fmt: skip


def main(way: float) -> None:
    """Write the table and both pictures."""
    found = {name: force_of(name, way) for name in RUNS}
    with Path("cost.csv").open() as file:
        cost = {row[0]: (float(row[1]), float(row[2])) for row in csv.reader(file)}
    lines = ["bed                      mean [N]         scatter [N]  wall [s]  processors [s]"]
    for name, label in RUNS.items():
        f, (wall, cpu) = found[name], cost[name]
        lines.append(f"{label:24s} {f['mean']:.4f} ± {f['error']:.4f}  {f['scatter']:.4f}       "
                     f"{wall:8.1f} {cpu:8.1f}")  # fmt: skip
    whole, opened = found["whole"], found["opened"]
    lines.append(f"force of the opened bed over the whole one {opened['mean'] / whole['mean']:.3f}, "
                 f"scatter {opened['scatter'] / whole['scatter']:.3f}, wall time 1/"
                 f"{cost['whole'][0] / cost['opened'][0]:.1f}, seconds of processors 1/"
                 f"{cost['whole'][1] / cost['opened'][1]:.1f}")  # fmt: skip
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    fig, ax = plt.subplots(figsize=(9, 3.6), layout="constrained")
    for name, label in RUNS.items():
        smooth = np.convolve(found[name]["force"], np.ones(60) / 60, "same")
        ax.plot(1e3 * found[name]["place"], smooth, lw=0.8, label=label)
    ax.set(xlabel="way of the bar [mm]", ylabel="force against it [N]", ylim=(0.0, None))
    ax.legend(fontsize=8, ncols=4)
    fig.savefig("force.png", dpi=120)
    draw_beds()


def draw_beds() -> None:
    """Draw the grains of the whole bed and those awake, at the last time that all beds have."""
    names = ("whole", "opened", "closed")
    steps = [field_steps(Path(f"{FILES[name]}.h5")) for name in names]
    last = min(of_one[-1].time for of_one in steps)
    fig, axes = plt.subplots(nrows=3, figsize=(10, 5.0), sharex=True, layout="constrained")
    for ax, name, of_one in zip(axes, names, steps, strict=True):
        g = min(of_one, key=lambda step: abs(step.time - last)).grains
        speed = np.where(g["kind"] != 0, -0.05, np.linalg.norm(g["v"], axis=1))
        ax.scatter(1e3 * g["x"][:, 0], 1e3 * g["x"][:, 2], s=5.0, c=speed, vmin=-0.05, vmax=0.4)
        if name == "opened":
            ax.set_xlim(1e3 * g["x"][:, 0].mean() + np.array([-250.0, 250.0]))
        ax.set(ylabel="z [mm]", aspect="equal", title=f"{RUNS[name]}: {len(g['id'])} grains")
    axes[-1].set(xlabel="x [mm]")
    fig.savefig("bed.png", dpi=120)


if __name__ == "__main__":
    main(float(sys.argv[1]))
