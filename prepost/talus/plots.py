"""Plots of runs: energy ledger, force-penetration, ghosts, audit. Each returns a figure."""

from pathlib import Path

import numpy as np

from talus import histories, overlap_plots
from talus.faults import FaultError
from talus.fields import MOVED, FieldFile, displacement, ghost_rows
from talus.files import make_folder, write_text_file
from talus.look import COLOURS, new_figure

SMALL = 2.0e-3  # energies below this share of the largest are left out of a plot
CLOSURES = ("closure_error", "closure")
FORCE_COLUMNS = "depth [mm],force [N],force_mean [N]"
MILLI = 1.0e3
LEAST = 1.0e-18  # relative errors below this are drawn there
MARKS = "os^Dvp*X"


def running_mean(values: np.ndarray, half: int) -> np.ndarray:
    """Mean over 2 half + 1 neighbours; at the ends over as many as are symmetric."""
    n = len(values)
    reach = np.minimum(half, np.minimum(np.arange(n), np.arange(n)[::-1]))
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(n)
    return (total[at + reach + 1] - total[at - reach]) / (2 * reach + 1)


def peak(values: np.ndarray) -> float:
    """Largest size among the finite values (a run that failed may end with NaN)."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def energy(path: Path) -> object:
    """Energy ledger: the terms above, the closure error below on a logarithmic axis."""
    history = histories.read(path)
    time = rows_of(history)
    names = [name for name in history.of_unit("J") if name not in CLOSURES]
    split = {"elastic_normal", "elastic_tangential"} if "elastic" in names else set()
    names = [name for name in names if name not in split]
    peaks = {name: peak(history[name]) for name in names}
    largest = max(peaks.values(), default=0.0)
    shown = [name for name in names if peaks[name] > SMALL * largest]
    fig, (top, low) = new_figure(nrows=2, sharex=True, figsize=(7.6, 5.4), height_ratios=[3, 1])
    for k, name in enumerate(shown):
        style = "-" if k < len(COLOURS) else "--"
        top.plot(
            time,
            history[name],
            style,
            color=COLOURS[k % len(COLOURS)],
            label=name.replace("_", " "),
        )
    top.set(ylabel="energy [J]", title=f"Energy ledger, {stem_of(path, '_energy')}")
    if shown:
        top.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    closure = next((history[name] for name in CLOSURES if name in history.columns), None)
    if closure is not None and largest > 0.0 and np.any(closure):
        low.semilogy(time, np.maximum(np.abs(closure) / largest, LEAST), color=COLOURS[1])
    elif closure is not None:
        low.text(0.5, 0.5, "zero", transform=low.transAxes, ha="center")
    low.set(xlabel="time [s]", ylabel="|closure| /\nlargest term [-]")
    return fig


def audit(path: Path) -> object:
    """Audit of a coupled run: works at the interface, force, ghosts, relative errors."""
    history = histories.read(path)
    time = rows_of(history)
    if "total_energy" in history.columns:
        fig = overlap_plots.audit(history, time)
        fig.suptitle(f"Audit, {stem_of(path, '_audit')}")
        return fig
    fig, axes = new_figure(nrows=2, ncols=2, figsize=(9.6, 6.4), sharex=True)
    work = axes[0, 0]
    both = ("interface_work_on_grains", "interface_work_on_solid", "interface_work_difference")
    for name in both:
        text = name.removeprefix("interface_work_").replace("_", " ")
        work.plot(time, history[name], label=text, lw=1.2)
    work.set(ylabel="work at the interface [J]")
    force = axes[0, 1]
    for axis in "xyz":
        force.plot(time, history[f"force_on_solid_{axis}"], label=axis, lw=1.2)
    force.set(ylabel="force on the solid [N]")
    ghosts = axes[1, 0]
    ghosts.plot(
        time, MILLI * history["largest_ghost_displacement"], label="largest ghost displacement"
    )
    ghosts.plot(time, MILLI * history["constraint_residual"], label="constraint residual")
    ghosts.set(xlabel="time [s]", ylabel="length [mm]")
    share = axes[1, 1]
    size = np.maximum.accumulate(np.abs(history[both[0]]))
    good = size > 0.0
    share.semilogy(
        time[good], np.abs(history[both[2]][good]) / size[good] + LEAST, label="work difference"
    )
    if "force_lag" in history.columns and np.any(history["force_lag"] > 0.0):
        share.semilogy(time, history["force_lag"], label="force lag")
    share.set(xlabel="time [s]", ylabel="relative error [-]")
    for ax in axes.flat:
        ax.legend(fontsize=8)
    fig.suptitle(f"Audit, {stem_of(path, '_audit')}")
    return fig


def force_curve(path: Path, tool: int | None = None) -> dict[str, np.ndarray]:
    """Depth [mm], upward force [N] and its running mean of the tool of a *_driven.csv.

    `tool` is the id of the driven grain; it may be left out when there is one only.
    """
    history = histories.read(path)
    rows_of(history)
    ids = np.unique(history["id"]).astype(int)
    if tool is None and len(ids) > 1:
        text = f"{path} has {len(ids)} driven grains: {', '.join(map(str, ids[:8]))}"
        raise FaultError("E547", text, "choose one with --tool")
    chosen = history["id"].astype(int) == (ids[0] if tool is None else tool)
    if not chosen.any():
        raise FaultError("E547", f"{path} has no driven grain {tool}", f"it has: {ids[:8]}")
    z, force = history["z"][chosen], history["force_z"][chosen]
    depth = MILLI * (z[0] - z)
    half = max(1, round(0.02 * len(depth)))
    return {"depth": depth, "force": force, "mean": running_mean(force, half)}


def force_figure(curves: dict[str, dict[str, np.ndarray]], title: str = "") -> object:
    """Force-penetration of several runs: thin raw line and running mean."""
    fig, ax = new_figure(figsize=(7.0, 4.6))
    for k, (label, curve) in enumerate(curves.items()):
        colour = COLOURS[k % len(COLOURS)]
        ax.plot(curve["depth"], curve["force"], color=colour, lw=0.5, alpha=0.45)
        mark = {"marker": MARKS[k % len(MARKS)], "ms": 5, "markevery": (0.02 * k, 0.1)}
        ax.plot(curve["depth"], curve["mean"], color=colour, lw=1.8, label=label, **mark)
    ax.set(xlabel="penetration depth [mm]", ylabel="force on the penetrator, upwards [N]")
    ax.set_xlim(left=0.0)
    ax.set_title(title, fontsize=10)
    ax.legend(
        title="thin: as written\nthick: mean over 4 % of the stroke",
        title_fontsize=8,
        alignment="left",
    )
    return fig


def write_force_table(path: Path, curves: dict[str, dict[str, np.ndarray]]) -> None:
    """Write the curves as CSV, one row a run and depth."""
    lines = [f"run,{FORCE_COLUMNS}"]
    for label, curve in curves.items():
        rows = zip(curve["depth"], curve["force"], curve["mean"], strict=True)
        text = label.replace('"', "'")
        lines += [f'"{text}",{d:.9g},{f:.9g},{m:.9g}' for d, f, m in rows]
    make_folder(path.parent)
    write_text_file(path, "\n".join(lines) + "\n")


def ghosts(path: Path, step: int = -1) -> object:
    """Ghost displacement since the first step: side view x-z and top view x-y, arrows enlarged."""
    with FieldFile(path) as fields:
        first, now = fields.read(0), fields.read(step)
    if not now.grains:
        raise FaultError(
            "E543", f"{path} holds no grains", "the field file of the grains is wanted"
        )
    rows = ghost_rows(first.grains, now.grains)
    if not rows.size:
        hint = "ghosts are wall grains that a coupled run moves"
        raise FaultError("E548", f"{path} has no ghosts and no moved fixed grains", hint)
    moved = displacement(first.grains, now.grains)[rows]
    rows, moved = rows[np.isfinite(moved).all(axis=1)], moved[np.isfinite(moved).all(axis=1)]
    x = now.grains["x"][rows] - moved
    size = np.linalg.norm(moved, axis=1)
    extent, largest = float(np.ptp(x, axis=0).max()), float(size.max())
    scale = round_scale(0.12 * extent / largest) if extent > 0.0 and largest > MOVED else 1.0
    fig, (side, top) = new_figure(ncols=2, figsize=(10.4, 5.6), width_ratios=[2, 3])
    # the side view keeps the walls seen edge-on, so that arrows do not hide each other
    walls = np.abs(x[:, 1]) < 0.9 * np.abs(x[:, 1]).max() + 1.0e-12
    walls |= not walls.any()
    for ax, (a, b), chosen in ((side, (0, 2), walls), (top, (0, 1), np.ones(len(x), bool))):
        dots = draw_arrows(ax, x[chosen], moved[chosen], size[chosen], size.max(), (a, b), scale)
        ax.set(xlabel="xyz"[a] + " [mm]", ylabel="xyz"[b] + " [mm]", aspect="equal")
    side.set_title("side view (walls x and floor)", fontsize=10)
    top.set_title("top view (all ghosts)", fontsize=10)
    fig.colorbar(dots, ax=[side, top], label="displacement [mm]", shrink=0.8)
    fig.suptitle(
        f"Ghost displacement at t = {now.time:.4g} s, arrows × {scale:g}, "
        f"largest {MILLI * size.max():.3g} mm ({len(rows)} ghosts)", fontsize=11,
    )  # fmt: skip
    return fig


def draw_arrows(
    ax: object, x: np.ndarray, moved: np.ndarray, size: np.ndarray, largest: float,
    plane: tuple[int, int], scale: float,
) -> object:  # fmt: skip
    """Draw dots at the first places and enlarged arrows from them; lengths in mm."""
    a, b = plane
    order = np.argsort(size)
    x, moved, size = MILLI * x[order], MILLI * moved[order], MILLI * size[order]
    limits = {"cmap": "viridis", "clim": (0.0, MILLI * max(largest, 1.0e-300))}
    ax.quiver(
        x[:, a], x[:, b], scale * moved[:, a], scale * moved[:, b], size, angles="xy",
        scale_units="xy", scale=1.0, width=0.004, zorder=3, **limits,
    )  # fmt: skip
    tips = x + scale * moved
    for limit, axis in ((ax.set_xlim, a), (ax.set_ylim, b)):
        both = np.concatenate([x[:, axis], tips[:, axis]])
        limit(both.min() - 4.0, both.max() + 4.0)
    return ax.scatter(
        x[:, a], x[:, b], c=size, s=9, zorder=2, cmap="viridis", vmin=0.0, vmax=limits["clim"][1]
    )


def round_scale(value: float) -> float:
    """Return 1, 2 or 5 times a power of ten, not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(f for f in (1.0, 2.0, 5.0) if f <= value / power * (1.0 + 1.0e-9)) * power)


def rows_of(history: histories.History) -> np.ndarray:
    """Return the times of a history; one without rows is a fault."""
    time = history["time"]
    if not time.size:
        raise FaultError(
            "E545", f"{history.path} has no rows yet", "the run has written no history"
        )
    return time


def stem_of(path: Path, ending: str) -> str:
    """Name of the run that wrote a file: its stem without the ending."""
    return path.stem.removesuffix(ending)
