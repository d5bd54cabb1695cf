"""Figures of runs with overlap: profiles of velocity through grains and solid, the audit."""

from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fields import GHOST, FieldFile
from talus.look import COLOURS, new_figure

MOST = 6  # times that one figure shows
LEAST = 1.0e-18


def layers(place: np.ndarray, value: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return means of places and values in slices of a width, sorted by place."""
    number = np.floor((place - place.min()) / width + 1.0e-6).astype(int)
    count = np.bincount(number)
    good = count > 0
    means = [np.bincount(number, weights=w)[good] / count[good] for w in (place, value)]
    return means[0], means[1]


def chosen_steps(count: int) -> list[int]:
    """Numbers of up to MOST steps, from the first to the last."""
    return sorted({round(k) for k in np.linspace(0, count - 1, MOST)})


def profile(grains: Path, solid: Path | None, axis: str) -> object:
    """Mean velocity along an axis of the grains that are no ghosts, and of the nodes, by time."""
    c = "xyz".index(axis)
    fig, ax = new_figure(figsize=(7.2, 4.6))
    with FieldFile(grains) as fields:
        steps = [fields.read(k) for k in chosen_steps(len(fields))]
    if not steps[0].grains:
        raise FaultError("E543", f"{grains} holds no grains", "give grains.h5 first, then solid.h5")
    for colour, step in zip(COLOURS, steps, strict=False):
        g = step.grains
        own = g["kind"] != GHOST
        place, v = layers(g["x"][own, c], g["v"][own, c], 2.0 * g["axes"].max())
        ax.plot(place, v, ".", ms=4, color=colour, label=f"{1e3 * step.time:.3g} ms")
        if solid is not None:
            ax.plot(*nodes_at(solid, step.time, c), color=colour, lw=1.2)
    ax.set(xlabel=f"{axis} [m]", ylabel=f"velocity along {axis} [m/s]")
    ax.legend(
        title="grains: dots\nnodes: lines", fontsize=8, title_fontsize=8, loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
    )  # fmt: skip
    return fig


def nodes_at(solid: Path, time: float, c: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and mean velocities of layers of nodes at the step nearest in time."""
    with FieldFile(solid) as fields:
        if fields.mesh is None:
            raise FaultError("E543", f"{solid} holds no mesh", "the solid's field file is wanted")
        steps = [fields.read(k) for k in range(len(fields))]
        x = fields.mesh[0]
    near = min(steps, key=lambda s: abs(s.time - time))
    places = np.unique(np.round(x[:, c], 9))
    width = np.diff(places).min() if len(places) > 1 else 1.0
    return layers(x[:, c], near.solid["v"][:, c], 0.5 * width)


def audit(history: histories.History, time: np.ndarray) -> object:
    """Energies, change of the whole, works of both sides, fine scale of a run with overlap."""
    fig, axes = new_figure(nrows=2, ncols=2, figsize=(9.6, 6.4), sharex=True)
    parts = axes[0, 0]
    for name in ("grains_kinetic", "solid_kinetic", "solid_elastic", "edge_kinetic"):
        parts.plot(time, history[name], label=name.replace("_", " "), lw=1.2)
    if "fine_scale_damping" in history.columns:
        parts.plot(time, history["fine_scale_damping"], label="fine scale damping", lw=1.2)
    parts.set(ylabel="energy [J]")
    whole = axes[0, 1]
    total = history["total_energy"]
    whole.plot(time, total - total[0], label="whole energy, change", lw=1.2)
    whole.set(ylabel="energy [J]")
    works = axes[1, 0]
    for name in ("given", "taken"):
        works.plot(time, history[f"interface_work_{name}"], label=f"work {name}", lw=1.2)
    works.set(xlabel="time [s]", ylabel="work at the interface [J]")
    fine = axes[1, 1]
    fine.semilogy(time, history["fine_scale"] + LEAST, label="fine scale of the grains")
    fine.semilogy(
        time, history["largest_ghost_displacement"] + LEAST, label="largest ghost displacement"
    )
    fine.set(xlabel="time [s]", ylabel="length [m]")
    for ax in axes.flat:
        ax.legend(fontsize=8)
    return fig
