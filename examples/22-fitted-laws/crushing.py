"""Draw the bed that crushes and the law: crushing.py LAW.nml, in the folder of crushing.sh.

Writes crushing.png and crushing.txt. The law is drawn three times: with what grading and
compression tell, with its angle fitted, and with energy and angle fitted to the stress.
"""

import sys
from pathlib import Path

import numpy as np

from talus import fit_decks, histories
from talus.commands.fit import begun_by_grading
from talus.fit import Fit, judge
from talus.fit_breakage import invariants, read_breakage
from talus.fit_tests import Test, read_test
from talus.look import COLOURS, new_figure, save_figure

MEGA = 1.0e6
LEAST, FRACTAL = 0.01e-3, 2.5  # of the gradings [m], [-]
LABELS = {"told": "law: grading tells", "angle": "law: angle fitted",
          "both": "law: energy, angle fitted"}  # fmt: skip


def tell(deck: Path, test: Test) -> None:
    """Run the law with what grading and compression tell, nothing fitted."""
    material = begun_by_grading(
        fit_decks.read_material(deck), deck, test, Path("seed-1/compress_grading.csv")
    )
    none = np.empty(0)
    found = Fit([], none, none, np.empty((0, 0)), 0.0, 0, 0)
    misfit = judge(material, found, [test], Path("told"))["bed-1"]
    print(f"with what the grading tells: misfit {100.0 * misfit:.1f} %")


def breakage_of(seed: int, test: Test) -> np.ndarray:
    """Return the breakage of the grains at the rows of a test [-]."""
    grading = Path(f"seed-{seed}/compress_grading.csv")
    times, breakage, _, _ = read_breakage(grading, LEAST, FRACTAL)
    return np.interp(test.time, times, breakage)


def main() -> None:
    """Draw stress over closure, compression, and breakage over stress."""
    bed = read_test(Path("seed-1/bed-1.csv"), {})
    other = read_test(Path("seed-2/bed-2.csv"), {})
    tell(Path(sys.argv[1]), bed)
    fig, axes = new_figure(ncols=3, figsize=(13.5, 4.4))
    for seed, test, shade in ((1, bed, "black"), (2, other, "0.65")):
        p, _, volume = invariants(test)
        label = f"grains, seed {seed}" + (", left out" if seed == 2 else "")
        look = {"color": shade, "lw": 0.9, "label": label, "zorder": 1.0 - 0.1 * seed}
        axes[0].plot(100.0 * volume, -test.stress[:, 2] / MEGA, **look)
        axes[1].plot(p / MEGA, 100.0 * volume, **look)
        axes[2].plot(p / MEGA, breakage_of(seed, test), **look)
    lines = []
    for k, (name, label) in enumerate(LABELS.items()):
        law, path = histories.read(Path(name) / "bed-1_point.csv"), bed
        p, _, volume = invariants(read_test(Path(name) / "bed-1_point.csv", {}))
        look = {"color": COLOURS[k], "lw": 1.8, "label": label}
        axes[0].plot(100.0 * volume, -law["stress zz"] / MEGA, **look)
        axes[1].plot(p / MEGA, 100.0 * volume, **look)
        axes[2].plot(p / MEGA, law["breakage"], **look)
        lines.append(f"{label}: breakage at the end {law['breakage'][-1]:.3f}, grains "
                     f"{breakage_of(1, path)[-1]:.3f}; p {p[-20:].mean() / MEGA:.2f} MPa, grains "
                     f"{invariants(path)[0][-20:].mean() / MEGA:.2f}")  # fmt: skip
    axes[0].set(xlabel="loss of volume [%]", ylabel="axial stress [MPa]")
    axes[1].set(xlabel="mean stress p [MPa]", ylabel="loss of volume [%]", xscale="log")
    axes[1].invert_yaxis()
    axes[2].set(xlabel="mean stress p [MPa]", ylabel="breakage B [-]")
    axes[0].legend(fontsize=8, loc="lower right")
    save_figure(fig, Path("crushing.png"))
    Path("crushing.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


main()
