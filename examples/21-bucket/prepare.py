"""Decks, beds and tools. Usage: prepare.py test, then prepare.py beds; in the folder of the run."""

import sys
from pathlib import Path

import numpy as np
from tools import (
    BEGIN, COPIES, DEPTHS, DIG, END, LENGTH, LIP_SPEED, MIDDLE, PLACES, RADIUS, RAKE, SPEED, WAY, WIDTH,
    turned, write_bucket,
)  # fmt: skip

from talus.packing import Packing, read_packing, write_h5

SHORTEN, RATE, GRAIN = 0.25, 0.2, 2.0e-3  # strain and rate of the test [1/s]; radius of a grain [m]


def text(name: str, **values: object) -> str:
    """Return the text of a deck of the example with its values."""
    found = (Path(__file__).parent / f"{name}.nml").read_text()
    for key, value in values.items():
        found = found.replace(f"@{key}@", value if isinstance(value, str) else f"{value:.9g}")
    return found


def prepare_test() -> None:
    """Write the deck of the element test."""
    time = SHORTEN / RATE
    Path("test.nml").write_text(text("test", t_end=time, shorten=-RATE, most=5.0 * RATE,
                                     every=time / 500))  # fmt: skip


def write(name: str, bed: Packing, end: float, title: str, tool: str) -> None:
    """Write a bed and its deck."""
    write_h5(Path(f"{name}_bed.h5"), bed)
    head = f"&run title = '{title}', t_end = {end:.6g}, gravity = 0.0, 0.0, -9.81 /\n"
    Path(f"{name}.nml").write_text(
        head + text("laws", packing=f"{name}_bed", frame=end / 30.0) + tool
    )


def numbers(values: np.ndarray) -> str:
    """Return numbers as a deck has them."""
    return ", ".join(f"{value:.9g}" for value in np.ravel(values))


def without(bed: Packing, corners: np.ndarray, across: np.ndarray) -> Packing:
    """Return the bed without grains that the blade (three corners, unit normal) would cut."""
    away = bed.x - corners[0]
    side, up = corners[1] - corners[0], corners[2] - corners[1]
    s, u = (away @ v / (v @ v) for v in (side, up))
    reach = 1.3 * GRAIN
    beside, above = reach / np.linalg.norm(side), reach / np.linalg.norm(up)
    hit = np.abs(away @ across) < reach
    hit &= (s > -beside) & (s < 1.0 + beside) & (u > -above) & (u < 1.0 + above)
    return bed.take(np.flatnonzero(~hit))


def prepare_blade(place: str, depth: float, bed: Packing, top: float) -> None:
    """Write a blade that stands in the bed at its depth and is pushed along x."""
    tip = np.array([0.06, MIDDLE[1] - 0.5 * WIDTH, top - depth])
    tip[:2] += PLACES[place]
    up = LENGTH * np.array([-np.cos(RAKE), 0.0, np.sin(RAKE)])
    corners = np.array([tip, tip + [0.0, WIDTH, 0.0], tip + [0.0, WIDTH, 0.0] + up])
    across = np.array([np.sin(RAKE), 0.0, np.cos(RAKE)])
    tool = (f"&curve id = 'go', times = 0.0, 0.02, 9.0, values = 0.0, 1.0, 1.0 /\n"
            f"&surface id = 'tool', material = 'steel', velocity = {SPEED}, 0.0, 0.0, curve = 'go',\n"
            f"         rectangle = {numbers(corners)} /\n")  # fmt: skip
    write(f"blade_{round(1e3 * depth)}_{place}", without(bed, corners, across),
          WAY / SPEED + 0.01, "A blade in a bed", tool)  # fmt: skip


def prepare_bucket(place: str, bed: Packing, top: float) -> None:
    """Write a bucket that swings about a pivot above the bed."""
    pivot = np.array([*MIDDLE, top + RADIUS - DIG])
    pivot[0] -= 0.02
    pivot[:2] += PLACES[place]
    name, rate = f"bucket_{place}", LIP_SPEED / RADIUS
    write_bucket(Path(f"{name}.stl"), BEGIN)
    lowest = turned(BEGIN)[:, 1].min() + pivot[2]
    if lowest < bed.x[:, 2].max() + 1.3 * GRAIN:
        raise SystemExit(f"the bucket begins in the bed: {lowest:.4f} m")
    tool = (f"&surface id = 'tool', material = 'steel', spin = 0.0, {-rate:.9g}, 0.0, file = '{name}.stl',\n"
            f"         shift = {numbers(pivot)}, centre = {numbers(pivot)} /\n")  # fmt: skip
    write(name, bed, (END - BEGIN) / rate, "A bucket on an arc", tool)


def prepare_beds() -> None:
    """Write all beds."""
    bed = read_packing(Path("column.h5")).repeated(COPIES)
    top = float(np.quantile(bed.x[:, 2], 0.99))
    Path("top").write_text(f"{top:.9g}\n")
    for place in PLACES:
        for depth in DEPTHS:
            prepare_blade(place, depth, bed, top)
        prepare_bucket(place, bed, top)


if __name__ == "__main__":
    {"test": prepare_test, "beds": prepare_beds}[sys.argv[1]]()
