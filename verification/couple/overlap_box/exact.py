"""Conservation in a box of grains inside a free block of elements, and the census of its sets."""

import json

import numpy as np
from coupled import audit_of, write_deck

from talus.mesh import box, write_mesh
from talus.verification import Case, write_packing

DIAMETER, DENSITY, STIFFNESS, PRESSED = 1.0e-2, 2500.0, 1.0e5, 2.0e-5
PITCH = DIAMETER * (1 - PRESSED)
N, FREE, GHOST, REST = 3, 2, 1, 1  # grains an element, layers of elements: free, around, around
MASS = DENSITY * np.pi / 6 * DIAMETER**3
STEP = 0.2 * np.sqrt(MASS / STIFFNESS)
STEPS, M, SPEED = 480, 4, 2.0e-5
LONG = 4  # times as many steps
MLS = "projection = 'mls', mass = 'nearest'"
RUNS = (("fit", "step", M, LONG, ""), ("ramp", "step", M, 1, ""),
        ("fit", "exchange", M // 2, LONG, ""),
        ("fit", "exchange", M // 2, LONG, MLS))  # fmt: skip


def write_input(case: Case) -> np.ndarray:
    """Write packing and mesh around the origin; return velocities of the grains."""
    across = N * (FREE + 2 * GHOST)
    line = PITCH * (np.arange(across) - 0.5 * (across - 1))
    x = np.array([(a, b, c) for a in line for b in line for c in line])
    half = 0.5 * FREE * N * PITCH
    knock = np.exp(-np.sum((x - [0.5 * half, 0.2 * half, 0]) ** 2, 1) / (0.7 * half) ** 2)
    inside = np.all(np.abs(x) < half, 1)
    v = SPEED * np.outer(knock * inside, [0.3, 1.0, 0.2])
    write_packing(case.folder / "pack.h5", x, np.full(x.shape, 0.5 * DIAMETER), v=v)
    count = FREE + 2 * (GHOST + REST)
    edge = 0.5 * count * N * PITCH
    mesh = box(np.full(3, -edge), np.full(3, edge), (count,) * 3)
    middle = np.abs(mesh.x[mesh.hex8].mean(1)).max(1)
    free = middle < half
    ghosts = (middle < half + GHOST * N * PITCH) & ~free
    mesh.volumes.update(free=np.flatnonzero(free), ghosts=np.flatnonzero(ghosts))
    write_mesh(case.folder / "block.h5", mesh)
    return v


def vectors(audit: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Columns name_x, name_y, name_z as rows of vectors."""
    return np.column_stack([audit[f"{name}_{c}"] for c in "xyz"])


def drift_of(total: np.ndarray) -> float:
    """Mean of the last quarter of a run less that of the second: what oscillates drops out."""
    first, last = np.array_split(total, 4)[1::2]
    return float(last.mean() - first.mean())


def run(case: Case) -> None:
    """Judge the audits of fitted and ramped weights."""
    v = write_input(case)
    energy = 0.5 * MASS * np.sum(v**2)
    values = {"dt": f"{STEP:.17g}", "density": f"{MASS / PITCH**3:.17g}"}
    values["young"] = f"{STIFFNESS / PITCH:.17g}"
    write_deck(case, "grains.nml", "box_grains.nml", **values)
    write_deck(case, "solid.nml", "box_solid.nml", **values)
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for partition, contacts, m, times, more in RUNS:
        values |= {"contacts": contacts, "exchange": f"{m * STEP:.17g}", "more": more}
        values["end"] = f"{times * STEPS // M * M * STEP:.17g}"
        label = partition if contacts == "step" else f"{partition}, by exchange of {m}"
        label += ", mls" * (more == MLS)
        deck = write_deck(case, f"{partition}.nml", "coupled.nml", partition=partition, **values)
        case.run("talus-couple", deck)
        audit = audit_of(case, partition)
        summary = json.loads((case.folder / f"{partition}_summary.json").read_text())
        if label == "fit":
            for name, wanted in (
                ("free_grains", (N * FREE) ** 3),
                ("ghosts", (N * (FREE + 2 * GHOST)) ** 3 - (N * FREE) ** 3),
                ("hat_nodes", (FREE + 1) ** 3),
                ("edge_nodes", (FREE + 2 * GHOST + 1) ** 3 - (FREE + 1) ** 3),
            ):
                case.metric(name, summary[name], wanted, 0, "counted by hand")
            rest = summary["overlap"]["fit_residual"]
            case.below("fit: largest row over the mean contact force", rest, 1e-12, "round-off")
        moves = vectors(audit, "momentum")
        drift = np.abs(moves - moves[0]).max() / np.linalg.norm(moves[0])
        case.below(f"{label}: momentum", drift, 1e-10, "round-off")
        spins = vectors(audit, "angular_momentum")[: STEPS // m + 1]
        turn = np.abs(spins - spins[0]).max() / np.linalg.norm(spins[0])
        case.below(f"{label}: angular momentum", turn, 2e-3, "held loads do not turn")
        total = audit["total_energy"] - audit["total_energy"][0]
        case.below(f"{label}: energy", np.ptp(total) / energy, 0.02, "bounded")
        if times > 1:
            case.below(f"{label}: drift of the energy", abs(drift_of(total)) / energy, 2e-3)
        if contacts == "exchange":
            share = m * STEP / summary["overlap"]["stable_exchange_s"]
            case.below(f"{label}: exchange over that of the kicks", share, 1.0, "stable")
        works = audit["interface_work_given"] - audit["interface_work_taken"]
        case.below(f"{label}: works of both sides", np.abs(works).max() / energy, 1e-10)
        left.plot(1e3 * audit["time"], 100 * total / energy, label=label)
        right.plot(1e3 * audit["time"], 1e9 * audit["fine_scale"], label=label)
    left.set(xlabel="time [ms]", ylabel="change of energy / energy [%]")
    right.set(xlabel="time [ms]", ylabel="fine scale [nm]")
    left.legend()
    right.legend()
    case.save(fig)
