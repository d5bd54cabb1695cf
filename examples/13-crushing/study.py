"""Draw compression, gradings and yield of the beds of 5000 grains, and what a cone meets.

Usage: study.py, in the folder of the runs; study.txt, study.png and cone.png.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from bed_rows import compression, table  # noqa: E402

from talus.grading_plots import sieves_of  # noqa: E402
from talus.histories import read  # noqa: E402
from talus.verification import read_history  # noqa: E402

AREA, COUNT = 2.5e-3, 5000  # [m2], grains
COLOURS = {"1.5": "C3", "3.0": "k", "6.0": "C0"}
DIAMETER, SPEED = 10.0e-3, 5.0  # of the cone [m], [m/s]


def draw_beds(runs: dict[str, dict]) -> None:
    """Draw compression, stress over events, and gradings at the end."""
    fig, axes = plt.subplots(ncols=3, figsize=(13.0, 4.0), layout="constrained")
    for name, rows in runs.items():
        shape, case = name.split("/")
        colour = COLOURS[case.split("-m")[1]] if shape == "spheres" else "C1"
        label = f"{shape}, m = {case.split('-m')[1]}" if case.startswith("s1-") else None
        axes[0].semilogx(rows["most"], rows["void_ratio"], color=colour, label=label)
        axes[1].plot(rows["events"], rows["stress"], color=colour, lw=0.5)
        axes[1].plot(rows["events"], rows["most"], color=colour, label=label)
        sizes, whole, _ = sieves_of(read(Path(name) / "compress_grading.csv"))
        axes[2].semilogx(1e3 * sizes, 100.0 * whole[-1], color=colour,
                         label=label and f"{label}: {rows['events'][-1]:.2f}")  # fmt: skip
    axes[0].set(xlabel="largest stress so far / strength [-]", ylabel="void ratio of grains [-]",
                xlim=(0.02, 0.5), xticks=(0.02, 0.05, 0.1, 0.2, 0.5),
                xticklabels=("0.02", "0.05", "0.1", "0.2", "0.5"))  # fmt: skip
    axes[0].minorticks_off()
    axes[0].legend(fontsize=8)
    axes[1].axhspan(0.12, 0.30, color="0.9", zorder=0)
    axes[1].axvline(0.05, color="0.6", lw=0.8, ls=":")
    axes[1].set(xlabel="events a grain [-]", ylabel="stress on the floor / strength [-]")
    axes[2].set(xlabel="size [mm]", ylabel="passing by mass, with fines [%]",
                title="at the end; events a grain")  # fmt: skip
    axes[2].legend(fontsize=8)
    fig.savefig("study.png", dpi=110)


def draw_cone() -> str:
    """Draw the force on tip and cone over depth, and where grains have broken."""
    fig, axes = plt.subplots(ncols=2, figsize=(9.5, 4.0), layout="constrained")
    last = {}
    for kind, colour in (("whole", "0.4"), ("breaking", "C3")):
        rows = read_history(Path(f"cone-{kind}") / "penetrate_surfaces.csv")
        parts = [rows["part"] == k for k in (1, 2)]
        force = sum(rows["force_z"][part] for part in parts)
        depth = SPEED * rows["time"][parts[0]]
        label = {"whole": "grains cannot break", "breaking": "grains break"}[kind]
        axes[0].plot(1e3 * depth, 1e-3 * force, color=colour, label=label)
        last[kind] = (depth, force)
    broken = read_history(Path("cone-breaking") / "penetrate_broken.csv")
    r = np.hypot(broken["x"] - 25.0e-3, broken["y"] - 25.0e-3)
    dots = axes[1].scatter(1e3 * r, 1e3 * broken["z"], c=1e3 * SPEED * broken["time"], s=6,
                           cmap="viridis")  # fmt: skip
    fig.colorbar(dots, ax=axes[1], label="depth of the tip at the break [mm]")
    axes[0].set(xlabel="depth of the tip [mm]", ylabel="force on the cone [kN]")
    axes[0].legend()
    axes[1].set(xlabel="distance from the axis [mm]", ylabel="height [mm]",
                title="where grains have broken", aspect="equal")  # fmt: skip
    fig.savefig("cone.png", dpi=110)
    end = min(depth[-1] for depth, _ in last.values())
    half = np.linspace(0.5 * end, end, 200)
    means = [np.interp(half, *last[kind]).mean() for kind in ("whole", "breaking")]
    reach = np.quantile(r, 0.9) / DIAMETER
    return (f"cone, mean from {1e3 * half[0]:.1f} to {1e3 * half[-1]:.1f} mm: {means[0]:.0f} N "
            f"where grains cannot break, {means[1]:.0f} N where they do; {len(r)} broken, nine "
            f"tenths of them within {reach:.2f} diameters of the axis")  # fmt: skip


def main() -> None:
    """Write the table and the figures."""
    names = [f"{shape}/s{seed}-m3.0" for shape in ("spheres", "ellipsoids") for seed in (1, 2, 3)]
    names += ["spheres/s1-m1.5", "spheres/s1-m6.0"]
    runs = {name: compression(Path(name), AREA, COUNT) for name in names}
    lines = table(runs, 20)
    draw_beds(runs)
    lines.append(draw_cone())
    Path("study.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


main()
