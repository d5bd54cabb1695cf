"""Draw what a slow plate meets, and what growing fragments change.

Usage: slow.py, in the folder of the runs; slow.txt and slow.png.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from bed_rows import compression, table  # noqa: E402

AREA, COUNT = 22.36e-3**2, 1000  # [m2], grains
NAMES = ("seed-1", "seed-2", "slower", "grow-0.1ms", "grow-1ms")
LOOKS = {"seed-1": ("k", "0.5 m/s, seed 1"), "seed-2": ("C0", "0.5 m/s, seed 2"),
         "slower": ("C2", "0.1 m/s, seed 1"), "grow-0.1ms": ("C3", "growth in 0.1 ms"),
         "grow-1ms": ("C1", "growth in 1 ms")}  # fmt: skip
CLOSED = 0.04  # closure at which growth is judged


def draw(runs: dict[str, dict]) -> None:
    """Draw stress over closure, void ratio over stress, and what has broken over closure."""
    fig, axes = plt.subplots(ncols=3, figsize=(13.0, 4.0), layout="constrained")
    for name, rows in runs.items():
        colour, label = LOOKS[name]
        axes[0].plot(100.0 * rows["closure"], rows["most"], color=colour, label=label)
        axes[2].plot(100.0 * rows["closure"], rows["broken"], color=colour, label=label)
        if "grow" in name or name == "slower":
            continue
        axes[1].loglog(rows["most"], rows["void_ratio"], color=colour, label=label)
    most = runs["seed-1"]["most"]
    start = 1.05 * most[np.argmax(runs["seed-1"]["events"] >= 0.05)]
    at = runs["seed-1"]["void_ratio"][np.argmax(most >= start)]
    line = np.array([start, most[-1]])
    axes[1].loglog(line, at * (line / start) ** -0.5, "--", color="0.5", label="slope -1/(2s)")
    axes[0].axhspan(0.12, 0.30, color="0.93", zorder=0)
    axes[0].set(xlabel="closure of the plate [%]", ylabel="largest stress so far / strength [-]",
                xlim=(0.0, 10.0), ylim=(0.0, 0.3))  # fmt: skip
    axes[0].legend(fontsize=8)
    axes[1].set(xlabel="largest stress so far / strength [-]", ylabel="void ratio of grains [-]",
                xlim=(0.02, 0.5), xticks=(0.02, 0.05, 0.1, 0.2, 0.5), yticks=(0.5, 0.6, 0.7, 0.8),
                xticklabels=("0.02", "0.05", "0.1", "0.2", "0.5"),
                yticklabels=("0.5", "0.6", "0.7", "0.8"))  # fmt: skip
    axes[1].minorticks_off()
    axes[1].legend(fontsize=8)
    axes[2].set(xlabel="closure of the plate [%]", ylabel="grains broken of 1000 [-]",
                xlim=(0.0, 5.0), ylim=(0.0, 400.0))  # fmt: skip
    axes[2].legend(fontsize=8)
    fig.savefig("slow.png", dpi=110)


def main() -> None:
    """Write the table and the figure."""
    runs = {name: compression(Path(name), AREA, COUNT) for name in NAMES}
    lines = table(runs, 12)
    lines.append(f"when the plate has closed {100 * CLOSED:.0f} %:")
    for name, rows in runs.items():
        k = int(np.argmax(rows["closure"] >= CLOSED))
        lines.append(f"{name:12s} largest stress {rows['most'][k]:.3f}, broken "
                     f"{rows['broken'][k]:.0f}, work of growth / of the plate "
                     f"{rows['growth'][k] / rows['boundary'][k]:.2f}")  # fmt: skip
    draw(runs)
    Path("slow.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


main()
