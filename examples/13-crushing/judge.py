"""Draw the compression of the bed, its gradings and what broke.

Usage: judge.py, in the folder of the run; result.txt and crushing.png.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from talus.grading_plots import sieves_of  # noqa: E402
from talus.histories import read  # noqa: E402
from talus.verification import read_history  # noqa: E402

STRENGTH, AREA, COUNT, DENSITY = 30.0e6, 1.96e-4, 400, 2650.0
PARTS = (0.01, 0.05, 0.2, 0.5)  # of the grains, broken


def compression() -> dict[str, np.ndarray]:
    """Return stress on the floor over the strength, void ratio of grains and events a grain."""
    walls, grading = read_history(Path("crush_walls.csv")), read_history(Path("crush_grading.csv"))
    broken = read_history(Path("crush_breakage.csv"))
    floor, top = walls["wall"] == 1, walls["wall"] == 2
    solid = grading["mass"] / DENSITY
    return {"time": grading["time"], "stress": -walls["force_z"][floor] / AREA / STRENGTH,
            "void_ratio": walls["z"][top] * AREA / solid - 1.0,
            "events": broken["broken"] / COUNT, "released": broken["released"],
            "surface": broken["surface"]}  # fmt: skip


def main() -> None:
    """Write the table and the figure."""
    rows = compression()
    most = np.maximum.accumulate(rows["stress"])
    lines = ["broken a grain   stress/strength so far   void ratio"]
    for part in PARTS:
        k = int(np.argmax(rows["events"] >= part))
        if rows["events"][-1] >= part:
            lines.append(f"{part:14.2f}   {most[k]:22.3f}   {rows['void_ratio'][k]:10.3f}")
    grading = read(Path("crush_grading.csv"))
    sizes, whole, alone = sieves_of(grading)
    lines.append(f"at the end: {rows['events'][-1]:.2f} events a grain, slope of log N(> d) "
                 f"{grading['slope'][-1]:.2f}, Hardin {grading['hardin'][-1]:.3f}, Einav "
                 f"{grading['einav'][-1]:.3f}, released "
                 f"{rows['released'][-1] / rows['surface'][-1]:.0f} J/m2")  # fmt: skip
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    fig, axes = plt.subplots(ncols=3, figsize=(13.0, 4.0), layout="constrained")
    axes[0].semilogx(np.maximum(rows["stress"], 1e-3), rows["void_ratio"], lw=0.6, label="stress")
    axes[0].semilogx(most, rows["void_ratio"], "k-", label="largest so far")
    axes[0].set(xlabel="stress on the floor / strength [-]", ylabel="void ratio [-]",
                xlim=(0.01, 1.0))  # fmt: skip
    axes[0].legend(fontsize=8)
    for k in np.linspace(0, len(grading["time"]) - 1, 5).astype(int):
        shade = str(0.75 - 0.75 * k / len(grading["time"]))
        label = f"{rows['events'][k]:.2f} events a grain"
        axes[1].semilogx(1e3 * sizes, 100.0 * whole[k], "o-", ms=3, color=shade, label=label)
    axes[1].semilogx(1e3 * sizes, 100.0 * alone[-1], "C1--", label="last, grains alone")
    axes[1].set(xlabel="size [mm]", ylabel="passing by mass [%]")
    axes[1].legend(fontsize=8)
    axes[2].plot(rows["events"], grading["slope"], label="slope of log N(> d)")
    axes[2].plot(rows["events"], grading["hardin"], label="Hardin $B_r$")
    axes[2].plot(rows["events"], grading["einav"], label="Einav $B$")
    axes[2].axhline(2.359, color="0.6", ls=":", label="2.359: every grain for ever")
    axes[2].set(xlabel="events a grain [-]", ylabel="[-]")
    axes[2].legend(fontsize=8)
    fig.savefig("crushing.png", dpi=110)


main()
