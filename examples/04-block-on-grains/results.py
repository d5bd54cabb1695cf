"""Draw force and sagging of the block over the depth of its head.

Usage: results.py FOLDER, that of run.sh. Prints the last values.
"""

import sys
from pathlib import Path

import numpy as np

from talus.fields import FieldFile
from talus.histories import read
from talus.look import new_figure, save_figure


def main() -> int:
    """Write force.png."""
    folder = Path(sys.argv[1])
    reactions = read(folder / "solid_reactions.csv")
    with FieldFile(folder / "solid.h5") as fields:
        x = fields.mesh[0]
        head = np.isclose(x[:, 2], x[:, 2].max())
        foot = np.isclose(x[:, 2], x[:, 2].min())
        steps = [fields.read(k) for k in range(len(fields))]
    time = np.array([s.time for s in steps])
    depth = -1e3 * np.array([s.solid["u"][head, 2].mean() for s in steps])
    thinner = depth + 1e3 * np.array([s.solid["u"][foot, 2].mean() for s in steps])
    at = np.interp(reactions["time"], time, depth)
    fig, (force, sag) = new_figure(nrows=2, sharex=True, figsize=(6.4, 5.6))
    force.plot(at, -reactions["z1 z"], "-")
    force.set(ylabel="force on the head [N]")
    sag.plot(depth, thinner, "o-", mfc="none")
    sag.set(xlabel="depth of the head [mm]", ylabel="block thinner by [mm]")
    save_figure(fig, folder / "force.png")
    print(f"{depth[-1]:.1f} mm: {-reactions['z1 z'][-1]:.1f} N, thinner by {thinner[-1]:.2f} mm")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
