"""The shipped deposit of the small container: is it as dense and as connected as it must be?

The text form keeps no tangential springs: the load on the floor is that of the normal forces.
"""

from pathlib import Path

import numpy as np

import talus
from talus import measure
from talus.generate import FLOOR_HEIGHT
from talus.packing import FIXED, FREE, Packing, read_packing, write_h5
from talus.verification import field_steps

DEPOSIT = Path(talus.__file__).resolve().parents[2] / "examples/01-penetration/deposit_small.txt"
MARGIN = 6.0e-3  # three mean semi-axes: bulk grains see neither wall nor surface [m]
LAYERS = 9
DENSITY, GRAVITY = 2650.0, 9.81
SPACING = 0.25e-3  # of the points inside grains that are counted, 1/6 of the least semi-axis [m]
WHY_OVERLAP = (
    "Hertz overlap of one contact under the weight of all grains: E was restored, bed at rest"
)


def run(case: object) -> None:
    """Judge counts, solid fraction, coordination and fabric of the bulk; draw both profiles."""
    packing = read_packing(DEPOSIT)
    free = packing.kind == FREE
    case.metric("free grains", int(free.sum()), 1960, 0)
    case.metric("fixed grains", int((packing.kind == 1).sum()), 800, 0)
    height, fraction = measure.layer_fractions(packing, MARGIN, LAYERS, SPACING)
    case.metric("solid fraction of the bulk", float(fraction.mean()), 0.60, 0.02, "0.58-0.62")
    pairs, gap = measure.contacts(packing)
    number = np.bincount(pairs.ravel(), minlength=packing.count)
    bulk = measure.bulk_rows(packing, MARGIN)
    case.metric("coordination of bulk grains", float(number[bulk].mean()), 5.0, 0.4, "4.6-5.4")
    fabric = measure.short_axis_fabric(packing, bulk)
    case.above("second moment zz of short axes", float(fabric[2, 2]), 1.0 / 3.0, "1/3 is isotropic")
    overlap = float(-gap.min() / packing.axes[free].min())
    case.below("largest overlap / least semi-axis", overlap, 1.2e-3, WHY_OVERLAP)
    surface = measure.bed_height(packing)
    case.metric("height of the bed [m]", surface, 0.0595, 0.0015, "58-61 mm; 98 % of grains below")
    share = floor_share(case, packing)
    case.below("load on the floor / weight of the grains", share, 0.7, "Janssen: about 0.4")
    case.above("load on the floor / weight of the grains, least", share, 0.1, "the floor carries")
    draw(case, height - FLOOR_HEIGHT, fraction, number[bulk])


def floor_share(case: object, packing: Packing) -> float:
    """Vertical force on the floor over the weight of the free grains, by the contacts' overlaps."""
    write_h5(case.folder / "deposit.h5", packing)
    case.run("talus-dem", "look.nml")
    grains = field_steps(case.folder / "look.h5")[0].grains
    floor = (grains["kind"] == FIXED) & (grains["x"][:, 2] < FLOOR_HEIGHT + 1.0e-6)
    volume = 4.0 / 3.0 * np.pi * grains["axes"][grains["kind"] == FREE].prod(axis=1).sum()
    return float(-grains["force"][floor, 2].sum() / (DENSITY * GRAVITY * volume))


def draw(case: object, height: np.ndarray, fraction: np.ndarray, number: np.ndarray) -> None:
    """Solid fraction by height, and how many bulk grains have how many contacts."""
    fig, (left, right) = case.figure(ncols=2, figsize=(8.6, 3.8))
    left.axvspan(0.58, 0.62, color="#e8edf2", label="asked")
    left.plot(fraction, 1.0e3 * height, "o", label="Talus")
    left.set(
        xlabel="solid fraction [-]",
        ylabel="height above the floor's centres [mm]",
        xlim=(0.54, 0.66),
    )
    left.legend(loc="lower left")
    counts = np.bincount(number)
    right.bar(np.arange(len(counts)), counts / counts.sum(), label="Talus")
    right.axvline(number.mean(), color="#c0392b", label=f"mean {number.mean():.2f}")
    right.set(xlabel="contacts of a bulk grain [-]", ylabel="share of bulk grains [-]")
    right.set_xticks(np.arange(len(counts)))
    right.legend(loc="upper left")
    case.save(fig)
