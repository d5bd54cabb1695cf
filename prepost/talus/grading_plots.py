"""Figure of gradings over time: what passes sieves, measures of breakage, slope of the number."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.look import new_figure

MILLI = 1.0e3
ENDING = "_grading"
CURVES = 5  # times that are drawn


def sieves_of(rows: histories.History) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return openings (n) [m] and what passes them, with fines and without (times, n) [-]."""
    names = [name for name in rows.columns if name.startswith("passing_")]
    if not names:
        raise FaultError("E620", "these are no gradings: there are no columns 'passing_...'",
                         "take <deck>_grading.csv of a run with &grading")  # fmt: skip
    sizes = np.array([float(name.removeprefix("passing_")) for name in names])
    whole = np.stack([rows[name] for name in names], axis=1)
    alone = np.stack([rows[name.replace("passing_", "resolved_")] for name in names], axis=1)
    return sizes, whole, alone


def figure(path: Path) -> object:
    """Gradings at some times, with and without fines; breakage and slope over time."""
    rows = histories.read(path)
    if not rows["time"].size:
        raise FaultError("E545", f"{path} has no rows yet", "the run has written nothing")
    sizes, whole, alone = sieves_of(rows)
    fig, axes = new_figure(ncols=2, figsize=(10.0, 4.2))
    picked = np.unique(np.linspace(0, len(rows["time"]) - 1, CURVES).astype(int))
    for place, k in enumerate(picked):
        shade = str(0.75 - 0.75 * place / max(len(picked) - 1, 1))
        label = f"{rows['time'][k]:.3g} s"
        axes[0].semilogx(MILLI * sizes, 100.0 * whole[k], "o-", ms=3, color=shade, label=label)
    axes[0].semilogx(MILLI * sizes, 100.0 * alone[-1], "C1--", label="last, grains alone")
    axes[0].set(xlabel="size [mm]", ylabel="passing by mass [%]", ylim=(0.0, 102.0))
    axes[0].legend(fontsize=8)
    axes[1].plot(rows["time"], rows["hardin"], label="Hardin $B_r$")
    axes[1].plot(rows["time"], rows["einav"], label="Einav $B$")
    axes[1].set(xlabel="time [s]", ylabel="breakage [-]")
    axes[1].locator_params(axis="x", nbins=5)
    axes[1].set_ylim(bottom=0.0)
    other = axes[1].twinx()
    other.plot(rows["time"], rows["slope"], "C2:", label="slope of log N(> d)")
    other.set_ylabel("slope of log N(> d) [-]")
    other.set_ylim(bottom=0.0)
    lines = [*axes[1].get_lines(), *other.get_lines()]
    axes[1].legend(lines, [line.get_label() for line in lines], fontsize=8)
    fig.suptitle(f"Grading, {path.stem.removesuffix(ENDING)}")
    return fig
