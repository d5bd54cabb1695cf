"""Figures of runs whose grains change: sources and sinks, moving windows, opened elements."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fields import FieldFile
from talus.look import COLOURS, new_figure
from talus.plots import rows_of, stem_of

MILLI = 1.0e3
SOURCES, SINKS, WINDOW, CONVERSIONS = "_sources", "_sinks", "_window", "_conversions"


def totals(path: Path) -> dict[str, np.ndarray]:
    """Return time, grains, mass and energy of all sources (or sinks) together, a row a time."""
    history = histories.read(path)
    time, number = np.unique(rows_of(history), return_inverse=True)
    names = [name for name in ("grains", "mass", "energy") if name in history.columns]
    sums = {name: np.bincount(number.ravel(), history[name], len(time)) for name in names}
    return {"time": time} | sums


def counts(run: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times [s] and numbers of grains of the steps of a field file, if it is there."""
    if not run.exists():
        return None
    with FieldFile(run) as fields:
        times = [float(np.ravel(fields.file["steps"][n].attrs["time"])[0]) for n in fields.names]
        return np.array(times), np.array([len(fields.places(k)[0]) for k in range(len(fields))])


def through(path: Path) -> object:
    """Grains through the sources and sinks of a run: number, number in it, mass, energy.

    `path` is `*_sources.csv` or `*_sinks.csv`; the other is read where it is beside it.
    """
    own = next((end for end in (SOURCES, SINKS) if path.stem.endswith(end)), None)
    if own is None:
        hint = "RUN_sources.csv or RUN_sinks.csv is wanted"
        raise FaultError("E603", f"{path.name} counts no grains of sources or sinks", hint)
    run = stem_of(path, own)
    files = {"entered": SOURCES, "left": SINKS}
    found = {name: path.with_name(f"{run}{end}.csv") for name, end in files.items()}
    sums = {n: totals(file) for n, file in found.items() if file == path or file.exists()}
    fig, ((number, held), (mass, energy)) = new_figure(nrows=2, ncols=2, sharex=True,
                                                       figsize=(9.6, 6.2))  # fmt: skip
    for k, (name, rows) in enumerate(sums.items()):
        for ax, what in ((number, "grains"), (mass, "mass"), (energy, "energy")):
            if what in rows:
                ax.plot(rows["time"], rows[what], color=COLOURS[k], label=name)
    inside = counts(path.with_name(f"{run}.h5"))
    if inside:
        held.plot(*inside, "o", color=COLOURS[2], ms=4, label="in the field file")
    if inside and len(sums) == 2:
        time = sums["entered"]["time"]
        change = sums["entered"]["grains"] - np.interp(time, *both(sums["left"]))
        start = inside[1][0] - np.interp(inside[0][0], time, change)
        held.plot(time, start + change, color=COLOURS[3], lw=1.2, label="at first + entered - left")
    number.set(ylabel="grains, sum [-]")
    held.set(ylabel="grains in the run [-]")
    mass.set(xlabel="time [s]", ylabel="mass, sum [kg]")
    energy.set(xlabel="time [s]", ylabel="energy, sum [J]")
    legends(fig)
    fig.suptitle(f"Sources and sinks, {run}")
    return fig


def both(rows: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Times and sums of grains."""
    return rows["time"], rows["grains"]


def window(path: Path) -> object:
    """Travel of a moving window and its grains: entered, left, how far the first copy had moved."""
    history = histories.read(path)
    time = rows_of(history)
    fig, ((place, copies), (grains, moved)) = new_figure(nrows=2, ncols=2, sharex=True,
                                                         figsize=(9.6, 6.2))  # fmt: skip
    place.plot(time, MILLI * history["place"], label="body, from copy 0")
    place.set(ylabel="travel [mm]")
    for name in ("rear", "front"):
        copies.step(time, history[name], where="post", label=f"{name} copy")
    copies.set(ylabel="number of the copy [-]")
    for name in ("entered", "left"):
        grains.step(time, history[name], where="post", label=name)
    grains.step(time, history["entered"] - history["left"], "--", where="post", label="difference")
    grains.set(xlabel="time [s]", ylabel="grains, sum [-]")
    moved.plot(time, MILLI * history["moved"], label="first copy, as the next entered")
    moved.set(xlabel="time [s]", ylabel="moved [mm]")
    legends(fig)
    fig.suptitle(f"Moving window, {stem_of(path, WINDOW)}")
    return fig


def conversions(path: Path) -> object:
    """Conversions of an adaptive run: elements, grains, energy brought, momentum and holds."""
    history = histories.read(path)
    time = rows_of(history)
    fig, ((elements, grains), (energy, holds)) = new_figure(nrows=2, ncols=2, sharex=True,
                                                            figsize=(9.6, 6.2))  # fmt: skip
    panels = (
        (elements, ("opened", "without", "closed"), "elements [-]", "o-"),
        (grains, ("awake", "woken", "freed", "left", "ghosts"), "grains [-]", "o-"),
        (energy, ("kinetic", "elastic"), "energy brought, sum [J]", "o-"),
        (holds, ("largest_hold", "momentum"), "", "o"),
    )
    for ax, names, label, mark in panels:
        for name in names:
            if name not in history.columns:
                continue
            values = np.cumsum(history[name]) if ax is energy else history[name]
            text = f"{name.replace('_', ' ')}{'' if label else f' [{history.units[name]}]'}"
            ax.plot(time, np.abs(values) if ax is holds else values, mark, ms=3, lw=1.0, label=text)
        ax.set(ylabel=label or "size")
    if any(np.any(line.get_ydata() > 0.0) for line in holds.lines):
        holds.set_yscale("log")
    for ax in (energy, holds):
        ax.set(xlabel="time [s]")
    legends(fig)
    fig.suptitle(f"Conversions, {stem_of(path, CONVERSIONS)}")
    return fig


def legends(fig: object) -> None:
    """Give every panel with curves its legend."""
    for ax in fig.axes:
        if ax.lines:
            ax.legend(fontsize=8)
