"""Constant volume: does it stay, who moves, whose work is it?"""

import numpy as np

from talus.generate import cloud
from talus.packing import write_h5
from talus.specimens import read_specimen
from talus.verification import Case, field_steps, read_history

COUNT, BOX, SINCE, TARGET = 200, 0.020, 0.055, 100.0e3
LOOK = 1.0e-5  # s; the walls take over at the first look, ten steps of 0.6 us after SINCE at most
AXES = np.array([1.25e-3, 1.0e-3, 0.75e-3])


def run(case: Case) -> None:
    """Compress, shear, compare volumes, strains, works and stresses."""
    write_h5(case.folder / "cloud.h5", cloud(np.ones(COUNT), np.full(3, BOX), AXES, seed=2))
    case.run("talus-dem", "deck.nml", "--threads=1")
    test = read_specimen(case.folder / "deck_walls.csv")
    late = test.time > SINCE + 1.0e-9
    held = test.length[test.time > SINCE + LOOK]
    volume = held.prod(axis=1)
    before = float(np.abs(test.stress[late][0] / TARGET - 1.0).max())
    case.below(
        "stress when it begins / 100 kPa, error", before, 0.02, "servos, still a little unrest"
    )
    error = float(np.abs(volume / volume[0] - 1.0).max())
    case.below("volume, largest relative change", error, 1e-8, "between two looks")
    axial = np.log(test.length[late][0, 2] / test.length[-1, 2])
    case.metric("axial strain at the end", float(axial), shortening(test, late), 1e-3)
    strain = np.log(held / held[0])
    error = float(np.abs(strain[:, 0] - strain[:, 1]).max() / np.abs(strain[-1, 0]))
    case.below("strain of x less that of y / strain of x", error, 1e-11, "both by one factor")
    works(case, test)
    inside = love_weber(case, float(volume[-1]))
    error = float(np.abs(inside - test.stress[-1]).max() / test.stress[-1].max())
    case.below("Love-Weber less wall stress / axial stress", error, 0.01, "inertia and unrest")
    energy = read_history(case.folder / "deck_energy.csv")
    case.below("largest relative closure", float(energy["relative_closure"].max()), 1e-4)
    draw(case, test, late)


def shortening(test: object, late: np.ndarray) -> float:
    """Axial strain by the velocity of the top wall and its curve: 1 ms of ramp, then 0.04 m/s."""
    way = 0.04 * (test.time[late][-1] - SINCE - 0.0005)
    return float(-np.log(1.0 - way / test.length[late][0, 2]))


def works(case: Case, test: object) -> None:
    """Works of the six walls add up to the ledger's, and to the integral of stress and strain."""
    walls = read_history(case.folder / "deck_walls.csv")
    energy = read_history(case.folder / "deck_energy.csv")
    total = sum(walls["work"][walls["wall"] == k] for k in range(1, 7))
    error = float(np.abs(total - energy["boundary"]).max() / np.abs(total).max())
    case.below("works of the walls less boundary work of the ledger", error, 1e-12, "rounding")
    volume = test.length.prod(axis=1)
    rate = -np.diff(np.log(test.length), axis=0)
    middle = 0.5 * (test.stress[1:] * volume[1:, None] + test.stress[:-1] * volume[:-1, None])
    late = test.time[1:] > SINCE + 1.0e-9
    work = (middle * rate)[late].sum()
    done = total[-1] - total[np.searchsorted(test.time, SINCE - 1.0e-9)]
    case.metric("work by stress and strain / works of the walls", float(work / done), 1.0, 0.01)


def love_weber(case: Case, volume: float) -> np.ndarray:
    """Normal components of the mean stress from the contacts [Pa], pressure positive."""
    step = field_steps(case.folder / "deck.h5")[-1]
    contacts, x = step.contacts, step.grains["x"]
    grains = contacts["ids"][:, 0] > 0  # else a wall, where the branch begins at the contact point
    first = contacts["point"].copy()
    first[grains] = x[np.searchsorted(step.grains["id"], contacts["ids"][grains, 0])]
    branch = x[np.searchsorted(step.grains["id"], contacts["ids"][:, 1])] - first
    return (branch * contacts["force"]).sum(axis=0) / volume


def draw(case: Case, test: object, late: np.ndarray) -> None:
    """Stress-strain curve and path."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.4, 3.8))
    strain = 100.0 * (test.axial_strain[late] - test.axial_strain[late][0])
    for k, name in enumerate("xyz"):
        left.plot(strain, 1e-3 * test.stress[late][:, k], label=f"stress {name}")
    left.set(xlabel="axial strain [%]", ylabel="stress on the walls [kPa]")
    left.legend(fontsize=8)
    right.plot(1e-3 * test.pressure[late], 1e-3 * test.deviator[late])
    right.set(xlabel="mean stress p [kPa]", ylabel="q [kPa]", title="path at constant volume")
    case.save(fig)
