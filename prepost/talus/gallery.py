"""Every figure that the files of a folder allow, for `talus plot FOLDER` and `talus report`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from talus import (
    boundary_plots,
    cell_plots,
    flow_plots,
    grading_plots,
    measure_plots,
    plots,
    specimens,
)

QUIET = ("E543", "E548", "E558")  # no grains or contacts, no ghosts, no box: nothing to draw


@dataclass
class Exhibit:
    """A figure that can be made: its source, the work, the name of its PNG."""

    source: Path
    work: Callable[[], object]
    name: str


def exhibits(folder: Path) -> list[Exhibit]:
    """Return what can be drawn of a folder, in order; each may still fail on a damaged file."""
    found = []

    def add(pattern: str, work: Callable[[Path], object], ending: str = "", cut: str = "") -> None:
        for path in sorted(folder.glob(pattern)):
            name = f"{path.stem.removesuffix(cut)}{ending}.png"
            found.append(Exhibit(path, lambda path=path: work(path), name))

    add("*_energy.csv", plots.energy)
    add("*_audit.csv", plots.audit)
    add("*_measure_*.csv", measure_plots.history)
    add(f"*{specimens.ENDING}.csv", specimen_of, "_specimen", specimens.ENDING)
    add("*_cell.csv", cell_plots.figure)
    add("*_grading.csv", grading_plots.figure)
    add(f"*{specimens.CELL_ENDING}.csv", specimen_of, "_specimen", specimens.CELL_ENDING)
    add("*_probe.json", measure_plots.probe)
    add("*_surfaces.csv", boundary_plots.figure)
    add("*_reactions.csv", boundary_plots.reactions)
    add("*_conversions.csv", flow_plots.conversions)
    add("*_window.csv", flow_plots.window)
    add("*_sources.csv", flow_plots.through)
    fed = {path.stem.removesuffix("_sources") for path in folder.glob("*_sources.csv")}
    for path in sorted(folder.glob("*_sinks.csv")):
        if path.stem.removesuffix("_sinks") not in fed:
            found.append(Exhibit(path, lambda p=path: flow_plots.through(p), f"{path.stem}.png"))
    driven = sorted(folder.glob("*_driven.csv"))
    if driven:
        found.append(Exhibit(driven[0], lambda: force_of_all(driven), "force_penetration.png"))
    for path in sorted(folder.glob("*.h5")):
        run = path.with_suffix(".xdmf").exists() and (folder / f"{path.stem}_energy.csv").exists()
        if run:
            found.append(Exhibit(path, lambda p=path: plots.ghosts(p), f"{path.stem}_ghosts.png"))
            found.append(
                Exhibit(path, lambda p=path: measure_plots.rose(p), f"{path.stem}_rose.png")
            )
            axes = f"{path.stem}_axes_rose.png"
            found.append(Exhibit(path, lambda p=path: measure_plots.axes_rose(p), axes))
    add("*_grid_*.h5", slice_of, "_solid_fraction")
    return found


def specimen_of(path: Path) -> object:
    """Figure of one element test."""
    test = specimens.read_test(path)
    return specimens.figure({test.name: test})


def slice_of(path: Path) -> object:
    """Solid fraction in the middle layer across y, last step."""
    return measure_plots.slice_of(path, "solid_fraction", "y", None)


def force_of_all(paths: list[Path]) -> object:
    """Force-penetration of all runs of a folder."""
    return plots.force_figure({plots.stem_of(p, "_driven"): plots.force_curve(p) for p in paths})
