"""One page that compares several runs: lights, curves over each other, numbers side by side."""

import html
from pathlib import Path

from talus import histories, inertia, lights, plots, specimens
from talus.faults import FaultError
from talus.look import COLOURS, figure_bytes, new_figure
from talus.reports import Run, page_of, picture, runs_of, shown

ENERGIES = ("kinetic", "elastic", "friction", "contact_damping", "plastic", "relative_closure")
ALIKE = 1.0e-12  # relative difference below which two numbers are the same


def labels_of(folders: list[Path]) -> list[str]:
    """Return a name for each folder: its last part, or all of it where that is not unique."""
    if len({folder.resolve() for folder in folders}) < len(folders):
        raise FaultError("E604", "a folder is given twice", "runs are compared by their folders")
    names = [folder.resolve().name for folder in folders]
    return names if len(set(names)) == len(names) else [str(folder) for folder in folders]


def build(folders: list[Path], title: str) -> str:
    """Return the page on several folders of results."""
    labels = labels_of(folders)
    runs = {label: runs_of(folder) for label, folder in zip(labels, folders, strict=True)}
    empty = [str(f) for f, found in zip(folders, runs.values(), strict=True) if not found]
    if empty:
        raise FaultError("E553", f"{empty[0]} holds no *_summary.json", "a run that ended has one")
    said = [f"<p>{html.escape(f'{label}: {line}')}</p>"
            for label, folder in zip(labels, folders, strict=True)
            for line in inertia.lines(inertia.tests_of(folder))]  # fmt: skip
    parts = [*said, "<h2>Curves</h2>", *curves(dict(zip(labels, folders, strict=True)))]
    parts.append("<h2>Health</h2>")
    for label, found in runs.items():
        parts += [lights.panel(f"{label}: {run.name}", run.program, run.light) for run in found]
    parts += ["<h2>Numbers</h2>", *numbers(runs)]
    return page_of(title or f"{len(folders)} runs: {', '.join(labels)}", parts)


def curves(folders: dict[str, Path]) -> list[str]:
    """Return figures with a curve of each run: forces, tests, energies."""
    made = []
    for name, work in (("force and penetration", forces), ("element tests", tests),
                       ("energies", energies)):  # fmt: skip
        try:
            figure = work(folders)
        except FaultError as fault:
            made.append(f'<p class="bad">{html.escape(str(fault))}</p>')
            continue
        if figure:
            made.append(picture(figure_bytes(figure), name))
    return made or ["<p>No histories that can be laid over each other.</p>"]


def files(folders: dict[str, Path], pattern: str, ending: str) -> dict[str, Path]:
    """Return the histories of all folders by label, with the run's name where a folder has more."""
    found = {}
    for label, folder in folders.items():
        some = sorted(folder.glob(pattern))
        for path in some:
            more = f" {plots.stem_of(path, ending)}" if len(some) > 1 else ""
            found[label + more] = path
    return found


def forces(folders: dict[str, Path]) -> object | None:
    """Force-penetration of all runs."""
    found = files(folders, "*_driven.csv", "_driven")
    return plots.force_figure({k: plots.force_curve(path) for k, path in found.items()}) if found \
        else None  # fmt: skip


def tests(folders: dict[str, Path]) -> object | None:
    """Element tests of all runs."""
    found, curves_of = {}, {}
    for ending in (specimens.ENDING, specimens.CELL_ENDING):
        found |= files(folders, f"*{ending}.csv", ending)
    for label, path in found.items():
        try:
            curves_of[label] = specimens.read_test(path)
        except FaultError as fault:
            if fault.code != "E558":
                raise
    return specimens.figure(curves_of) if curves_of else None


def energies(folders: dict[str, Path]) -> object | None:
    """Terms of the energy ledger, a panel a term."""
    found = files(folders, "*_energy.csv", "_energy")
    read = {label: histories.read(path) for label, path in found.items()}
    read = {label: one for label, one in read.items() if len(one["time"])}
    names = [n for n in ENERGIES if any(n in r.columns and r[n].any() for r in read.values())]
    if not names:
        return None
    rows = -(-len(names) // 3)
    fig, grid = new_figure(nrows=rows, ncols=3, figsize=(11.0, 3.0 * rows), squeeze=False)
    for ax, name in zip(grid.flat, names, strict=False):
        for k, (label, one) in enumerate(read.items()):
            if name in one.columns:
                ax.plot(one["time"], one[name], color=COLOURS[k % len(COLOURS)], label=label)
        unit = next(r.units[name] for r in read.values() if name in r.columns)
        ax.set(xlabel="time [s]", ylabel=f"{name.replace('_', ' ')} [{unit}]")
    for ax in grid.flat[len(names) :]:
        ax.set_visible(False)
    grid.flat[0].legend(fontsize=7)
    return fig


def flat(facts: dict) -> dict[str, object]:
    """Return the values of a summary by their names, those of tables as `table.name`."""
    found = {}
    for name, value in facts.items():
        if isinstance(value, dict):
            found |= {f"{name}.{key}": one for key, one in value.items()}
        elif name != "errors":
            found[name] = value
    return found


def numbers(runs: dict[str, list[Run]]) -> list[str]:
    """Return a folded table a program: values of the runs, and their ratio to the first."""
    parts = []
    for program in dict.fromkeys(run.program for found in runs.values() for run in found):
        columns = [(named(label, run, found), flat(run.facts)) for label, found in runs.items()
                   for run in found if run.program == program]  # fmt: skip
        names = dict.fromkeys(name for _, facts in columns for name in facts)
        rows = "".join(row(name, [facts.get(name) for _, facts in columns]) for name in names)
        head = "".join(f"<th>{html.escape(label)}</th>" for label, _ in columns)
        parts.append(
            f"<details><summary>{html.escape(program)}</summary><table><tr><th></th>{head}</tr>"
            f"{rows}</table></details>"
        )
    return parts


def named(label: str, run: Run, found: list[Run]) -> str:
    """Return the label of a folder, with the run's name where it has several of the program."""
    several = sum(other.program == run.program for other in found) > 1
    return f"{label}: {run.name}" if several else label


def row(name: str, values: list[object]) -> str:
    """Return a row of a table: a value that differs from the first is bold, with its ratio."""
    cells = []
    for value in values:
        text = html.escape(shown(value))
        first = values[0]
        if value != first and all(isinstance(v, int | float) for v in (value, first)):
            if abs(value - first) > ALIKE * abs(first):
                ratio = f" (× {value / first:.3g})" if first else ""
                text = f"<b>{text}</b>{ratio}"
        elif value != first:
            text = f"<b>{text}</b>"
        cells.append(f"<td>{text}</td>")
    return f"<tr><td>{html.escape(name.replace('_', ' '))}</td>{''.join(cells)}</tr>"
