"""Compare the runs of both solvers and draw force.png: results.py FOLDER.

Writes results.csv; exit code 1 where forces or displacements of a run without friction differ by
more than LIMIT. With friction the laws differ: there nothing is judged.
"""

import sys
from pathlib import Path

import numpy as np

from talus.look import new_figure, save_figure
from talus.verification import read_history

LIMIT = 1.0e-6  # of the largest value
RUNS = {"ball": "ball", "bed": "bed", "friction": "bed, friction 0.5"}
SOLVERS = ("talus-dem", "lammps")
COLUMNS = ("force_on_solid_z", "largest_ghost_displacement", "solid_elastic", "grains_elastic",
           "interface_work_on_grains")  # fmt: skip


def audits(folder: Path, run: str) -> list[dict[str, np.ndarray]]:
    """Return the audits of both solvers."""
    return [read_history(folder / run / solver / "coupled_audit.csv") for solver in SOLVERS]


def main() -> int:
    """Compare and draw."""
    folder, worst = Path(sys.argv[1]), 0.0
    rows = ["run,quantity,largest,difference over it"]
    fig, axes = new_figure(nrows=len(RUNS), sharex=True, figsize=(6.4, 6.4))
    for ax, (run, label) in zip(axes, RUNS.items(), strict=True):
        dem, own = audits(folder, run)
        for column in COLUMNS:
            largest = np.abs(dem[column]).max()
            off = np.abs(dem[column] - own[column]).max() / largest
            rows.append(f"{run},{column},{largest:.6e},{off:.2e}")
            if run != "friction":
                worst = max(worst, off)
        ax.plot(1e3 * dem["time"], -dem["force_on_solid_z"], "k-", lw=1.0, label="talus-dem")
        ax.plot(1e3 * own["time"][::15], -own["force_on_solid_z"][::15], "o", ms=4, mfc="none",
                label="LAMMPS at the port")  # fmt: skip
        ax.set(ylabel="force [N]", title=label)
    axes[0].legend()
    axes[-1].set(xlabel="time [ms]")
    save_figure(fig, folder / "force.png")
    (folder / "results.csv").write_text("\n".join(rows) + "\n")
    print("\n".join(rows))
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
