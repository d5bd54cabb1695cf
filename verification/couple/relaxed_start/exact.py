"""A coupled run that begins in balance: what happens before, at and after the start."""

import re

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.mesh import read_mesh
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, SQUEEZE, RATIO, EXCHANGES = 5.0e-3, 2.0e-5, 5.0, 20
ACROSS = 0.02  # half-axes of the flat ghost in the plane [m]


def run(case: Case) -> None:
    """Measure the facet's stiffness, relax and press, compare with springs in series."""
    write_box(case.folder / "block.h5", [-0.03, -0.03, -0.02], [0.03, 0.03, 0.0], (3, 3, 2))
    case.run("talus-fem", "probe.nml")
    with_load = field_steps(case.folder / "probe.h5")[-1].solid["u"][:, 2]
    x_block = read_mesh(case.folder / "block.h5").x
    top = (np.abs(x_block[:, :2]) < 0.011).all(axis=1) & (x_block[:, 2] > -1e-9)
    facet = -1.0 / np.mean(with_load[top])
    series = RATIO * facet
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS - SQUEEZE / 2]])
    axes = np.array([[ACROSS, ACROSS, RADIUS], [RADIUS] * 3])
    write_packing(
        case.folder / "pack.h5", x, axes, kind=np.array([1, 0]), groups={"ghosts": np.array([1])}
    )
    mass = 2650.0 * 4 / 3 * np.pi * RADIUS**3
    exchange = 500.0 * 0.3 * np.sqrt(mass / series)  # the sphere comes to rest in each
    pressed = 0.5 * SQUEEZE
    values = {
        "exchange": exchange,
        "end": EXCHANGES * exchange,
        "stiffness": 2 * series,
        "lid": 3 * RADIUS - SQUEEZE,
        "speed": -pressed / (EXCHANGES * exchange),
    }
    write_deck(case, "grains_at_work.nml", "grains.nml", **values)
    (case.folder / "solid_deck.nml").write_text((case.folder / "solid.nml").read_text())
    write_deck(case, "solid.nml", "solid_deck.nml", **values)
    case.run("talus-couple", write_deck(case, "relaxed.nml", "coupled.nml", **values))
    share = series / (facet + series)
    log = (case.folder / "relaxed.log").read_text()
    before = float(re.search(r"moved meanwhile +(\S+) m", log)[1])
    case.metric("displacement before the start / exact", before / (SQUEEZE * share), 1.0, 1e-3)
    balance = float(re.search(r"balance +(\S+) m", log)[1])
    case.below("motion of the solid in the balance / displacement", balance / before, 1e-7)
    audit = audit_of(case, "relaxed")
    force = audit["mean_ghost_force"]
    moved = audit["largest_ghost_displacement"]
    step = np.arange(1, EXCHANGES + 1) / EXCHANGES
    start = SQUEEZE * share * facet
    # the solid carries the mean force of an exchange, in which the ghost comes from where it was:
    # K u_n = k ((n - 1/2) D - (u_n-1 + u_n)/2), D the lid's way in an exchange
    exact, u, way = np.zeros(EXCHANGES), 0.0, pressed / EXCHANGES
    for n in range(EXCHANGES):
        u = series * ((n + 0.5) * way - 0.5 * u) / (facet + 0.5 * series)
        exact[n] = u
    off = np.abs(force - start - facet * exact) / (facet * pressed * share)
    case.below("force from the start off the exact one", off.max(), 5e-3, "of the last")
    off = np.abs(moved - exact) / (pressed * share)
    case.below("displacement from the start off the exact one", off.max(), 5e-3, "of the last")
    first = field_steps(case.folder / "solid.h5")[0].solid
    case.below("displacement in the first field / before", np.abs(first["u"]).max() / before, 1e-7)
    sigma = first["stress"][:, 2].mean() * 0.06 * 0.06 / -start
    case.metric("mean stress x area / force at the start", sigma, 1.0, 0.05, "mean over elements")
    reaction = read_history(case.folder / "grains_at_work_energy.csv")
    case.below("ledger of the grains", np.abs(reaction["relative_closure"]).max(), 1e-3)
    solid = read_history(case.folder / "solid_energy.csv")
    most = max(np.abs(solid[k]).max() for k in ("strain", "load", "spring"))
    case.below("ledger of the solid", np.abs(solid["closure"]).max() / most, 1e-9)
    works = audit["interface_work_on_grains"] + audit["interface_work_on_solid"]
    turnover = np.abs(audit["interface_work_on_grains"]).max()
    case.below("works at the interface", np.abs(works).max() / turnover, 1e-5)
    fig, ax = case.figure()
    ax.plot(step, 1e6 * exact, label="exact")
    ax.plot(step, 1e6 * moved, "o", label="Talus")
    ax.set(xlabel="time / end [-]", ylabel="displacement from the start [µm]")
    ax.legend()
    case.save(fig)
