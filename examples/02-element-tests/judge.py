"""Judge the element tests: friction angles over the seeds, stress at rest, figures.

Usage: judge.py OUT, the folder of run.sh. Writes figures with their curves and angles.csv and
prints the table. What is missing is left out and named. Nothing is tuned: a value outside its band
is printed as such and the exit code stays 0.
"""

import sys
from pathlib import Path

import numpy as np

from talus import strength
from talus.cell_plots import figure as cell_figure
from talus.histories import read
from talus.look import save_figure
from talus.specimens import Specimen, figure, mean_over, peak_angle, read_test, write_table

CRITICAL = (0.35, 0.48)  # axial strain over which the critical state is averaged
BANDS = {"peak": (35.0, 45.0), "critical": (27.0, 33.0)}  # published, degrees


def find(out: Path, test: str, friction: str) -> dict[str, Specimen]:
    """Return the finished tests of a kind by seed."""
    found = {}
    start, ending = ("cell_", "cell") if test.startswith("cell_") else ("", "walls")
    for folder in sorted(out.glob(f"{start}seed*_mu{friction}")):
        if (folder / test / "finished").exists():
            seed = folder.name.removeprefix(start).split("_")[0].removeprefix("seed")
            found[seed] = read_test(folder / test / f"{test}_{ending}.csv")
    return found


def void_ratio_text(test: Specimen, at: int) -> str:
    """Void ratio at a time, as text."""
    return "-" if test.void_ratio is None else f"{test.void_ratio[at]:.3f}"


def angles(tests: dict[str, Specimen], lines: list[str]) -> dict[str, np.ndarray]:
    """Print and return peak and critical angles [deg], one a seed."""
    print("  seed  e at 100 kPa  peak [deg]  at strain  critical [deg]  e at the end")
    peaks, criticals = [], []
    for seed, test in tests.items():
        peak, where = peak_angle(test)
        critical = mean_over(test, test.friction_angle, *CRITICAL)
        first, last = void_ratio_text(test, 0), void_ratio_text(test, -1)
        print(f"  {seed:>4s}  {first:>12s}{peak:12.1f}{where:11.3f}{critical:16.1f}{last:>14s}")
        lines.append(f"{seed},{first},{peak:.4f},{where:.4f},{critical:.4f},{last}")
        peaks.append(peak)
        criticals.append(critical)
    return {"peak": np.array(peaks), "critical": np.array(criticals)}


def verdicts(found: dict[str, np.ndarray]) -> list[str]:
    """Say of both angles whether their mean, and each seed, lies in the published band."""
    texts = []
    for name, (low, high) in BANDS.items():
        values = found[name][np.isfinite(found[name])]
        if not len(values):
            texts.append(f"{name}: not judged, no test has reached its strain")
            continue
        spread = f" ± {values.std(ddof=1):.1f}" if len(values) > 1 else ""
        inside = int(np.count_nonzero((values >= low) & (values <= high)))
        judged = "in" if low <= values.mean() <= high else "OUTSIDE"
        texts.append(
            f"{name}: {values.mean():.1f}{spread} deg, {judged} the band {low:g}-{high:g}; "
            f"{inside} of {len(values)} seeds inside"
        )
    return texts


def ledger(out: Path) -> str:
    """Largest relative closure of the energy ledger over all tests."""
    paths = [folder.parent for folder in out.glob("*seed*/*/finished")]
    paths += [folder.parent for folder in out.glob("*seed*/finished")]
    worst, where = 0.0, "-"
    for folder in paths:
        for path in folder.glob("*_energy.csv"):
            value = float(read(path)["relative_closure"].max())
            if value > worst:
                worst, where = value, str(path.relative_to(out))
    return f"largest relative closure of the ledger {worst:.2g} ({where})"


def show(out: Path, name: str, tests: dict[str, Specimen], title: str) -> None:
    """Draw tests that are finished."""
    if not tests:
        print(f"  {name}: not drawn, no test is finished")
        return
    save_figure(figure(tests, title), out / f"{name}.png")
    write_table(out / f"{name}.csv", tests)
    print(f"  {out / name}.png")


def cells(out: Path) -> list[str]:
    """Print angles of the tests in a cell, draw them; return verdicts."""
    print("drained, dense specimens in a cell")
    drained, lines = find(out, "cell_drained", "0.1"), []
    texts = [f"in a cell, {text}" for text in verdicts(angles(drained, lines))]
    if lines:
        head = "seed,void_ratio [-],peak [deg],peak_strain [-],critical [deg],void_ratio_end [-]"
        (out / "cell_angles.csv").write_text("\n".join([head, *lines]) + "\n")
    show(out, "cell_drained", {f"seed {k}": t for k, t in drained.items()}, "Drained, in a cell")
    other = {"isotropic": "cell_compression", "one-dimensional": "cell_k0",
             "constant volume": "cell_undrained"}  # fmt: skip
    tests = {f"{label}, seed {k}": t for label, name in other.items()
             for k, t in find(out, name, "0.1").items()}  # fmt: skip
    show(out, "cells", tests, "In a cell, from 100 kPa")
    for path in sorted(out.glob("cell_seed*/cell_shear/cell_shear_cell.csv")):
        if (path.parent / "finished").exists():
            save_figure(cell_figure(path), out / "shear.png")
            print(f"  {out / 'shear.png'}")
            texts += cone(out, path)
    return texts


def cone(out: Path, shear: Path) -> list[str]:
    """Fit a cone to the shear test and the triaxial one of the same specimen; return verdicts."""
    triaxial = shear.parents[1] / "cell_drained"
    if not (triaxial / "finished").exists():
        return []
    paths = [triaxial / "cell_drained_cell.csv", shear]
    tests = [strength.read_loading(path) for path in paths]
    found = strength.fit_states(tests, "compression")
    strength.write_json(out / "strength.json", found)
    save_figure(strength.figure(tests, found), out / "strength.png")
    print(f"  {out / 'strength.png'}")
    return [f"cone, {state}: friction {fit.friction_deg:.1f}, dilation {fit.dilation_deg:.1f} deg, "
            f"cohesion {fit.cohesion_Pa:.3g} Pa, scatter {100.0 * fit.scatter:.1f} %"
            for state, (fit, _) in found.items()]  # fmt: skip


def main() -> int:
    """Judge a folder."""
    out = Path(sys.argv[1])
    lines = ["seed,void_ratio [-],peak [deg],peak_strain [-],critical [deg],void_ratio_end [-]"]
    dense, loose = find(out, "drained", "0.1"), find(out, "drained", "0.5")
    print("\ndrained, dense specimens")
    texts = verdicts(angles(dense, lines))
    print("drained, loose specimens")
    angles(loose, lines)
    (out / "angles.csv").write_text("\n".join(lines) + "\n")
    texts += cells(out)
    rest = find(out, "k0", "0.1")
    for seed, test in rest.items():
        texts.append(f"seed {seed}: K0 = {test.lateral[-1] / test.axial[-1]:.3f} at the end")
    still = find(out, "undrained", "0.1") | {
        f"{seed}, loose": test for seed, test in find(out, "undrained", "0.5").items()
    }
    for seed, test in still.items():
        change = float(np.abs(test.volumetric_strain).max())
        texts.append(f"seed {seed}: volume at constant volume changed by {change:.1e}")
    print("\n".join(f"  {text}" for text in [*texts, ledger(out)]))
    show(out, "drained", {f"seed {k}": t for k, t in dense.items()}, "Drained, dense, 100 kPa")
    mixed = {f"dense, drained, seed {k}": t for k, t in list(dense.items())[:1]}
    mixed |= {f"loose, drained, seed {k}": t for k, t in loose.items()}
    show(out, "loose", mixed, "Drained, dense and loose, 100 kPa")
    still = {f"seed {k}": test for k, test in still.items()}
    show(out, "constant_volume", still, "At constant volume, from 100 kPa")
    both = {f"isotropic, seed {k}": t for k, t in find(out, "compression", "0.1").items()}
    both |= {f"K0, seed {k}": t for k, t in rest.items()}
    show(out, "compression", both, "Isotropic and one-dimensional compression")
    return 0


if __name__ == "__main__":
    sys.exit(main())
