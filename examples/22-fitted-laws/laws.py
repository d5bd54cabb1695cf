"""Draw grains and fitted laws on all paths, print the misfits: laws.py, in the folder of run.sh.

Writes laws.png and result.txt.
"""

import json
from pathlib import Path

import numpy as np

from talus.fit_breakage import invariants
from talus.fit_tests import Test, read_test
from talus.look import COLOURS, new_figure, save_figure

LAWS = {"sanisand": "sanisand", "drucker": "Drucker-Prager", "clay": "Cam-clay"}
PATHS = {
    "dense-drained": "dense, drained", "dense-volume": "dense, constant volume",
    "loose-drained": "loose, drained", "loose-volume": "loose, constant volume",
    "dense-isotropic": "dense, isotropic", "loose-isotropic": "loose, isotropic",
    "dense-extension": "dense, extension", "dense-pressure": "dense, drained, 300 kPa",
}  # fmt: skip
LEFT_OUT = ("dense-extension", "dense-pressure")
COLUMNS, ROOM = 4, 1.5  # panels in a row; of the grains' stress, above which laws are cut


def fit_of(law: str, path: str) -> str:
    """Return the name of the fit of a law that a path belongs to."""
    return law if law == "sanisand" else f"{law}-{path.split('-')[0]}"


def strain_of(test: Test, path: str) -> np.ndarray:
    """Return axial shortening, of isotropic paths the loss of volume [%]."""
    isotropic = path.endswith("isotropic")
    return -100.0 * (test.strain[:, :3].sum(axis=1) if isotropic else test.strain[:, 2])


def draw(path: str, shear: object, mean: object) -> None:
    """Draw q and p of the grains and of the laws along a path."""
    grains = read_test(Path(f"{path}/{path}_cell.csv"), {})
    for k, (law, label) in enumerate(LAWS.items()):
        table = Path(fit_of(law, path)) / f"{path}_cell_point.csv"
        if not table.exists():
            continue
        test = read_test(table, {})
        p, q, _ = invariants(test)
        look = {"color": COLOURS[k], "lw": 1.5, "label": label}
        shear.plot(strain_of(grains, path), q / 1e3, **look)
        mean.plot(strain_of(grains, path), p / 1e3, **look)
    p, q, _ = invariants(grains)
    for ax, values in ((shear, q), (mean, p)):
        ax.plot(strain_of(grains, path), values / 1e3, "ko", ms=2.5, zorder=5, label="grains")
        ax.set_ylim(0.0, ROOM * values.max() / 1e3)
    left_out = path in LEFT_OUT
    shear.set_title(PATHS[path] + (": LEFT OUT" if left_out else ""), fontsize=10,
                    color=COLOURS[1] if left_out else "black")  # fmt: skip
    what = "loss of volume" if path.endswith("isotropic") else "axial shortening"
    mean.set_xlabel(f"{what} [%]")


def table() -> list[str]:
    """Return the misfit of each law on each path."""
    head = "rms misfit over rms stress [%]"
    lines = [f"{head:32s}" + "".join(f"{label:>16s}" for label in LAWS.values())]
    for path, title in PATHS.items():
        cells = []
        for law in LAWS:
            found = json.loads(Path(f"{fit_of(law, path)}.json").read_text())
            value = (found["misfit"] | found["misfit_left_out"])[f"{path}_cell"]
            cells.append("fails" if value is None else f"{100.0 * value:.1f}")
        title += ", left out" if path in LEFT_OUT else ""
        lines.append(f"{title:32s}" + "".join(f"{cell:>16s}" for cell in cells))
    return lines


def main() -> None:
    """Write the figure and the table."""
    fig, axes = new_figure(nrows=4, ncols=COLUMNS, figsize=(13.0, 11.5))
    for k, path in enumerate(PATHS):
        row, column = 2 * (k // COLUMNS), k % COLUMNS
        draw(path, axes[row, column], axes[row + 1, column])
    for row in range(4):
        axes[row, 0].set_ylabel("q [kPa]" if row % 2 == 0 else "p [kPa]")
    axes[0, 0].legend(fontsize=8)
    save_figure(fig, Path("laws.png"))
    lines = table()
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


main()
