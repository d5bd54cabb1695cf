"""A cube on four light grains against the oscillator on two springs in series at each corner."""

import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.verification import Case, write_packing

RADIUS, ACROSS, CORNER = 0.01, 0.1, 0.035
STIFFNESS, MASS, GRAVITY, GRAIN = 2450.0, 1.0, 9.8, 1.0e-4
SINK = MASS * GRAVITY / (4 * STIFFNESS / 2)
PERIOD = 2 * np.pi / np.sqrt(4 * STIFFNESS / 2 / MASS)


def fall(case: Case, young: float, scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """Couple a cube of this modulus [Pa]; return times [s] and sink of its lower face [m]."""
    name = f"{scheme}_{young:.0e}"
    write_deck(case, f"solid_{name}.nml", "solid.nml", young=young)
    deck = write_deck(
        case, f"coupled_{name}.nml", "coupled.nml", solid=f"solid_{name}.nml", scheme=scheme
    )
    case.run("talus-couple", deck)
    audit = audit_of(case, f"coupled_{name}")
    return audit["time"], audit["largest_ghost_displacement"]


def swing(time: np.ndarray, sink: np.ndarray) -> tuple[float, float]:
    """Fit sink = d (1 - cos(2 pi t/T)); return (d, T)."""
    best = (np.inf, 0.0, 0.0)
    for period in PERIOD * np.linspace(0.98, 1.06, 4001):
        shape = 1 - np.cos(2 * np.pi * time / period)
        d = shape @ sink / (shape @ shape)
        best = min(best, (float(np.sum((sink - d * shape) ** 2)), float(d), float(period)))
    return best[1], best[2]


def run(case: Case) -> None:
    """Judge sink and period of a stiff and a soft cube."""
    write_box(case.folder / "cube.h5", [-0.05, -0.05, 0.03], [0.05, 0.05, 0.13], (2, 2, 2))
    corners = CORNER * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    ghosts = np.column_stack([corners, np.full(4, 3 * RADIUS)])
    grains = np.column_stack([corners, np.full(4, RADIUS)])
    axes = np.vstack([np.tile([ACROSS, ACROSS, RADIUS], (4, 1)), np.full((4, 3), RADIUS)])
    kind = np.repeat([1, 0], 4)
    write_packing(
        case.folder / "pack.h5",
        np.vstack([ghosts, grains]),
        axes,
        kind=kind,
        groups={"ghosts": np.arange(1, 5)},
    )
    density = GRAIN / (4 / 3 * np.pi * RADIUS**3)
    write_deck(case, "grains_at_work.nml", "grains.nml", density=density)
    fig, ax = case.figure()
    for scheme in ("average", "iterated", "state_at_n"):
        time, sink = fall(case, 1.0e9, scheme)
        d, period = swing(time, sink)
        case.metric(
            f"{scheme}: sink [m]", d, SINK, 0.005 * SINK, "grains of 0.1 g, half a per cent"
        )
        case.metric(f"{scheme}: period [s]", period, PERIOD, 0.005 * PERIOD)
        if scheme == "average":
            ax.plot(time, -1e3 * sink, "o", markevery=25, label="Talus, E = 1 GPa")
    time, sink = fall(case, 1.0e6, "iterated")
    soft = swing(time, sink)[1] / PERIOD
    case.metric(
        "period of the soft cube / exact", soft, 1.02, 0.01, "1 to 3 % longer by its own compliance"
    )
    ax.plot(time, -1e3 * sink, "x", markevery=25, label="Talus, E = 1 MPa")
    ax.plot(
        time, -1e3 * SINK * (1 - np.cos(2 * np.pi * time / PERIOD)), "-", label="exact, rigid cube"
    )
    ax.set(xlabel="time [s]", ylabel="displacement [mm]")
    ax.legend()
    case.save(fig)
