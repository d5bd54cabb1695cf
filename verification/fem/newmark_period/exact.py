"""One element column: a single degree of freedom with a known discrete frequency."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

YOUNG, DENSITY, LENGTH = 1.0e5, 1000.0, 1.0
# one element with consistent mass: k = E A/L, m = rho A L/3
OMEGA = np.sqrt(3.0 * YOUNG / DENSITY) / LENGTH


def run(case: Case) -> None:
    """Judge the motion of the top at two steps; plot it."""
    mesh = meshes.box(np.zeros(3), np.array([1.0, 1.0, LENGTH]), (1, 1, 1))
    meshes.write_mesh(case.folder / "column.h5", mesh)
    deck = (case.folder / "deck.nml").read_text()
    fig, ax = case.figure()
    still = -10.0 * LENGTH / YOUNG
    for dt in (0.02, 0.05):
        name = f"dt_{dt}.nml"
        (case.folder / name).write_text(deck.replace("0.02", str(dt)))
        case.run("talus-fem", name)
        steps = field_steps(case.folder / name.replace(".nml", ".h5"))
        time = np.array([s.time for s in steps])
        top = np.array([s.solid["u"][-1, 2] for s in steps])
        discrete = 2.0 / dt * np.arctan(OMEGA * dt / 2.0)
        exact = still * (1.0 - np.cos(discrete * time))
        case.below(
            f"dt = {dt}: |u - discrete solution| / static",
            float(np.abs(top - exact).max() / abs(still)),
            1e-11,
        )
        ledger = read_history(case.folder / name.replace(".nml", "_energy.csv"))
        case.below(
            f"dt = {dt}: energy closure / largest",
            float(np.abs(ledger["closure"]).max() / ledger["strain"].max()),
            1e-12,
        )
        ax.plot(time[:120], exact[:120] / still, "-", label=f"exact for dt = {dt} s")
        ax.plot(time[:120], top[:120] / still, "o", ms=3, label="Talus")
    ax.set(xlabel="time [s]", ylabel="displacement / static [-]", xlim=(0, 2))
    ax.set_ylim(top=2.8)
    ax.legend(ncols=2, loc="upper center")
    case.save(fig)
