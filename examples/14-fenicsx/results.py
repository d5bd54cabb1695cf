"""Compare the runs of both solvers and draw force.png, bed.png: results.py FOLDER.

Writes results.csv; exit code 1 where a static force curve differs by more than LIMIT.
"""

import sys
from pathlib import Path

import numpy as np

from talus.look import new_figure, save_figure
from talus.verification import read_history

LIMIT = 1.0e-6  # of the largest force
SOLVERS = ("talus-fem", "fenicsx")


def history(folder: Path, run: str, solver: str, name: str) -> dict[str, np.ndarray]:
    """Read a history of a run."""
    return read_history(folder / run / solver / name)


def off(first: dict[str, np.ndarray], second: dict[str, np.ndarray], column: str) -> float:
    """Return the largest difference of a column over its largest value."""
    return float(np.abs(first[column] - second[column]).max() / np.abs(first[column]).max())


def compare(folder: Path, run: str, stem: str) -> list[str]:
    """Return lines of results.csv for a run."""
    fem, own = (history(folder, run, s, f"{stem}_audit.csv") for s in SOLVERS)
    columns = ("force_on_solid_z", "solid_elastic", "largest_ghost_displacement")
    return [f"{run},{column},{np.abs(fem[column]).max():.6e},{off(fem, own, column):.2e}"
            for column in columns]  # fmt: skip


def draw_force(folder: Path) -> None:
    """Draw the force on the bar over its penetration, with both solvers."""
    fem, own = (history(folder, "penetration", s, "grains_driven.csv")
                for s in SOLVERS)  # fmt: skip
    fig, ax = new_figure()
    depth = [1e3 * (h["z"][0] - h["z"]) for h in (fem, own)]
    ax.plot(depth[0], fem["force_z"], "k-", lw=1.0, label="talus-fem")
    ax.plot(depth[1][::6], own["force_z"][::6], "o", ms=4, mfc="none", label="FEniCSx at the port")
    ax.set(xlabel="penetration [mm]", ylabel="force on the bar [N]")
    ax.legend()
    save_figure(fig, folder / "force.png")


def draw_bed(folder: Path) -> None:
    """Draw energy of the block and momentum of grains of the bed that falls on it."""
    fem, own = (history(folder, "bed", solver, "bed_coupled_audit.csv") for solver in SOLVERS)
    fig, axes = new_figure(nrows=2, sharex=True)
    quantities = {"solid_elastic": "energy of the block [mJ]",
                  "force_on_solid_z": "force on the block [mN]"}  # fmt: skip
    for ax, (column, label) in zip(axes, quantities.items(), strict=True):
        ax.plot(1e3 * fem["time"], 1e3 * fem[column], "k-", lw=1.0, label="talus-fem, Newmark")
        ax.plot(1e3 * own["time"], 1e3 * own[column], "--", lw=1.0, label="FEniCSx, explicit")
        ax.set(ylabel=label)
    axes[0].legend()
    axes[1].set(xlabel="time [ms]")
    save_figure(fig, folder / "bed.png")


def main() -> int:
    """Compare and draw."""
    folder = Path(sys.argv[1])
    rows = ["run,quantity,largest,difference over it"]
    for run, stem in (("penetration", "coupled"), ("hookean", "coupled"), ("bed", "bed_coupled")):
        rows += compare(folder, run, stem)
    (folder / "results.csv").write_text("\n".join(rows) + "\n")
    print("\n".join(rows))
    draw_force(folder)
    draw_bed(folder)
    static = [float(row.rsplit(",", 1)[1]) for row in rows[1:] if not row.startswith("bed")]
    return int(max(static) > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
