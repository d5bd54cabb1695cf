"""Surfaces in a periodic cell: a cell of twice the length with two bars, a sphere over a corner."""

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.packing import make_packing, read_h5, write_h5
from talus.verification import Case, read_history

CELL, GRAINS, RADIUS = np.array([0.020, 0.016, 0.040]), 330, 1.0e-3
BLOCKS, ROWS = 10, 2600  # of the histories, from 8 mm beyond the start on
SAME = 0.02  # time in which round-off has not yet grown to forces [s]
START, SPEED = 0.018, 0.2  # of the bar [m], [m/s]
DENSITY, YOUNG, POISSON, GRAVITY = 2500.0, 1.0e7, 0.25, 9.81
PLATE = np.array([0.020, 0.016, 0.010])  # its middle lies in the corner of the cell
AWAY = np.array([1.5e-3, 0.5e-3, 0.0])  # of the sphere from it, over both faces


def run(case: Case) -> None:
    """Drag one bar and two bars through the same bed; put a sphere over a corner."""
    sizes = uniform_sizes(GRAINS, 0.1, np.random.default_rng(5))
    grains = cloud(sizes, CELL, np.full(3, RADIUS), seed=5, periodic=True)
    beside = (grains.x[:, 0] - START + 0.5 * CELL[0]) % CELL[0] - 0.5 * CELL[0]
    inside = np.hypot(beside, grains.x[:, 2] - 0.005) < 0.002 + 1.2 * RADIUS
    low = (grains.x[:, 2] < 1.2 * RADIUS) | (grains.x[:, 2] > CELL[2] - 1.2 * RADIUS)
    write_h5(case.folder / "cloud.h5", grains.take(~inside & ~low))
    case.run("talus-dem", "settle.nml", "--threads=1")
    bed = read_h5(case.folder / "bed.h5")
    forces = {name: drag(case, name, bed, copies) for name, copies in (("one", 1), ("two", 2))}
    time, one = forces["one"][1]
    two = forces["two"]
    early = time <= SAME
    scale = np.abs(one).max()
    for bar in (1, 2):
        off = np.abs(two[bar][1] - one)[early].max() / scale
        case.below(f"force on bar {bar} of two / largest, early", off, 1e-6, "round-off grows")
    bars = {"one": one, "bar 1": two[1][1], "bar 2": two[2][1]}
    means = {name: blocks(values) for name, values in bars.items()}
    for name in ("bar 1", "bar 2"):
        apart = means["one"].mean() - means[name].mean()
        error = np.hypot(*(means[k].std(ddof=1) / np.sqrt(BLOCKS) for k in ("one", name)))
        off = abs(apart) / error
        case.below(f"mean force of one less {name} / standard error", off, 3.0, "chaos")
    mean = means["one"].mean()
    error = means["one"].std(ddof=1) / np.sqrt(BLOCKS)
    case.above("mean force / its standard error", mean / error, 5.0)
    check_corner(case)
    draw(case, forces)


def blocks(values: np.ndarray) -> np.ndarray:
    """Means of a history over blocks of its last part, which hardly know of each other."""
    return values[-ROWS:].reshape(BLOCKS, -1).mean(axis=1)


def drag(case: Case, name: str, bed: object, copies: int) -> dict[int, tuple]:
    """Return times [s] and forces against the motion [N] of each bar in a cell of copies."""
    write_h5(case.folder / f"{name}_bed.h5", bed.repeated((copies, 1, 1)))
    text = (case.folder / "drag.nml").read_text().replace("one_bed", f"{name}_bed")
    head, bar = text.split("&cylinder")
    bar, tail = bar.split("/\n", 1)
    bars = [
        "&cylinder" + bar.replace("'bar'", f"'bar{k}'").replace("0.018", f"{START + k * CELL[0]}")
        for k in range(copies)
    ]
    (case.folder / f"{name}.nml").write_text(head + "/\n".join(bars) + "/\n" + tail)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    found = {}
    for number in range(1, copies + 1):
        mine = (rows["surface"] == number) & (rows["part"] == 1)  # it has no ends
        found[number] = (rows["time"][mine], -rows["force_x"][mine])
    return found


def check_corner(case: Case) -> None:
    """Force and moment of a sphere at rest on the image of a plate."""
    weight = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3 * GRAVITY
    modulus = YOUNG / (2.0 * (1.0 - POISSON**2))
    overlap = (3.0 * weight / (4.0 * modulus * np.sqrt(RADIUS))) ** (2.0 / 3.0)
    place = PLATE + AWAY + [0.0, 0.0, RADIUS - overlap]
    place[:2] -= CELL[:2]
    write_h5(case.folder / "sphere.h5", make_packing(place[None], np.full((1, 3), RADIUS)))
    case.run("talus-dem", "corner.nml", "--threads=1")
    rows = read_history(case.folder / "corner_surfaces.csv")
    force = np.array([rows[f"force_{c}"][-1] for c in "xyz"])
    moment = np.array([rows[f"moment_{c}"][-1] for c in "xyz"])
    exact = np.cross(AWAY, [0.0, 0.0, -weight])
    case.metric("force on the plate / weight", force[2] / weight, -1.0, 1e-9, "round-off")
    off = np.abs(moment - exact).max() / np.abs(exact).max()
    case.below("moment on the plate, error / exact", off, 1e-9, "round-off")


def draw(case: Case, forces: dict[str, dict[int, tuple]]) -> None:
    """Draw the forces against the place of the bar, and how round-off grows."""
    fig, (ax, low) = case.figure(nrows=2, figsize=(7.2, 6.4), sharex=True)
    time, one = forces["one"][1]
    way = 1e3 * SPEED * time
    ax.plot(way, one, lw=1.0, label="one bar in a cell of 20 mm")
    for bar, mark in ((1, "o"), (2, "x")):
        values = forces["two"][bar][1]
        ax.plot(way[::40], values[::40], mark, ms=3.5, label=f"bar {bar} of two in 40 mm")
        low.semilogy(way, np.abs(values - one) / np.abs(one).max(), lw=0.7)
    for face in range(3):
        ax.axvline(2.0 + 20.0 * face, color="0.6", lw=0.8, ls=":")
    ax.set(ylabel="force against the motion [N]")
    ax.legend(fontsize=8)
    low.set(xlabel="way of the bar [mm]", ylabel="difference / largest force")
    case.save(fig)
