"""Stress ratio of a face-centred cubic array at failure in plane strain: Thornton's formula."""

import fcc_array
import numpy as np

from talus.verification import Case, read_history

FRICTIONS = (0.0, 0.1, 0.2, 0.3)
RATE, STRAIN = -0.2, 0.0008  # [1/s], [-]
STRESS = 100.0e3  # [Pa]


def strength(friction: float) -> float:
    """Axial over lateral stress at failure [-]."""
    root3, slide = np.sqrt(3.0), np.sqrt(2.0) * friction
    return 2.0 * (root3 + slide) / (root3 - 2.0 * slide)


def run(case: Case) -> None:
    """Shorten the array with four coefficients of friction."""
    size = fcc_array.write_array(case)
    fig, ax = case.figure()
    for friction in FRICTIONS:
        name = f"mu{10.0 * friction:.0f}"
        words = {"MU": f"{friction}", "SIZE": size, "RATE": f"{RATE}", "T_END": f"{-STRAIN / RATE}"}
        fcc_array.write_deck(case, name, words)
        case.run("talus-dem", f"{name}.nml", "--threads=1")
        rows = read_history(case.folder / f"{name}_cell.csv")
        ratio = rows["stress_zz"] / np.minimum(rows["stress_xx"], -1.0)
        strain, exact = 1.0 - rows["deform_zz"], strength(friction)
        late = strain > 0.3 * STRAIN
        peak = np.flatnonzero(late)[ratio[late].argmax()]
        case.metric(f"peak ratio, mu = {friction}", float(ratio[peak]), exact, 3e-3 * exact)
        error = float(np.abs(rows["stress_xx"][peak:] / STRESS + 1.0).max())
        case.below(f"lateral stress from the peak on, error, mu = {friction}", error, 1e-2)
        energy = read_history(case.folder / f"{name}_energy.csv")
        closure = float(energy["relative_closure"][-1])
        case.below(f"ledger, mu = {friction}", closure, 1e-4)
        curve = ax.plot(100.0 * strain[late], ratio[late], label=f"$\\mu$ = {friction}")
        ax.axhline(exact, color=curve[0].get_color(), lw=0.8, ls="--")
    ax.set(xlabel="axial strain [%]", ylabel="axial over lateral stress [-]", ylim=(0.0, 5.5))
    ax.legend(fontsize=8)
    case.save(fig)
