"""Free modes of a cube by hex20 and hex8."""

import numpy as np
from solid import save, shape_of

from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

WANTED = np.array(
    [1462.71993526] * 2 + [1969.7084342] * 3 + [2003.14108957] * 3 + [2275.41530119] * 3
    + [2341.94254795] * 3
)  # fmt: skip


def frequencies(case: Case, element: str, n: int) -> np.ndarray:
    """Frequencies [Hz] of the 20 lowest modes."""
    mesh = converted(box(np.zeros(3), np.ones(3), (n, n, n)), shape_of(element))
    save(mesh, case.folder / "cube.h5")
    name = f"{element}_{n}"
    text = (case.folder / "deck.nml").read_text().replace("ELEMENT", element)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    table = read_history(case.folder / f"{name}_modes.csv")
    case.below(
        f"{name}: largest residual of the elastic modes", float(table["residual"][6:].max()), 1e-4
    )
    return table["frequency"]


def run(case: Case) -> None:
    """Judge frequencies, bounds, order and the shapes that are written."""
    fine = frequencies(case, "hex20", 6)
    case.below("hex20: rigid frequencies / lowest elastic", float(fine[5] / WANTED[0]), 1e-3)
    case.below("hex20: largest error", float(abs(fine[6:] / WANTED - 1).max()), 2e-3)
    case.above(
        "hex20: least of found / exact", float((fine[6:] / WANTED).min()), 1 - 1e-6, "upper bounds"
    )
    steps = field_steps(case.folder / "hex20_6.h5")
    case.metric("modes in the field file", len(steps), 20, 0)
    sizes = (4, 8)
    coarse = [frequencies(case, "hex8_full", n)[6:] for n in sizes]
    errors = [float(abs(f / WANTED - 1).mean()) for f in coarse]
    case.metric("hex8_full: observed order", float(np.log2(errors[0] / errors[1])), 2.0, 0.2)
    fig, ax = case.figure()
    place = np.arange(7, 21)
    ax.plot(place, WANTED, "k_", ms=14, label="Rayleigh-Ritz")
    ax.plot(place, fine[6:], "o", ms=5, label="hex20, 6 x 6 x 6")
    ax.plot(place, coarse[1], "s", ms=4, mfc="none", label="hex8, 8 x 8 x 8")
    ax.set(xlabel="mode [-]", ylabel="frequency [Hz]")
    ax.legend()
    case.save(fig)
