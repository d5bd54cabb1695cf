"""A block with a deformable face on light free grains against springs in series."""

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.verification import Case, read_history, write_packing

RADIUS, CORNER = 0.01, 0.035
STIFFNESS, MASS, GRAVITY, GRAIN = 2450.0, 1.0, 9.8, 1.0e-4
SINK = MASS * GRAVITY / (4 * STIFFNESS / 2)
LAWS = {"neo_hookean": "",
        "drucker_prager": ", cohesion = 1.0e9, friction_deg = 30.0"}  # fmt: skip
LIMIT = {"iterated": 1e-6, "state_at_n": 0.02}
PERIOD = 2 * np.pi / np.sqrt(4 * STIFFNESS / 2 / MASS)


def fall(
    case: Case, young: float, scheme: str, law: str = "linear_elastic", more: str = ""
) -> dict[str, np.ndarray]:
    """Couple a block of this modulus [Pa] and law, with more constants; return the audit."""
    name = f"{scheme}_{young:.0e}_{law}"
    write_deck(case, f"solid_{name}.nml", "solid.nml", young=young, law=f"'{law}'{more}")
    deck = write_deck(
        case, f"coupled_{name}.nml", "coupled.nml", solid=f"solid_{name}.nml", scheme=scheme
    )
    case.run("talus-couple", deck)
    return audit_of(case, f"coupled_{name}")


def swing(time: np.ndarray, sink: np.ndarray) -> tuple[float, float]:
    """Fit sink = d (1 - cos(2 pi t/T)); return (d, T)."""
    best = (np.inf, 0.0, 0.0)
    for period in PERIOD * np.linspace(0.98, 1.06, 4001):
        shape = 1 - np.cos(2 * np.pi * time / period)
        d = shape @ sink / (shape @ shape)
        best = min(best, (float(np.sum((sink - d * shape) ** 2)), float(d), float(period)))
    return best[1], best[2]


def work_off(audit: dict[str, np.ndarray]) -> float:
    """Return the largest difference of the work on both sides over the largest work."""
    work = audit["interface_work_on_grains"]
    return float(np.abs(audit["interface_work_difference"]).max() / np.abs(work).max())


def run(case: Case) -> None:
    """Judge sink, period, force and work of a stiff block, and the work of a soft one."""
    write_box(case.folder / "block.h5", [-0.05, -0.05, 0.02], [0.05, 0.05, 0.12], (2, 2, 2))
    corners = CORNER * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    x = np.column_stack([corners, np.full(4, RADIUS)])
    write_packing(case.folder / "pack.h5", x, np.full((4, 3), RADIUS))
    density = GRAIN / (4 / 3 * np.pi * RADIUS**3)
    write_deck(case, "grains_at_work.nml", "grains.nml", density=density)
    fig, ax = case.figure()
    for scheme, mark in (("iterated", "o"), ("state_at_n", "+")):
        audit = fall(case, 1.0e9, scheme)
        time, sink = audit["time"], audit["largest_ghost_displacement"]
        d, period = swing(time, sink)
        case.metric(
            f"{scheme}: sink [m]", d, SINK, 0.005 * SINK, "grains of 0.1 g, half a per cent"
        )
        case.metric(f"{scheme}: period [s]", period, PERIOD, 0.005 * PERIOD)
        case.below(f"{scheme}: work of the sides differs by", work_off(audit), LIMIT[scheme])
        walls = read_history(case.folder / "grains_at_work_walls.csv")
        top = walls["force_z"].min() / (-2.0 * MASS * GRAVITY)
        case.metric(f"{scheme}: largest force on the floor / 2 M g", top, 1.0, 0.01)
        ax.plot(time, -1e3 * sink, mark, markevery=25, label=f"Talus, E = 1 GPa, {scheme}")
    audit = fall(case, 1.0e6, "iterated")
    case.below("soft block: work of the sides differs by", work_off(audit), 1e-5)
    linear = fall(case, 1.0e9, "average")
    for law, more in LAWS.items():
        audit = fall(case, 1.0e9, "average", law, more)
        off = audit["largest_ghost_displacement"] - linear["largest_ghost_displacement"]
        case.below(f"{law}: sink beside that of the linear block, over it",
                   float(np.abs(off).max() / SINK), 1e-6)  # fmt: skip
    audit = fall(case, 1.0e6, "iterated", "neo_hookean")
    case.below("soft neo-Hookean block: work of the sides differs by", work_off(audit), 1e-5)
    ax.plot(
        time, -1e3 * SINK * (1 - np.cos(2 * np.pi * time / PERIOD)), "-", label="exact, rigid block"
    )
    ax.set(xlabel="time [s]", ylabel="displacement [mm]")
    ax.legend()
    case.save(fig)
