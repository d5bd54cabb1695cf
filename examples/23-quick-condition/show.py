"""Draw what the floor bears and the block's way, and join frames of the film: quick.png.

Usage: show.py, in the folder of the run, after `talus render` has written film_*.png.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
from prepare import BLOCK, BOX, GRAVITY, LIQUID, buoyant_weight  # noqa: E402

from talus.verification import read_history  # noqa: E402

FRAMES = 4
BLOCK_DENSITY = 7800.0  # as in quick.nml [kg/m3]


def main() -> None:
    """Write the figure."""
    walls, body = read_history(Path("quick_walls.csv")), read_history(Path("quick_bodies.csv"))
    pore = read_history(Path("quick_pore.csv"))
    critical = buoyant_weight()
    floor = walls["wall"] == 1
    fig = plt.figure(figsize=(13.0, 4.0), layout="constrained")
    axes = fig.subplots(ncols=2 + FRAMES, width_ratios=[1.4, 1.4, *[1.0] * FRAMES])
    time = 1e3 * walls["time"][floor]
    axes[0].plot(time, -walls["force_z"][floor] / BOX[:2].prod() / critical, label="floor / weight")
    flow = pore["pressure_z0"] / critical
    block = BLOCK.prod() * (BLOCK_DENSITY - LIQUID) * GRAVITY / BOX[:2].prod() / critical
    axes[0].plot(1e3 * pore["time"], 1.0 + block - flow, "k:", label="1 - i / i_c, and the block")
    axes[0].plot(1e3 * pore["time"], flow, label="i / i_c")
    late = walls["time"][floor] > 0.16
    stress = -walls["force_z"][floor] / BOX[:2].prod() / critical
    print(f"floor / weight from 160 ms on: {stress[late].mean():.2f}, "
          f"by the pressures {1.0 + block - flow[-1]:.2f}")  # fmt: skip
    axes[0].set(xlabel="time [ms]")
    axes[0].legend(fontsize=8)
    axes[1].plot(1e3 * body["time"], 1e3 * (body["z"] - body["z"][0]))
    axes[1].set(xlabel="time [ms]", ylabel="block [mm]")
    frames = sorted(Path().glob("film_*.png"))
    for ax, k in zip(axes[2:], np.linspace(0, len(frames) - 1, FRAMES).astype(int), strict=True):
        ax.imshow(plt.imread(frames[k]))
        ax.axis("off")
    fig.savefig("quick.png", dpi=100)


if __name__ == "__main__":
    main()
