"""Figures of a study: scatter, bars of sensitivities, tornado, curves with bands."""

import numpy as np

from talus.faults import FaultError
from talus.look import COLOURS, new_figure
from talus.study.definition import Study
from talus.study.folders import Store
from talus.study.results import Curve, column_of, read_history
from talus.study.statistics import numbers_of, repeated
from talus.study.table import Table

BAND = (0.05, 0.95)
SAMPLES = 200  # of a curve
WIDE = 3  # columns of small pictures


def short(text: str) -> str:
    """Return a label in two lines where it has a unit."""
    return text.replace(" [", "\n[")


def scatter(study: Study, table: Table, result: int) -> object:
    """Draw a result against every parameter, with means over those that repeat points."""
    one = study.results[result]
    repeats = [p.name for p in study.parameters if p.repeat]
    shown = [p for p in study.parameters if not p.repeat] or study.parameters
    count = len(shown)
    columns = min(count, WIDE)
    rows = -(-count // columns)
    fig, axes = new_figure(nrows=rows, ncols=columns, squeeze=False, sharey=True,
                           figsize=(max(2.6 * columns, 4.2), 2.9 * rows))  # fmt: skip
    y = table.results[one.name]
    for ax in axes.ravel()[count:]:
        ax.set_visible(False)
    for k, (ax, p) in enumerate(zip(axes.ravel(), shown, strict=False)):
        column = table.values[p.name]
        ax.plot(numbers_of(column), y, "o", ms=4, alpha=0.7, mec="none", color=COLOURS[0])
        if repeats and not p.repeat:
            means(ax, p.name, table, one.name, repeats)
        ax.set_xlabel(p.label)
        if all(isinstance(value, int) for value in column):
            ax.xaxis.get_major_locator().set_params(integer=True)
        if any(isinstance(value, str) for value in column):
            known = list(dict.fromkeys(column))
            ax.set_xticks(range(len(known)), known)
        elif p.distribution == "log_uniform" and not p.is_list:
            ax.set_xscale("log")
        if k % columns == 0:
            ax.set_ylabel(one.label)
    return fig


def means(ax: object, name: str, table: Table, result: str, repeats: list[str]) -> None:
    """Add mean and deviation over repeated points to the picture of a parameter."""
    rows = repeated(table.values, {result: table.results[result]}, repeats)
    known = dict(zip(map(repr, table.values[name]), numbers_of(table.values[name]), strict=True))
    ax.errorbar([known[repr(row[name])] for row in rows], [row[result] for row in rows],
                yerr=[np.nan_to_num(row[f"{result}_deviation"]) for row in rows],
                fmt="_", ms=9, lw=1.0, capsize=2.5, color=COLOURS[1])  # fmt: skip


def bars(study: Study, result: int, found: dict) -> object:
    """Draw indices of Sobol, or coefficients of ranks, with their confidence."""
    one = study.results[result]
    labels = {p.name: p.label for p in study.parameters}
    sobol = "total" in next(iter(found.values()))
    kinds = [("first", "first order"), ("total", "total")] if sobol else [("rank", "rank")]
    fig, ax = new_figure(figsize=(6.4, 1.4 + 0.55 * len(found)))
    place = np.arange(len(found))[::-1]
    high = 0.8 / len(kinds)
    for k, (kind, label) in enumerate(kinds):
        value, low, top = (np.array([row[f"{kind}{end}"] for row in found.values()])
                           for end in ("", "_low", "_high"))  # fmt: skip
        error = np.maximum([value - low, top - value], 0.0)
        ax.barh(place + (0.5 * (len(kinds) - 1) - k) * high, value, high, xerr=error, label=label,
                color=COLOURS[k], error_kw={"lw": 1.0, "capsize": 2.5})  # fmt: skip
    ax.set_yticks(place, [short(labels[name]) for name in found])
    ax.axvline(0.0, color="black", lw=0.8)
    ax.set_xlabel(f"{'index of Sobol' if sobol else 'standardised rank coefficient'} [-]")
    ax.set_title(one.label, fontsize=10)
    if sobol:
        ax.legend()
    return fig


def tornado(study: Study, table: Table, result: int, found: dict) -> object:
    """Draw the range of a result over each parameter alone, the widest on top."""
    one = study.results[result]
    labels = {p.name: p.label for p in study.parameters}
    order = sorted(found, key=lambda name: found[name][1] - found[name][0])
    fig, ax = new_figure(figsize=(6.4, 1.4 + 0.45 * len(found)))
    low, high = (np.array([found[name][k] for name in order]) for k in (0, 1))
    ax.use_sticky_edges = False
    ax.barh(np.arange(len(order)), high - low, left=low, color=COLOURS[0])
    ax.axvline(table.results[one.name][0], color="black", lw=0.8)
    ax.set_yticks(np.arange(len(order)), [short(labels[name]) for name in order])
    ax.set_xlabel(one.label)
    return fig


def read_curves(store: Store, table: Table, curve: Curve) -> tuple[list, str, str]:
    """Return (x, y) of every finished point that has the curve, and the labels."""
    found, labels = [], (curve.x, curve.y)
    for k, state in enumerate(table.state):
        if state != "finished":
            continue
        history = read_history(store.point(k + 1) / curve.file)
        x, y = column_of(history, curve.x), column_of(history, curve.y)
        labels = tuple(f"{name.replace('_', ' ')} [{history.units[name]}]"
                       for name in (curve.x, curve.y))  # fmt: skip
        if x.size > 1:
            order = np.argsort(x, kind="stable")
            found.append((x[order], y[order]))
    if not found:
        raise FaultError("E590", f"no point has a curve '{curve.name}'", curve.file)
    return found, *labels


def band(store: Store, table: Table, curve: Curve) -> object:
    """Draw the curves of all points, their median and the band of 90 % of them.

    Over the abscissae that all of them have in common.
    """
    found, x_label, y_label = read_curves(store, table, curve)
    fig, ax = new_figure()
    for x, y in found:
        ax.plot(x, y, color="#bbbbbb", lw=0.5, zorder=1)
    low, high = max(x[0] for x, _ in found), min(x[-1] for x, _ in found)
    if low < high:
        grid = np.linspace(low, high, SAMPLES)
        rows = np.array([np.interp(grid, x, y) for x, y in found])
        least, middle, most = np.quantile(rows, (BAND[0], 0.5, BAND[1]), axis=0)
        ax.fill_between(grid, least, most, alpha=0.25, color=COLOURS[0], lw=0, label="90 %")
        ax.plot(grid, middle, color=COLOURS[0], label=f"median of {len(found)}")
        ax.legend()
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return fig
