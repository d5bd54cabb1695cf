"""`talus plot`: ledger, force-penetration, ghosts, audit, measures; or all of a folder."""

import argparse
import sys
from pathlib import Path

from talus import measure_plots, plots
from talus.faults import FaultError

KINDS = ("force", "ghosts", "audit", "energy", "measure", "rose", "slice")


def register(commands: argparse._SubParsersAction) -> None:
    """Add `plot`."""
    new = commands.add_parser(
        "plot",
        help="figures of a run",
        description=f"talus plot FOLDER, or talus plot {{{','.join(KINDS)}}} FILE ...",
    )
    new.add_argument("what", help=f"a folder of results, or one of {', '.join(KINDS)}")
    new.add_argument("files", nargs="*", help="files; for force: RUN_DRIVEN_CSV[=label] ...")
    new.add_argument("-o", "--output", type=Path, help="PNG (for a folder: the folder of the PNGs)")
    new.add_argument("--csv", type=Path, help="force: write the curves too")
    new.add_argument("--title", default="", help="force: title, e.g. mode, gravity and speed")
    new.add_argument("--tool", type=int, help="force: id of the driven grain if there are several")
    new.add_argument("--step", type=int, default=-1, help="step, negative from the end")
    new.add_argument("--field", default="solid_fraction", help="slice: density, stress_xy, ...")
    new.add_argument("--axis", choices="xyz", default="y", help="slice: across this axis")
    new.add_argument("--at", type=float, help="slice: place along the axis [m], else the middle")
    new.set_defaults(run=plot)


def plot(options: argparse.Namespace) -> int:
    """Make the figures that were asked for."""
    if options.what not in KINDS:
        return plot_folder(Path(options.what), options)
    if not options.files:
        raise FaultError("E549", f"'talus plot {options.what}' needs a file")
    if options.what == "force":
        return plot_force(options)
    if len(options.files) > 1:
        raise FaultError("E549", f"'talus plot {options.what}' takes one file")
    source = Path(options.files[0])
    if options.what == "rose":
        return save(
            measure_plots.rose(source, options.step),
            options.output or Path(f"{source.stem}_rose.png"),
        )
    if options.what == "slice":
        return plot_slice(source, options)
    if options.what == "measure":
        return save(measure_plots.history(source), options.output or Path(f"{source.stem}.png"))
    if options.what == "ghosts":
        return save(
            plots.ghosts(source, options.step), options.output or Path("ghost_displacement.png")
        )
    figure = plots.audit(source) if options.what == "audit" else plots.energy(source)
    return save(figure, options.output or Path(f"{source.stem}.png"))


def plot_slice(source: Path, options: argparse.Namespace) -> int:
    """One layer of a coarse-grained field."""
    figure = measure_plots.slice_of(source, options.field, options.axis, options.at, options.step)
    return save(figure, options.output or Path(f"{source.stem}_{options.field}.png"))


def plot_force(options: argparse.Namespace) -> int:
    """Force-penetration of one or several runs in one figure."""
    curves = {}
    for text in options.files:
        name, _, label = text.partition("=")
        path = Path(name)
        label = label or plots.stem_of(path, "_driven")
        if label in curves:
            raise FaultError("E549", f"two curves are called '{label}'", "name them: FILE=label")
        curves[label] = plots.force_curve(path, options.tool)
    if options.csv:
        plots.write_force_table(options.csv, curves)
        print(options.csv)
    return save(
        plots.force_figure(curves, options.title), options.output or Path("force_penetration.png")
    )


def save(figure: object, path: Path) -> int:
    """Write one figure and say its name."""
    from talus.look import save_figure

    save_figure(figure, path)
    print(path)
    return 0


def plot_folder(folder: Path, options: argparse.Namespace) -> int:
    """Make every figure that a folder's files allow; a damaged file does not stop the others."""
    if not folder.is_dir():
        hint = f"a folder, or one of {', '.join(KINDS)}"
        raise FaultError("E549", f"'{folder}' is no folder and no kind of plot", hint)
    out = options.output or folder
    works = [
        (path, plots.energy, f"{path.stem}.png") for path in sorted(folder.glob("*_energy.csv"))
    ]
    works += [
        (path, plots.audit, f"{path.stem}.png") for path in sorted(folder.glob("*_audit.csv"))
    ]
    works += [
        (path, measure_plots.history, f"{path.stem}.png")
        for path in sorted(folder.glob("*_measure_*.csv"))
    ]
    driven = sorted(folder.glob("*_driven.csv"))
    if driven:
        works.append((driven, force_of_all, "force_penetration.png"))
    works += [
        (path, plots.ghosts, f"{path.stem}_ghosts.png")
        for path in sorted(folder.glob("*.h5"))
        if path.with_suffix(".xdmf").exists() and (folder / f"{path.stem}_energy.csv").exists()
    ]
    made = 0
    for source, work, name in works:
        try:
            made += save(work(source), out / name) == 0
        except FaultError as fault:
            if fault.code not in ("E543", "E548"):  # no grains, no ghosts: nothing to draw
                print(fault, file=sys.stderr)
    if not made:
        raise FaultError(
            "E549", f"{folder} holds nothing to plot", "*_energy.csv, *_driven.csv, ..."
        )
    return 0


def force_of_all(paths: list[Path]) -> object:
    """Force-penetration of all runs of a folder."""
    return plots.force_figure({plots.stem_of(p, "_driven"): plots.force_curve(p) for p in paths})
