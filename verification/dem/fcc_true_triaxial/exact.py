"""Strength of a face-centred cubic array in true triaxial compression, for places b of sigma_2."""

import fcc_array
import numpy as np

from talus.verification import Case, read_history

PLACES = (0.0, 0.1, 0.3, 0.6)  # b
FRICTION = 0.2
RATE, STRAIN = -0.2, 0.0008  # [1/s], [-]
STRESS = 100.0e3  # [Pa]


def strength(friction: float, b: float) -> float:
    """Axial over lateral stress at failure [-]: rows along y open, or closed as in plane strain."""
    c = 1.0 + friction**2
    # 4 + 4 s^2 + 2 K^2 = c (1 + s + K)^2 with s = (1 - b) + b K
    one, two = 1.0 - b, 1.0 + b
    square = 4.0 * b**2 + 2.0 - c * two**2
    linear = 8.0 * one * b - 2.0 * c * (1.0 + one) * two
    rest = 4.0 + 4.0 * one**2 - c * (1.0 + one) ** 2
    roots = np.roots([square, linear, rest])
    opened = max(np.real(roots[np.abs(np.imag(roots)) < 1e-9]), default=np.inf)
    root3, slide = np.sqrt(3.0), np.sqrt(2.0) * friction
    closed = 2.0 * (root3 + slide) / (root3 - 2.0 * slide)
    side = 0.5 / (0.5 - friction * np.sqrt(2.0 / 3.0))  # sigma_y/sigma_x of inclined contacts alone
    return closed if 1.0 - b + b * closed >= side else float(opened)


def run(case: Case) -> None:
    """Shorten the array at four places of the middle stress."""
    size = fcc_array.write_array(case)
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.0, 4.0))
    peaks = []
    for place in PLACES:
        words = {"MU": f"{FRICTION}", "SIZE": size, "RATE": f"{RATE}", "PLACE": f"{place}",
                 "T_END": f"{-STRAIN / RATE}"}  # fmt: skip
        name = f"b{100.0 * place:.0f}"
        fcc_array.write_deck(case, name, words)
        case.run("talus-dem", f"{name}.nml", "--threads=1")
        rows = read_history(case.folder / f"{name}_cell.csv")
        ratio = rows["stress_zz"] / np.minimum(rows["stress_xx"], -1.0)
        strain, exact = 1.0 - rows["deform_zz"], strength(FRICTION, place)
        late = strain > 0.3 * STRAIN
        peak = np.flatnonzero(late)[ratio[late].argmax()]
        peaks.append(float(ratio[peak]))
        case.metric(f"peak ratio, b = {place}", peaks[-1], exact, 3e-3 * exact)
        from_b = (1.0 - place) * rows["stress_xx"] + place * rows["stress_zz"]
        error = float(np.abs((rows["stress_yy"] - from_b)[peak:] / STRESS).max())
        case.below(f"middle stress from the peak on, error, b = {place}", error, 2e-2)
        error = float(np.abs(rows["stress_xx"][peak:] / STRESS + 1.0).max())
        case.below(f"lateral stress from the peak on, error, b = {place}", error, 1e-2)
        energy = read_history(case.folder / f"{name}_energy.csv")
        case.below(f"ledger, b = {place}", float(energy["relative_closure"][-1]), 1e-4)
        dash = "--" if place == PLACES[-1] else "-"
        ax.plot(100.0 * strain[late], ratio[late], dash, label=f"b = {place}")
    ax.set(xlabel="axial strain [%]", ylabel="axial over lateral stress [-]", ylim=(2.9, 3.6))
    ax.legend(fontsize=8)
    fine = np.linspace(0.0, 1.0, 201)
    ax2.plot(fine, [strength(FRICTION, b) for b in fine], color="0.5", label="exact")
    ax2.plot(PLACES, peaks, "o", label="measured")
    ax2.set(xlabel="b", ylabel="axial over lateral stress at failure [-]", ylim=(2.0, 4.0))
    ax2.legend(fontsize=8)
    case.save(fig)
