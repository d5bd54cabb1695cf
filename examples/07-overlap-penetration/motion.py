"""How far grains beside the free zone move: all grains, overlap, and what the tool displaces.

Usage: motion.py OUT [RUN]. RUN is chord (default) or plastic. Reads the field files of truth and
RUN, and shear_walls.csv; writes motion.png and motion.csv and prints the table. The rule is that
the displaced volume leaves through the sides of the free zone: V/A at the middle of the ghosts.
"""

import sys
from pathlib import Path

import numpy as np
from prepare import FREE_EDGE, NEAR_EDGE, RADIUS, SIDES, STROKE, displaced

from talus.look import COLOURS, new_figure, save_figure
from talus.secant import secant_at
from talus.specimens import read_specimen
from talus.verification import field_steps

LOW = 0.020  # from this height on grains are taken [m]
SAME = 1.0e8  # places agree to 10 nm [1/m]


def places(path: Path) -> list[np.ndarray]:
    """Places of the grains, one array a step."""
    return [step.grains["x"] for step in field_steps(path)]


def outward(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Part of motions along the nearest face of the free zone, outwards [m]."""
    along = np.where(np.abs(x[:, 0]) > np.abs(x[:, 1]), 0, 1)
    row = np.arange(len(x))
    return np.sign(x[row, along]) * u[row, along]


def beside(whole: list[np.ndarray], part: list[np.ndarray]) -> np.ndarray:
    """Median way outwards of all grains and of ghosts that stood in the same places (steps, 2)."""
    row_of = {tuple(key): k for k, key in enumerate(np.round(SAME * whole[0]).astype(int))}
    rows = np.array([row_of.get(tuple(key), -1) for key in np.round(SAME * part[0]).astype(int)])
    x = part[0]
    wide = np.abs(x[:, :2]).max(axis=1)
    chosen = (rows >= 0) & (wide > FREE_EDGE) & (wide < NEAR_EDGE) & (x[:, 2] > LOW)
    x, rows = x[chosen], rows[chosen]
    return np.array([[np.median(outward(x, a[rows] - whole[0][rows])),
                      np.median(outward(x, b[chosen] - x))]
                     for a, b in zip(whole, part, strict=True)])  # fmt: skip


def main() -> int:
    """Compare a run with all grains."""
    out, run = Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "chord"
    ways = beside(places(out / "truth.h5"), places(out / run / "grains.h5"))
    depth = np.linspace(0.0, STROKE, len(ways))
    rule = displaced(depth) / SIDES
    test = read_specimen(out / "shear_walls.csv", "x")
    lines = ["depth [mm],all grains [um],overlap [um],V/A [um],strain [%],secant [MPa],of strength"]
    for d, (whole, part), way in zip(depth[1:], ways[1:], rule[1:], strict=True):
        found = secant_at(test, way / RADIUS)
        lines.append(f"{1e3 * d:g},{1e6 * whole:.1f},{1e6 * part:.1f},{1e6 * way:.1f},"
                     f"{100.0 * found.strain:.3f},{1e-6 * found.young_Pa:.2f},"
                     f"{found.of_strength:.3f}")  # fmt: skip
    (out / "motion.csv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    fig, ax = new_figure(figsize=(6.4, 4.2))
    fine = np.linspace(0.0, STROKE, 101)
    ax.plot(
        1e3 * fine, 1e6 * displaced(fine) / SIDES, "k-", lw=1.0, label="displaced volume / area"
    )
    ax.plot(1e3 * depth, 1e6 * ways[:, 0], "o", color=COLOURS[0], label="all grains")
    ax.plot(1e3 * depth, 1e6 * ways[:, 1], "s", color=COLOURS[1], label=f"overlap, {run}")
    ax.set(xlabel="penetration depth [mm]", ylabel="way outwards beside the free zone [µm]")
    ax.legend(fontsize=8)
    save_figure(fig, out / "motion.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
