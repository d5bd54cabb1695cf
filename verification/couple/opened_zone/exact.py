"""Open a zone of a bed at rest, with and without the friction of the tile's contacts."""

import numpy as np
from tile_zone import CENTRE, judge, make_bed, zone_opened

from talus.verification import Case


def run(case: Case) -> None:
    """Make the tile, open the zone, compare with the tile laid side by side."""
    make_bed(case)
    found = zone_opened(case, "opened")
    bare = zone_opened(case, "bare", False)
    case.above("conversions", float(found["conversions"]), 5.0)
    case.above("grains that woke", float(found["woken"]), 1500.0)
    judge(case, found)
    case.above("without the tile's friction: way, of a diameter", bare["moved"], 1e-4)
    case.above("without it: kinetic energy, of the elastic", bare["kinetic"], 1e-6)
    draw(case, found, bare)


def draw(case: Case, found: dict, bare: dict) -> None:
    """Draw the elements opened and grains awake over time, the motion of both runs, the grains."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(13, 4))
    rows = found["rows"]
    ax.step(1e3 * rows["time"], rows["awake"], where="post", label="awake")
    ax.step(1e3 * rows["time"], np.cumsum(rows["freed"]), where="post", label="ghosts made free")
    ax.set(xlabel="time [ms]", ylabel="grains")
    ax.legend()
    for run_of, label in ((bare, "without friction of the tile"), (found, "with it")):
        ax2.semilogy(1e3 * run_of["time"], np.maximum(run_of["curve"], 1e-22), label=label)
    ax2.set(xlabel="time [ms]", ylabel="kinetic / elastic energy")
    ax2.legend()
    g = found["grains"]
    middle = np.abs(g["x"][:, 1] - CENTRE[1]) < 2e-3
    x = 1e3 * g["x"][middle]
    ax3.scatter(x[:, 0], x[:, 2], s=18, c=g["kind"][middle], cmap="coolwarm")
    ax3.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", title="free and ghosts at the end")
    case.save(fig)
