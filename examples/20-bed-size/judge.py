"""Compare the force on the cone by size of the grains' domain, and the cost by size of the bed.

Usage: judge.py PLACE ..., in the folder of the run; result.txt, size.png.
"""

import csv
import sys
from pathlib import Path

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent.parent / "19-deep-cone"))
from forces import force_curve  # noqa: E402
from plans import PLANS, RADIUS  # noqa: E402

from talus.verification import read_history  # noqa: E402

BEDS, ZONES = ("bed4", "bed8", "bed13"), PLANS["bed8"].zones
BAND = (10.0, 20.0)  # way of the cone in which forces are compared [mm]
KINDS = {"box": "rigid box", "opened": "grains, ghosts and continuum"}


def force_of(stem: Path) -> float:
    """Return the mean force on tip, cone and shaft over the band [N]."""
    way, force = force_curve(stem, PLANS["bed8"])
    return float(force[(way > BAND[0]) & (way < BAND[1])].mean())


def forces(places: list[str]) -> dict[tuple[str, str, str], float]:
    """Return the force in each bed, kind or zone, and place that has finished [N]."""
    found = {}
    for bed in BEDS:
        for place in places:
            stems = {"whole": f"whole_{place}"}
            stems |= {f"opened_{zone}": f"{zone}_{place}/grains" for zone in ZONES}
            stems |= {f"box_{zone}": f"box_{zone}_{place}" for zone in ZONES}
            for name, stem in stems.items():
                run = name.removeprefix("opened_").removesuffix(f"_{place}")
                if Path(f"{bed}_{run}_{place}.finished").exists():
                    found[bed, name, place] = force_of(Path(bed) / stem)
    return found


def costs() -> dict[str, float]:
    """Return seconds of processors of each stage."""
    with Path("cost.csv").open() as file:
        return {row[0]: float(row[2]) for row in csv.reader(file)}


def most_awake(bed: str, run: str) -> int:
    """Return the number of grains of a run: at its end where some wake."""
    log = Path(bed) / run / "coupled_conversions.csv"
    if log.exists():
        return int(read_history(log)["awake"][-1])
    with h5py.File(Path(bed) / "bed.h5") as file:
        return len(file["grains/id"])


def table(found: dict, cost: dict[str, float], places: list[str]) -> list[str]:
    """Return the lines of result.txt."""
    lines = [
        "bed    run                 force at each place [N]              over all grains' of the bed      mean"
    ]
    for bed in BEDS:
        for name in sorted({key[1] for key in found if key[0] == bed}, reverse=True):
            here = [p for p in places if (bed, name, p) in found]
            force = np.array([found[bed, name, p] for p in here])
            whole = np.array([found.get((bed, "whole", p), np.nan) for p in here])
            ratio, error = force / whole, ""
            if len(here) > 1:
                error = f" ± {ratio.std(ddof=1) / np.sqrt(len(here)):.3f}"
            lines.append(f"{bed:6s} {name:16s} " + " ".join(f"{f:8.4f}" for f in force) + "   "
                         + " ".join(f"{r:6.3f}" for r in ratio) + f"   {ratio.mean():6.3f}{error}")  # fmt: skip
    lines.append("")
    for bed in BEDS:
        whole, opened = cost.get(f"{bed}_whole_a"), cost.get(f"{bed}_mid_a")
        if whole and opened:
            lines.append(f"{bed}: {most_awake(bed, 'whole_a')} grains {whole:.1f} s of processors, "
                         f"{most_awake(bed, 'mid_a')} awake {opened:.1f} s: {whole / opened:.1f} times fewer")  # fmt: skip
    return lines


def draw(found: dict, cost: dict[str, float], places: list[str]) -> None:
    """Draw forces over the half-width of the free zone, and cost over the number of grains."""
    fig, (left, right) = plt.subplots(ncols=2, figsize=(10.5, 4.0), layout="constrained")
    whole = {p: found["bed8", "whole", p] for p in places if ("bed8", "whole", p) in found}
    if len(whole) > 1:
        spread = np.std(list(whole.values()), ddof=1) / np.mean(list(whole.values()))
        left.axhspan(
            1.0 - spread, 1.0 + spread, color="0.9", label="all grains, from place to place"
        )
    for kind, label in KINDS.items():
        x, mean, error = [], [], []
        for zone, size in ZONES.items():
            ratio = [found["bed8", f"{kind}_{zone}", p] / w for p, w in whole.items()
                     if ("bed8", f"{kind}_{zone}", p) in found]  # fmt: skip
            if len(ratio) > 1:
                x.append(size.free / RADIUS)
                mean.append(np.mean(ratio))
                error.append(np.std(ratio, ddof=1) / np.sqrt(len(ratio)))
        left.errorbar(x, mean, error, marker="o", capsize=3, label=label)
    left.set(xlabel="half-width of free grains / radius of the cone",
             ylabel="force / that of all grains at the same place")  # fmt: skip
    left.legend(fontsize=8)
    beds = [bed for bed in BEDS if f"{bed}_whole_a" in cost and f"{bed}_mid_a" in cost]
    number = [most_awake(bed, "whole_a") for bed in beds]
    right.loglog(number, [cost[f"{bed}_whole_a"] for bed in beds], "o-", label="all grains")
    right.loglog(number, [cost[f"{bed}_mid_a"] for bed in beds], "s-", label=KINDS["opened"])
    right.set(xlabel="grains in the bed", ylabel="seconds of processors")
    right.legend(fontsize=8)
    fig.savefig("size.png", dpi=110)


def main(places: list[str]) -> None:
    """Write table and picture."""
    found, cost = forces(places), costs()
    lines = table(found, cost, places)
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    draw(found, cost, places)


if __name__ == "__main__":
    main(sys.argv[1:])
