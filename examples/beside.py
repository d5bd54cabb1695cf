"""Compare the force curves of talus-fem and SOLVER and draw force.png: beside.py FOLDER SOLVER.

Exit code 1 where they differ by more than LIMIT.
"""

import sys
from pathlib import Path

import numpy as np

from talus.look import new_figure, save_figure
from talus.verification import read_history

LIMIT = 1.0e-6  # of the largest force


def main() -> int:
    """Compare and draw."""
    folder, name = Path(sys.argv[1]), sys.argv[2]
    fem, own = (read_history(folder / solver / "grains_driven.csv")
                for solver in ("talus-fem", name))  # fmt: skip
    fig, ax = new_figure()
    depth = [1e3 * (h["z"][0] - h["z"]) for h in (fem, own)]
    ax.plot(depth[0], fem["force_z"], "k-", lw=1.0, label="talus-fem")
    ax.plot(depth[1][::6], own["force_z"][::6], "o", ms=4, mfc="none", label=f"{name} at the port")
    ax.set(xlabel="penetration [mm]", ylabel="force on the bar [N]")
    ax.legend()
    save_figure(fig, folder / "force.png")
    largest = np.abs(fem["force_z"]).max()
    off = float(np.abs(fem["force_z"] - own["force_z"]).max() / largest)
    print(f"force on the bar: largest {largest:.6e} N, difference over it {off:.2e}")
    return int(off > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
