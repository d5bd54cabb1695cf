"""`talus plot`: ledger, force-penetration, ghosts, audit, measures, tests; or all of a folder."""

import argparse
import sys
from pathlib import Path

from talus import (
    boundary_plots,
    cell_plots,
    flow_plots,
    gallery,
    grading_plots,
    inertia,
    measure_plots,
    overlap_plots,
    plots,
    specimens,
)
from talus.faults import FaultError

KINDS = ("force", "ghosts", "audit", "energy", "measure", "rose", "slice", "specimen", "cell",
         "probe", "boundary", "reactions", "profile", "flow", "window", "conversions",
         "grading")  # fmt: skip
OF_ONE = {
    "measure": measure_plots.history, "cell": cell_plots.figure, "probe": measure_plots.probe,
    "boundary": boundary_plots.figure, "reactions": boundary_plots.reactions,
    "grading": grading_plots.figure,
    "flow": flow_plots.through, "window": flow_plots.window,
    "conversions": flow_plots.conversions, "audit": plots.audit, "energy": plots.energy,
}  # fmt: skip


def register(commands: argparse._SubParsersAction) -> None:
    """Add `plot`."""
    new = commands.add_parser(
        "plot",
        help="figures of a run",
        description=f"talus plot FOLDER, or talus plot {{{','.join(KINDS)}}} FILE ...",
    )
    new.add_argument("what", help=f"a folder of results, or one of {', '.join(KINDS)}")
    new.add_argument("files", nargs="*", help="files; for force and specimen: CSV[=label] ...")
    new.add_argument("-o", "--output", type=Path, help="PNG (for a folder: the folder of the PNGs)")
    new.add_argument("--csv", type=Path, help="force, specimen: write the curves")
    new.add_argument("--title", default="", help="force, specimen: title, e.g. mode and speed")
    new.add_argument("--tool", type=int, help="force: id of the driven grain if there are several")
    new.add_argument("--step", type=int, default=-1, help="step, negative from the end")
    new.add_argument("--of", choices=("contacts", "axes"), default="contacts",
                     help="rose: directions of contacts, or of the grains' axes")  # fmt: skip
    new.add_argument("--field", default="solid_fraction", help="slice: density, stress_xy, ...")
    new.add_argument("--axial", choices="xyz", default="z", help="specimen, profile: the direction")
    new.add_argument(
        "--axis", choices="xyz", default="y", help="slice: across this axis (default y)"
    )
    new.add_argument("--at", type=float, help="slice: place along the axis [m], else the middle")
    new.set_defaults(run=plot)


def plot(options: argparse.Namespace) -> int:
    """Make the requested figures."""
    if options.what not in KINDS:
        return plot_folder(Path(options.what), options)
    if not options.files:
        raise FaultError("E549", f"'talus plot {options.what}' needs a file")
    if options.what == "force":
        return plot_force(options)
    if options.what == "specimen":
        return plot_specimens(options)
    if options.what == "profile":
        return plot_profile(options)
    if len(options.files) > 1:
        raise FaultError("E549", f"'talus plot {options.what}' requires one file")
    source = Path(options.files[0])
    if options.what == "rose":
        axes = options.of == "axes"
        work = measure_plots.axes_rose if axes else measure_plots.rose
        name = f"{source.stem}_{'axes_rose' if axes else 'rose'}.png"
        return save(work(source, options.step), options.output or Path(name))
    if options.what == "slice":
        return plot_slice(source, options)
    if options.what == "ghosts":
        return save(
            plots.ghosts(source, options.step), options.output or Path("ghost_displacement.png")
        )
    return save(OF_ONE[options.what](source), options.output or Path(f"{source.stem}.png"))


def plot_profile(options: argparse.Namespace) -> int:
    """Velocity along an axis through grains and solid, several times."""
    if len(options.files) > 2:
        raise FaultError("E549", "'talus plot profile' requires grains.h5 and solid.h5")
    solid = Path(options.files[1]) if len(options.files) == 2 else None
    figure = overlap_plots.profile(Path(options.files[0]), solid, options.axial)
    return save(figure, options.output or Path("profile.png"))


def plot_slice(source: Path, options: argparse.Namespace) -> int:
    """One layer of a coarse-grained field."""
    figure = measure_plots.slice_of(source, options.field, options.axis, options.at, options.step)
    return save(figure, options.output or Path(f"{source.stem}_{options.field}.png"))


def labelled(texts: list[str], *endings: str) -> dict[str, Path]:
    """Return files by label from words FILE[=label]; without label the run's name."""
    files = {}
    for text in texts:
        name, _, label = text.partition("=")
        stem = Path(name).stem
        for ending in endings:
            stem = stem.removesuffix(ending)
        label = label or stem
        if label in files:
            raise FaultError("E549", f"two curves are called '{label}'", "name them: FILE=label")
        files[label] = Path(name)
    return files


def plot_specimens(options: argparse.Namespace) -> int:
    """Element tests, one or several in one figure."""
    files = labelled(options.files, *specimens.READERS)
    tests = {k: specimens.read_test(path, options.axial) for k, path in files.items()}
    for label, test in tests.items():
        number = inertia.inertial_number(files[label], test)
        print(f"{label}: {specimens.angles(test)}{inertia.said(number)}")
    if options.csv:
        specimens.write_table(options.csv, tests)
        print(options.csv)
    return save(specimens.figure(tests, options.title), options.output or Path("specimen.png"))


def plot_force(options: argparse.Namespace) -> int:
    """Force-penetration of one or several runs in one figure."""
    files = labelled(options.files, "_driven")
    curves = {label: plots.force_curve(path, options.tool) for label, path in files.items()}
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
    made = 0
    for exhibit in gallery.exhibits(folder):
        try:
            made += save(exhibit.work(), out / exhibit.name) == 0
        except FaultError as fault:
            if fault.code not in gallery.QUIET:
                print(fault, file=sys.stderr)
    if not made:
        raise FaultError(
            "E549", f"{folder} holds nothing to plot", "*_energy.csv, *_driven.csv, ..."
        )
    return 0
