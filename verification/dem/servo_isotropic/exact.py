"""Isotropic compression: do servo walls hold their stress, and is it the stress inside?"""

import numpy as np

from talus.generate import cloud
from talus.packing import write_h5
from talus.verification import Case, field_steps, read_history

COUNT, BOX, TARGET = 200, 0.020, 100.0e3
AXES = np.array([1.2e-3, 1.0e-3, 0.8e-3])
WALLS = ("x0", "x1", "y0", "y1", "z0", "z1")


def run(case: Case) -> None:
    """Compress, compare wall stresses with the target and with Love and Weber's sum."""
    write_h5(case.folder / "cloud.h5", cloud(np.ones(COUNT), np.full(3, BOX), AXES, seed=1))
    case.run("talus-dem", "deck.nml", "--threads=1")
    rows = read_history(case.folder / "deck_servos.csv")
    last = rows["time"] == rows["time"][-1]
    for name, stress in zip(WALLS, rows["stress"][last], strict=True):
        case.metric(f"stress on {name} / target", float(stress / TARGET), 1.0, 1e-3)
    edges = -(rows["position"][last][0::2] + rows["position"][last][1::2])  # normals point inwards
    inside, walls = love_weber(case, float(edges.prod()))
    for k, name in enumerate("xyz"):
        value = float(inside[k, k] / TARGET)
        case.metric(f"Love-Weber {name}{name} / target", value, 1.0, 1.5e-3, "tolerance and unrest")
    error = float(np.abs(inside - walls).max() / TARGET)
    case.below("Love-Weber less the walls' tractions, all components / target", error, 1e-3)
    skew = float(np.abs(inside - inside.T).max() / TARGET)
    case.below("skew part / target", skew, 1e-3, "moments are in equilibrium")
    energy = read_history(case.folder / "deck_energy.csv")
    error = float(np.abs(energy["closure_error"]).max() / np.abs(energy["boundary"]).max())
    case.below("largest closure error / work of the walls", error, 1e-4)
    fig, ax = case.figure()
    for k, name in enumerate(WALLS):
        mine = rows["wall"] == k + 1
        ax.plot(1e3 * rows["time"][mine], 1e-3 * rows["stress"][mine], label=name)
    ax.axhline(1e-3 * TARGET, color="0.5", lw=0.8, ls="--")
    ax.set(xlabel="time [ms]", ylabel="stress on the wall [kPa]")
    ax.legend(ncols=3, fontsize=8)
    case.save(fig)


def love_weber(case: Case, volume: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean stress, pressure positive: forces times branches, and the walls' forces times points."""
    step = field_steps(case.folder / "deck.h5")[-1]
    ids, x = step.grains["id"], step.grains["x"]
    contacts = step.contacts
    grains = contacts["ids"][:, 0] > 0  # else a wall, where the branch begins at the contact point
    first = contacts["point"].copy()
    first[grains] = x[np.searchsorted(ids, contacts["ids"][grains, 0])]
    branch = x[np.searchsorted(ids, contacts["ids"][:, 1])] - first
    force = contacts["force"]  # on the second
    walls = -first[~grains].T @ force[~grains]
    return branch.T @ force / volume, walls / volume
