"""A pressed lattice in a block: what moves when the coupling begins."""

import numpy as np
from coupled import write_deck

from talus.mesh import box, write_mesh
from talus.packing import Packing, read_packing, write_packing_file
from talus.verification import Case, field_steps, read_history, write_packing

D, DENSITY, STIFFNESS, GRAVITY = 1.0e-2, 2500.0, 1.0e5, 9.81
STRESS = 2.0e4  # of the surcharge [Pa]
N = 3  # grains an element along each axis
H = N * D
MASS = DENSITY * np.pi / 6 * D**3
LOAD = STRESS * D**2  # of a column [N]
SUNK = LOAD / STIFFNESS  # overlap under it [m]
STEP = 0.2 * np.sqrt(MASS / STIFFNESS)
M, EXCHANGES = 4, 100
ONCE = "ghost_contacts = 'exchange'"


def pressed_lattice(case: Case) -> float:
    """Write the lattice at rest, each upper grain with its load; return the height of its top."""
    layers = 2 * N
    overlap = (LOAD + MASS * GRAVITY * np.arange(1, layers)) / STIFFNESS
    z = -np.concatenate([[0.0], np.cumsum(D - overlap)])
    line = D * (np.arange(3 * N) - 0.5 * (3 * N - 1))
    x = np.array([(a, b, c) for c in z for a in line for b in line])
    write_packing(case.folder / "bare.h5", x, np.full(x.shape, 0.5 * D))
    pack: Packing = read_packing(case.folder / "bare.h5")
    pack.surcharge = np.where(x[:, 2] > -0.5 * D, LOAD, 0.0)
    write_packing_file(case.folder / "pack.h5", pack)
    return 0.5 * D


def write_block(case: Case, top: float) -> None:
    """Write the block: one element of free grains at its surface, ghosts around and below."""
    mesh = box(np.array([-2.5 * H, -2.5 * H, top - 3 * H]), np.array([2.5 * H, 2.5 * H, top]),
               (5, 5, 3))  # fmt: skip
    middle = (mesh.x[mesh.hex8].mean(1) - [0.0, 0.0, top]) / H
    wide = np.abs(middle[:, :2]).max(1)
    free = (wide < 0.5) & (middle[:, 2] > -1)
    near = (wide < 1.5) & (middle[:, 2] > -2) & ~free
    mesh.volumes.update(free=np.flatnonzero(free), ghosts=np.flatnonzero(near))
    write_mesh(case.folder / "block.h5", mesh)


def motion(case: Case, stem: str, initial: str, rest: str, pressed: bool) -> dict[str, object]:
    """Run; return motions over the overlap of contacts, and what friction took."""
    values = {
        "initial": initial,
        "rest": rest,
        "stress": f"{STRESS:.17g}",
        "lower": f"{-0.5 * H:.17g}, {-0.5 * H:.17g}",
        "upper": f"{0.5 * H:.17g}, {0.5 * H:.17g}",
        "dt": f"{STEP:.17g}",
        "exchange": f"{M * STEP:.17g}",
        "end": f"{EXCHANGES * M * STEP:.17g}",
        "density": f"{MASS / D**3:.17g}",
        "young": f"{STIFFNESS / D:.17g}",
        "pressure": f"&pressure group = 'z1', value = {STRESS:.17g} /" if pressed else "",
    }
    for side in ("grains", "solid"):
        write_deck(case, f"{stem}_{side}.nml", f"{side}.nml", **values)
    text = (case.folder / "coupled.nml").read_text()
    for side in ("grains", "solid"):
        text = text.replace(f"'{side}.nml", f"'{stem}_{side}.nml")
    (case.folder / f"{stem}.nml").write_text(text)
    write_deck(case, f"{stem}.nml", f"{stem}.nml", **values)
    case.run("talus-couple", f"{stem}.nml")
    energy = read_history(case.folder / f"{stem}_grains_energy.csv")
    steps = field_steps(case.folder / f"{stem}_grains.h5")
    return {
        "time": energy["time"],
        "kinetic": energy["kinetic"] / energy["elastic"][0],
        "friction": float(energy["friction"][-1] / energy["elastic"][0]),
        "grains": float(np.abs(steps[-1].grains["x"] - steps[0].grains["x"]).max() / SUNK),
        "nodes": float(np.abs(field_steps(case.folder / f"{stem}_solid.h5")[-1].solid["u"]).max()
                       / SUNK),
    }  # fmt: skip


def run(case: Case) -> None:
    """The start held with and without the pressure, and not held."""
    write_block(case, pressed_lattice(case))
    fig, ax = case.figure()
    held = "dead_load"
    runs = (
        ("start held", held, "mass = 'nearest'", True),
        ("start held, no pressure", held, "mass = 'nearest'", False),
        ("start held, consistent mass", held, "mass = 'consistent'", True),
        ("start held, ghosts by exchange", held, "mass = 'projected', " + ONCE, True),
        ("start held, free rim", held, "rim_nodes = 'free', " + ONCE, True),
        ("start not held", "none", "mass = 'nearest'", True),
    )
    for k, (label, initial, rest, pressed) in enumerate(runs):
        seen = motion(case, f"run{k}", initial, rest, pressed)
        kinetic = np.maximum(seen["kinetic"][1:], 1e-32)
        ax.semilogy(1e3 * seen["time"][1:], kinetic, "os+xv^"[k], ms=3, label=label)
        for name in ("grains", "nodes"):
            text = f"{label}: largest way of {name} / overlap"
            if initial == "none":
                case.above(text, seen[name], 1e-1)
            else:
                case.below(text, seen[name], 1e-8, "round-off of places")
        if initial == "dead_load":
            text = f"{label}: friction / elastic energy"
            case.below(text, seen["friction"], 1e-12, "round-off")
    ax.set(xlabel="time [ms]", ylabel="kinetic energy of the grains / elastic [-]")
    ax.legend()
    case.save(fig)
