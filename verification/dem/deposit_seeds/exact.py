"""Three deposits of the small container: counts, density, contacts, fabric, screening, ledger."""

import json

import numpy as np

from talus import generate, measure
from talus.packing import FREE, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

SEEDS = (1, 2, 3)
MARGIN, LAYERS = 6.0e-3, 9  # bulk grains see neither wall nor surface [m]
SPACING = 0.3e-3  # of the points inside grains that are counted [m]
FINE = """&curve id = 'fine', times = 0.0, 0.07, 0.075, 0.215, 0.22,
  values = 1.0, 1.0, 0.2, 0.2, 1.0 /
"""  # of the time step, as in examples/01-penetration/deposit.nml
WHY_SHARE = "Janssen: 0.4 once the friction at the walls is used up; the fall leaves less"


def run(case: Case) -> None:
    """Drop the grains of each seed and judge the bed."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 3.8))
    left.axvspan(0.58, 0.62, color="#e8edf2", label="asked, mean")
    shares = []
    for seed in SEEDS:
        make(case, seed)
        height, fraction, number, share = judge(case, seed)
        shares.append(share)
        left.plot(
            fraction, 1e3 * (height - generate.FLOOR_HEIGHT), "o-", ms=3, label=f"seed {seed}"
        )
        counts = np.bincount(number) / number.size
        right.plot(counts, "o-", ms=3, label=f"seed {seed}: mean {number.mean():.2f}")
    fine_fall(case)
    case.below("load on the floor / weight, mean", float(np.mean(shares)), 0.8, WHY_SHARE)
    left.set(xlabel="solid fraction [-]", ylabel="height above the floor's centres [mm]")
    left.set(xlim=(0.50, 0.70))
    left.legend(fontsize=8)
    right.set(xlabel="contacts of a bulk grain [-]", ylabel="share of bulk grains [-]")
    right.legend(fontsize=8)
    case.save(fig)


def fine_fall(case: Case) -> None:
    """Drop the first bed with the curve of the example's deck: its ledger closes."""
    coarse, curve = "dt_factor = 0.3", "dt_factor = 0.3, curve = 'fine'"
    deck = (case.folder / "deposit.nml").read_text().replace(coarse, curve)
    (case.folder / "fine.nml").write_text(deck + FINE)
    write_h5(case.folder / "start.h5", generate.penetration("small", SEEDS[0], guard_rows=27))
    case.run("talus-dem", "fine.nml", "--threads=1")
    energy = read_history(case.folder / "fine_energy.csv")
    worst = float(energy["relative_closure"].max())
    case.below("largest relative closure, fall with a finer step", worst, 1e-4)


def make(case: Case, seed: int) -> None:
    """Drop the grains, open the box, restore the modulus, bring the bed to rest."""
    write_h5(case.folder / "start.h5", generate.penetration("small", seed, guard_rows=27))
    case.run("talus-dem", "deposit.nml", "--threads=1")
    bed = read_packing(case.folder / "soft.h5")
    bed = bed.take(~np.isin(bed.id, bed.groups["guard"]))
    bed.v[:], bed.omega[:] = 0.0, 0.0
    write_h5(case.folder / "soft_open.h5", bed)
    case.run("talus-dem", "restore.nml", "--threads=1")
    case.run("talus-dem", "settle.nml", "--threads=1")


def judge(case: Case, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Judge one bed; return heights and solid fractions of layers, contacts of bulk grains, share.

    The share is that of the weight which the floor carries.
    """
    packing = read_packing(case.folder / "rest.h5")
    inside = packing.x[packing.kind == FREE]
    half = 17.5e-3 + 0.1e-3
    held = int((np.abs(inside[:, :2]) < half).all(axis=1).sum())
    case.metric(f"free grains in the box, seed {seed}", held, 1960, 0)
    height, fraction = measure.layer_fractions(packing, MARGIN, LAYERS, SPACING)
    case.metric(f"solid fraction of the bulk, seed {seed}", float(fraction.mean()), 0.60, 0.02)
    pairs, _ = measure.contacts(packing)
    bulk = measure.bulk_rows(packing, MARGIN)
    number = np.bincount(pairs.ravel(), minlength=packing.count)[bulk]
    case.metric(f"coordination of bulk grains, seed {seed}", float(number.mean()), 5.0, 0.4)
    fabric = measure.short_axis_fabric(packing, bulk)
    case.above(f"second moment zz of short axes, seed {seed}", float(fabric[2, 2]), 1.0 / 3.0)
    force = field_steps(case.folder / "settle.h5")[-1].grains["force"]
    share = measure.floor_share(packing, force)
    case.below(f"load on the floor / weight, seed {seed}", share, 0.95, "the walls carry a part")
    for name in ("restore", "settle"):
        energy = read_history(case.folder / f"{name}_energy.csv")
        worst = float(energy["relative_closure"].max())
        case.below(f"largest relative closure, {name}, seed {seed}", worst, 1e-4)
    health = json.loads((case.folder / "settle_summary.json").read_text())["health"]
    case.below(f"kinetic / elastic energy, seed {seed}", health["kinetic_over_elastic"], 1e-6)
    return height, fraction, number, share
