"""Curves of the triaxial compressions of run.sh: stress and volume over axial strain.

Usage: results.py OUT. Writes curves.png, <run>_curve.csv and prints the last values.
"""

import sys
from pathlib import Path

import numpy as np

from talus.fields import FieldFile
from talus.look import new_figure, save_figure

HEIGHT, AREA, CONFINED = 0.1, 0.05**2, 1.0e5  # of the eighth [m], [m^2], [Pa]
TETRAHEDRA = ((0, 1, 3, 4), (1, 2, 3, 6), (1, 6, 4, 5), (3, 4, 6, 7), (1, 3, 4, 6))


def volume(x: np.ndarray, hexahedra: np.ndarray) -> float:
    """Return the volume of hexahedra by their corners [m^3]."""
    total = 0.0
    for a, b, c, d in TETRAHEDRA:
        edges = [x[hexahedra[:, n]] - x[hexahedra[:, a]] for n in (b, c, d)]
        total += abs(np.einsum("ei,ei->e", np.cross(edges[0], edges[1]), edges[2])).sum() / 6
    return float(total)


def curve(out: Path, name: str) -> np.ndarray:
    """Return axial strain, deviatoric stress [Pa] (force over the mean area) and volume strain."""
    rows = []
    with FieldFile(out / f"{name}.h5") as file:
        x, cells = file.mesh
        corners = next(iter(cells.values()))[:, :8]
        start = volume(x, corners)
        top = np.isclose(x[:, 2], x[:, 2].max())
        for step in range(len(file)):
            found = file.read(step).solid
            axial = -found["u"][top, 2].mean() / HEIGHT
            ratio = volume(x + found["u"], corners) / start
            force = -found["reaction"][top, 2].sum()
            stress = force * (1 - axial) / (AREA * ratio) - CONFINED
            rows.append((axial, stress if step else 0.0, ratio - 1))
    return np.array(rows)


def main() -> int:
    """Plot both runs."""
    out = Path(sys.argv[1])
    fig, axes = new_figure(nrows=2, sharex=True)
    for name, label in (("one", "one element, smooth plates"), ("specimen", "rough plates")):
        rows = curve(out, name)
        header = "axial strain [-],deviatoric stress [Pa],volume strain [-]"
        np.savetxt(out / f"{name}_curve.csv", rows, delimiter=",", header=header, comments="")
        axes[0].plot(100 * rows[:, 0], rows[:, 1] / 1e3, label=label)
        axes[1].plot(100 * rows[:, 0], 100 * rows[:, 2], label=label)
        print(f"{name}: q {rows[-1, 1] / 1e3:.1f} kPa, volume {100 * rows[-1, 2]:.3f} %")
    axes[0].set(ylabel="deviatoric stress [kPa]")
    axes[1].set(xlabel="axial strain [%]", ylabel="volume strain [%]")
    axes[0].legend()
    save_figure(fig, out / "curves.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
