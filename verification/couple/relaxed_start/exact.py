"""A coupled run that begins in balance: what happens before, at and after the start."""

import re

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.compare import max_of
from talus.mesh import read_mesh
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, SQUEEZE, RATIO, EXCHANGES = 5.0e-3, 2.0e-5, 5.0, 20
ACROSS = 0.02  # half-axes of the flat ghost in the plane [m]


SOLIDS = {  # constants of the solid, rotation of the ghost
    "classical": ("density = 1000.0, young = 1.0e6, poisson = 0.25", "fixed"),
    "micropolar": (
        "law = 'micropolar', density = 1000.0, young = 1.0e6, poisson = 0.25, l_t = 0.01, "
        "l_b = 0.01, coupling = 0.7, polar_ratio = 1.0",
        "micro",
    ),
}


def facet_stiffness(case: Case, soft: str, name: str) -> float:
    """Force of the facet at the ghost over its displacement [N/m]."""
    case.run("talus-fem", write_deck(case, f"{name}_probe.nml", "probe.nml", soft=soft))
    with_load = field_steps(case.folder / f"{name}_probe.h5")[-1].solid["u"][:, 2]
    x = read_mesh(case.folder / "block.h5").x
    top = (np.abs(x[:, :2]) < 0.011).all(axis=1) & (x[:, 2] > -1e-9)
    return -1.0 / float(np.mean(with_load[top]))


def write_grains(case: Case) -> None:
    """A flat ghost, a sphere over it."""
    x = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS - SQUEEZE / 2]])
    axes = np.array([[ACROSS, ACROSS, RADIUS], [RADIUS] * 3])
    write_packing(
        case.folder / "pack.h5", x, axes, kind=np.array([1, 0]), groups={"ghosts": np.array([1])}
    )


def way_of(series: float, facet: float, pressed: float) -> np.ndarray:
    """Displacement of the facet after every exchange.

    The solid carries the mean force of an exchange, in which the ghost comes from where it was:
    K u_n = k ((n - 1/2) D - (u_n-1 + u_n)/2), D the lid's way in an exchange.
    """
    exact, u, way = np.zeros(EXCHANGES), 0.0, pressed / EXCHANGES
    for n in range(EXCHANGES):
        u = series * ((n + 0.5) * way - 0.5 * u) / (facet + 0.5 * series)
        exact[n] = u
    return exact


def press(case: Case, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Relax and press; judge all; return exact displacement and Talus'."""
    soft, rotation = SOLIDS[name]
    facet = facet_stiffness(case, soft, name)
    series = RATIO * facet
    mass = 2650.0 * 4 / 3 * np.pi * RADIUS**3
    exchange = 500.0 * 0.3 * np.sqrt(mass / series)  # the sphere comes to rest in each
    pressed = 0.5 * SQUEEZE
    values = {
        "exchange": exchange, "end": EXCHANGES * exchange, "stiffness": 2 * series,
        "lid": 3 * RADIUS - SQUEEZE, "speed": -pressed / (EXCHANGES * exchange),
        "soft": soft, "rotation": rotation, "name": name,
    }  # fmt: skip
    write_deck(case, f"{name}_grains.nml", "grains.nml", **values)
    write_deck(case, f"{name}_solid.nml", "solid.nml", **values)
    case.run("talus-couple", write_deck(case, f"{name}.nml", "coupled.nml", **values))
    share = series / (facet + series)
    log = (case.folder / f"{name}.log").read_text()
    before = float(re.search(r"moved meanwhile +(\S+) m", log)[1])
    case.metric(f"{name}: displacement before the start / exact", before / (SQUEEZE * share), 1.0,
                1e-3)  # fmt: skip
    balance = float(re.search(r"balance +(\S+) m", log)[1])
    case.below(f"{name}: motion of the solid in the balance / displacement", balance / before, 1e-7)
    audit = audit_of(case, name)
    start = SQUEEZE * share * facet
    exact = way_of(series, facet, pressed)
    off = np.abs(audit["mean_ghost_force"] - start - facet * exact) / (facet * pressed * share)
    case.below(f"{name}: force from the start off the exact one", off.max(), 5e-3, "of the last")
    moved = audit["largest_ghost_displacement"]
    off = np.abs(moved - exact) / (pressed * share)
    case.below(f"{name}: displacement from the start off the exact one", off.max(), 5e-3,
               "of the last")  # fmt: skip
    judge_start(case, name, before, start)
    works = audit["interface_work_on_grains"] + audit["interface_work_on_solid"]
    turnover = np.abs(audit["interface_work_on_grains"]).max()
    case.below(f"{name}: works at the interface", np.abs(works).max() / turnover, 1e-5)
    return exact, moved


def judge_start(case: Case, name: str, before: float, start: float) -> None:
    """Judge the first field of the solid and both ledgers."""
    first = field_steps(case.folder / f"{name}_solid.h5")[0].solid
    case.below(f"{name}: displacement in the first field / before",
               np.abs(first["u"]).max() / before, 1e-7)  # fmt: skip
    column = 8 if first["stress"].shape[1] == 9 else 2
    sigma = first["stress"][:, column].mean() * 0.06 * 0.06 / -start
    case.metric(f"{name}: mean stress x area / force at the start", sigma, 1.0, 0.05,
                "mean over elements")  # fmt: skip
    if "phi" in first:
        turned = np.abs(first["phi"]).max() * 0.01 / before
        case.below(f"{name}: micro-rotation in the first field x 1 cm / before", turned, 1e-7)
        couple = np.abs(first["couple_stress"]).max() / (np.abs(first["stress"]).max() * 0.01)
        case.above(f"{name}: couple stress at the start / (stress x length)", couple, 1e-2)
    reaction = read_history(case.folder / f"{name}_grains_energy.csv")
    case.below(f"{name}: ledger of the grains", np.abs(reaction["relative_closure"]).max(), 1e-3)
    solid = read_history(case.folder / f"{name}_solid_energy.csv")
    most = max_of(np.abs(solid[k]).max() for k in ("strain", "load", "spring"))
    case.below(f"{name}: ledger of the solid", np.abs(solid["closure"]).max() / most, 1e-9)


def run(case: Case) -> None:
    """Judge both solids against springs in series; plot the displacements."""
    write_box(case.folder / "block.h5", [-0.03, -0.03, -0.02], [0.03, 0.03, 0.0], (3, 3, 2))
    write_grains(case)
    fig, ax = case.figure()
    step = np.arange(1, EXCHANGES + 1) / EXCHANGES
    for name, mark in zip(SOLIDS, "os", strict=True):
        exact, moved = press(case, name)
        ax.plot(step, 1e6 * exact, label=f"exact, {name}")
        ax.plot(step, 1e6 * moved, mark, mfc="none", label=f"Talus, {name}")
    ax.set(xlabel="time / end [-]", ylabel="displacement from the start [µm]")
    ax.legend()
    case.save(fig)
