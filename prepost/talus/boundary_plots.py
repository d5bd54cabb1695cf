"""Figures of boundaries over time: loads and work of walls or surfaces, reactions of a solid."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.look import COLOURS, new_figure
from talus.motions import motions

KINDS = {"_walls": "wall", "_surfaces": "surface"}  # ending of the file: column of the number
REACTIONS = "_reactions"
STYLES = {"x": ":", "y": "--", "z": "-"}  # of the components
MOST = 8  # boundaries with a line of their own in the legend


def bodies(rows: histories.History, column: str) -> dict[str, np.ndarray]:
    """Return the rows (mask) of each wall, or of each part of each surface, by name."""
    numbers = rows[column].astype(int)
    if "part" not in rows.columns:
        return {f"{column} {n}": numbers == n for n in np.unique(numbers)}
    parts = rows["part"].astype(int)
    found = {}
    for number in np.unique(numbers):
        own = numbers == number
        several = len(np.unique(parts[own])) > 1
        for part in np.unique(parts[own]):
            name = f"{column} {number}, part {part}" if several else f"{column} {number}"
            found[name] = own & (parts == part)
    return found


def figure(path: Path) -> object:
    """Draw the lengths of force and moment, and the work, of each boundary over time."""
    rows = histories.read(path)
    ending = next((e for e in KINDS if path.stem.endswith(e)), None)
    if ending is None or not rows["time"].size:
        hint = "a file *_walls.csv or *_surfaces.csv of a run"
        raise FaultError("E545", f"{path} has no rows of boundaries", hint)
    fig, axes = new_figure(ncols=3, figsize=(12.0, 3.8))
    for k, (name, own) in enumerate(bodies(rows, KINDS[ending]).items()):
        look = {"color": COLOURS[k % len(COLOURS)], "lw": 1.1}
        look["label"] = name if k < MOST else None
        force, moment = (
            np.linalg.norm([rows[f"{what}_{c}"][own] for c in "xyz"], axis=0)
            for what in ("force", "moment")
        )
        for ax, values in zip(axes, (force, moment, rows["work"][own]), strict=True):
            ax.plot(rows["time"][own], values, **look)
    labels = ("force [N]", "moment [N m]", "work on the grains [J]")
    for ax, label in zip(axes, labels, strict=True):
        ax.set(xlabel="time [s]", ylabel=label)
    axes[0].legend(fontsize=7)
    fig.suptitle(f"Boundaries, {path.stem.removesuffix(ending)}")
    return fig


def reactions(path: Path) -> object:
    """Draw the forces [N] on the supported and moved groups of a solid over time.

    Beside it, where the deck of that name moves groups: force on the group against its way.
    """
    rows = histories.read(path)
    names = [name for name in rows.of_unit("N") if np.any(rows[name])]
    if not path.stem.endswith(REACTIONS) or not rows["time"].size or not names:
        hint = "a file *_reactions.csv of a run of talus-fem, with supports or motions that bear"
        raise FaultError("E545", f"{path} has no reactions", hint)
    stem = path.stem.removesuffix(REACTIONS)
    ways = motions(path.with_name(f"{stem}.nml"))
    moved = {name: ways[name] for name in names if name in ways}
    width = 10.4 if moved else 6.4
    fig, axes = new_figure(ncols=2 if moved else 1, squeeze=False, figsize=(width, 4.2))
    groups = list(dict.fromkeys(name.rpartition(" ")[0] for name in names))
    for name in names:
        group, _, axis = name.rpartition(" ")
        colour = COLOURS[groups.index(group) % len(COLOURS)]
        look = {"color": colour, "ls": STYLES[axis], "lw": 1.1}
        axes[0, 0].plot(rows["time"], rows[name], label=name, **look)
        if name in moved:
            way = np.interp(rows["time"], *moved[name])
            axes[0, 1].plot(1e3 * way, rows[name], label=name, **look)
    axes[0, 0].set(xlabel="time [s]")
    if moved:
        axes[0, 1].set(xlabel="displacement of the group [mm]")
    for ax in axes[0]:
        ax.set(ylabel="force on the group [N]")
        ax.legend(fontsize=7)
    fig.suptitle(f"Reactions, {stem}", fontsize=10)
    return fig
