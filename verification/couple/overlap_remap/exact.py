"""A pulse through an overlap that is remapped all the time; a grain that is shot out of it."""

import re

import h5py
import numpy as np
from coupled import audit_of, compare_runs, write_deck
from overlap_bars import ACROSS, CUT_OFF, DENSITY, SIDE, SPEED, A, Bar, deck_values

from talus.checksum import edited
from talus.verification import Case, field_steps

BAR = Bar(grains=140, free=4, ghosts=1, rest=24)
CENTRE, WIDTH, PEAK = -24 * A, 8 * A, 2.0e-3 * SPEED
STEP = 0.5 * 2 / CUT_OFF
STEPS = 128  # of the grains: 64 layers
OFTEN = 2.0e-7  # of an element
SHOT = 12.0  # velocity of the grain [m/s]


def pulse(z: np.ndarray) -> np.ndarray:
    """Velocity at the start; half of it runs each way."""
    return PEAK * np.exp(-(((z - CENTRE) / WIDTH) ** 2))


def couple(case: Case, name: str, *more: str, **places: object) -> dict[str, np.ndarray]:
    """Run a deck under a name; return its audit."""
    chosen = {"mass": "projected", "remap": 0, "leaving": "remap", "damping": 0.0, "name": name}
    values = deck_values(STEP, 1, STEPS, half=f"{STEPS // 2 * STEP:.17g}", **chosen) | places
    values["output"] = f"{8 * STEP:.17g}"
    for side in ("grains", "solid"):
        write_deck(case, f"{name}_{side}.nml", f"bar_{side}.nml", **values)
    case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml", **values), *more)
    return audit_of(case, name)


def remaps(case: Case, name: str) -> list[str]:
    """Lines of the log that tell of remaps."""
    return re.findall(r"time .*remap \d+: .*", (case.folder / f"{name}.log").read_text())


def velocities(case: Case, name: str) -> np.ndarray:
    """Velocities of all grains and nodes at the end."""
    grains = field_steps(case.folder / f"{name}_grains.h5")[-1].grains["v"]
    return np.concatenate([grains, field_steps(case.folder / f"{name}_solid.h5")[-1].solid["v"]])


def node_velocities(case: Case, name: str) -> float:
    """Largest error of the fields' velocities of nodes that grains and coupling move, over peak.

    Taken when the middle of the pulse is under the ghosts.
    """
    with h5py.File(case.folder / f"{name}_solid.h5") as file:
        z = file["mesh/x"][:, 2] - BAR.start
    step = min(
        field_steps(case.folder / f"{name}_solid.h5"),
        key=lambda s: abs(s.time - (18 * A - CENTRE) / SPEED),
    )
    moved = z < BAR.h * (BAR.free + BAR.ghosts) + 0.1 * A
    exact = 0.5 * pulse(z - SPEED * step.time)
    return float(np.abs(step.solid["v"][:, 2] - exact)[moved].max() / (0.5 * PEAK))


def judge_pulse(case: Case, mass: str, damping: float, ax: object) -> None:
    """Compare a run that is remapped often with one that never is."""
    area = (ACROSS * SIDE) ** 2
    energy = 0.5 * DENSITY * area * PEAK**2 * WIDTH * np.sqrt(np.pi / 2)
    momentum = DENSITY * area * PEAK * WIDTH * np.sqrt(np.pi)
    couple(case, "never", mass=mass, damping=damping)
    audit = couple(case, "often", mass=mass, damping=damping, remap=OFTEN)
    case.above(f"{mass}: remaps", len(remaps(case, "often")), 10, "all the time")
    case.below(f"{mass}: remaps of the other run", len(remaps(case, "never")), 0)
    apart = np.abs(velocities(case, "often") - velocities(case, "never")).max() / PEAK
    case.below(f"{mass}: velocities apart", apart, 2e-4, "motion over length of an element")
    case.below(
        f"{mass}: velocities of moved nodes", node_velocities(case, "never"), 0.1,
        "dispersion, and half a step of the grains",
    )  # fmt: skip
    drift = np.abs(audit["momentum_z"] - audit["momentum_z"][0]).max() / momentum
    limit = 1e-10 if mass == "projected" else 1e-6
    case.below(f"{mass}: momentum", drift, limit, "carried mass takes up the velocity of the map")
    total = (audit["total_energy"] - audit["total_energy"][0]) / energy
    case.below(f"{mass}: energy", np.ptp(total), 2e-3, "bounded")
    works = audit["interface_work_given"] - audit["interface_work_taken"]
    case.below(f"{mass}: works of both sides", np.abs(works).max() / energy, 1e-10)
    ax.plot(1e3 * audit["time"], 100 * total, label=f"pulse, mass = '{mass}'")


def judge_shot(case: Case, ax: object) -> None:
    """Shoot one grain out sideways."""
    layer = BAR.grains + 6  # in the second element
    with edited(case.folder / "pack.h5") as file:
        row = int(np.flatnonzero(file["grains/id"][...] == 1 + layer * ACROSS**2)[0])
        file["grains/v"][...] = 0.0
        file["grains/v"][row, 0] = -SHOT
    audit = couple(case, "shot")
    said = [line for line in remaps(case, "shot") if f"(ids {1 + layer * ACROSS**2})" in line
            or f"({1 + layer * ACROSS**2})" in line]  # fmt: skip
    case.metric("lines that name the grain", len(said), 1, 0)
    left = float(said[0].split()[1]) if said else 0.0
    steps = [s for s in field_steps(case.folder / "shot_grains.h5") if s.time > left + 2 * STEP]
    v = np.array([s.grains["v"][row] for s in steps])
    case.below("velocity of the grain after it left", np.ptp(v, axis=0).max() / SHOT, 1e-12)
    x = np.array([s.grains["x"][row, 0] for s in field_steps(case.folder / "shot_grains.h5")])
    moves = np.column_stack([audit[f"momentum_{c}"] for c in "xyz"])
    whole = np.abs(moves[0]).max()
    case.below("momentum along", np.ptp(moves[:, 2]) / whole, 1e-9)
    case.below("works of both sides", np.abs(
        audit["interface_work_given"] - audit["interface_work_taken"]).max()
        / audit["grains_kinetic"][0], 1e-10)  # fmt: skip
    times = [s.time for s in field_steps(case.folder / "shot_grains.h5")]
    ax.plot(1e3 * np.array(times), x, ".-", label="the grain")
    ax.axhline(-SIDE, color="0.6", label="side of the mesh at the start")
    ax.axvline(1e3 * left, ls="--", color="0.6", label="it has left")


def run(case: Case) -> None:
    """Judge pulses, the shot, and a restart after remaps."""
    BAR.write(case.folder, pulse)
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    judge_pulse(case, "projected", 0.0, left)
    judge_pulse(case, "consistent", 0.05 * CUT_OFF, left)
    more = {"mass": "consistent", "damping": 0.05 * CUT_OFF, "remap": OFTEN}
    couple(case, "whole", **more)
    end = f"{STEPS // 2 * STEP:.17g}"
    couple(case, "parts", end=end, **more)
    couple(case, "parts", "--restart=auto", **more)
    compare_runs(case, "restart after remaps, ", "whole", "parts")
    judge_shot(case, right)
    left.set(xlabel="time [ms]", ylabel="change of energy / energy [%]")
    right.set(xlabel="time [ms]", ylabel="place across the bar [m]")
    left.legend()
    right.legend(fontsize=7)
    case.save(fig)
