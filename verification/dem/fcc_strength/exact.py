"""Stress ratio at failure of a face-centred cubic array, against Rowe's and Thornton's formula."""

import re

import numpy as np

from talus.generate import lattice
from talus.packing import write_h5
from talus.verification import Case, read_history

RADIUS, CELLS = 1.0e-3, 3
FRICTIONS = (0.0, 0.1, 0.3, 0.5)
START = 0.003  # the shortening is under way [s]


def run(case: Case) -> None:
    """Shear the array with four coefficients of friction."""
    packing = lattice("fcc", (CELLS,) * 3, 2.0 * np.sqrt(2.0) * RADIUS, np.full(3, RADIUS))
    write_h5(case.folder / "fcc.h5", packing)
    low, high = packing.x.min() - RADIUS, packing.x.max() + RADIUS
    deck = (case.folder / "deck.nml").read_text()
    fig, ax = case.figure()
    for friction in FRICTIONS:
        name = f"mu{10 * friction:.0f}"
        text = deck
        for word, value in (("MU", friction), ("LOW", low), ("HIGH", high)):
            text = re.sub(rf"\b{word}\b", f"{value:.17g}", text)
        (case.folder / f"{name}.nml").write_text(text)
        case.run("talus-dem", f"{name}.nml", "--threads=1")
        time, strain, ratio, side = curves(case, name)
        late = time > START
        exact = 2.0 * (1.0 + friction) / (1.0 - friction)
        case.metric(f"peak ratio, mu = {friction}", float(ratio[late].max()), exact, 5e-3 * exact)
        error = float(abs(side[-1] / 100.0e3 - 1.0))
        case.below(f"lateral stress at the end, error, mu = {friction}", error, 1e-2)
        line = ax.plot(100.0 * strain[late], ratio[late], label=f"$\\mu$ = {friction}")
        ax.axhline(exact, color=line[0].get_color(), lw=0.8, ls="--")
    ax.set(xlabel="axial strain [%]", ylabel="axial over lateral stress [-]", ylim=(0.0, 6.5))
    ax.legend(fontsize=8)
    case.save(fig)


def curves(case: Case, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], axial strain, stress ratio and lateral stress [Pa] of a run."""
    walls = read_history(case.folder / f"{name}_walls.csv")
    servos = read_history(case.folder / f"{name}_servos.csv")
    bottom, top = walls["wall"] == 5, walls["wall"] == 6
    area = servos["area"][servos["wall"] == 6]
    axial = 0.5 * (walls["force_z"][top] - walls["force_z"][bottom]) / area
    side = 0.5 * (servos["stress"][servos["wall"] == 2] + servos["stress"][servos["wall"] == 4])
    height = walls["z"][top] - walls["z"][bottom]
    ratio = axial / np.maximum(side, 1.0)
    return walls["time"][top], 1.0 - height / height[0], ratio, side
