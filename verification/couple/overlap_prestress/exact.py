"""Packs under pressure that must stay at rest when an overlap begins."""

import json

import numpy as np
from coupled import write_deck
from overlap_cell import lattice, random_pack

from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, write_packing

D, STIFFNESS, WIDE = 1.0e-3, 1.0e5, 5
PRESSED = 1.0e-3  # overlap of lattices / diameter
CLASSICAL = "id = 'soil', density = 1400.0, young = 5.0e7, poisson = 0.1"
POLAR = (
    "id = 'soil', law = 'micropolar', density = 1400.0, micro_inertia = 1.0e-7, lambda = 2.0e7,"
    " mu = 2.0e7, kappa = 2.0e7, alpha = 0.0, beta = 0.0, gamma = 10.0"
)

YIELDING = (
    "id = 'soil', law = 'drucker_prager', density = 1400.0, young = 5.0e7, poisson = 0.1,"
    " cohesion = 1.0e5, friction_deg = 30.0, dilation_deg = 0.0 /\n"
    "&initial_stress group = 'all', value = -1.0e5, -1.0e5, -1.0e5, 0.0, 0.0, 0.0"
)


def write_pack(case: Case, name: str) -> float:
    """Write pack and mesh; return the unit of length of the pack (m)."""
    if name == "random":
        h = 3.4
        pack = random_pack(np.full(3, (WIDE - 2) * h), 0.65, 3)
        pack.x += h
    else:
        pack, h = lattice(name, (WIDE,) * 3, np.full(3, 0.31), 3)
    scale = D * (1.0 if name == "random" else 1 - PRESSED)
    x, radius, h = pack.x * scale, pack.radius * D, h * scale
    inside = ((x > h) & (x < (WIDE - 1) * h)).all(1)
    x, axes = x[inside], np.tile(radius[inside, None], 3)
    if name == "random":
        x = settled(case, x, axes, h)
    write_packing(case.folder / f"{name}_pack.h5", x, axes)
    mesh = box(np.zeros(3), np.full(3, WIDE * h), (WIDE,) * 3)
    layer = np.rint(np.abs(mesh.x[mesh.cells["hex8"]].mean(1) / h - 0.5 * WIDE).max(1))
    mesh.volumes.update(free=np.flatnonzero(layer == 0), ghosts=np.flatnonzero(layer == 1))
    write_mesh(case.folder / f"{name}_block.h5", mesh)
    return float(scale)


def settled(case: Case, x: np.ndarray, axes: np.ndarray, h: float) -> np.ndarray:
    """Let the grains that will be free find their rest between the others; return centres (m)."""
    free = (np.abs(x / h - 0.5 * WIDE) < 0.5).all(1)
    write_packing(case.folder / "loose.h5", x, axes, kind=np.where(free, 0, 1))
    case.run("talus-dem", "settle.nml")
    grains = list(field_steps(case.folder / "settle.h5"))[-1].grains
    x = np.empty_like(x)
    x[grains["id"] - 1] = grains["x"]
    return x


def judge(case: Case, name: str, label: str, **values: str) -> tuple[dict, float]:
    """Run; return what the summary says of the overlap, and the largest way of a free grain / d."""
    values = {"name": name, "tangential": "5.0e4" if name == "random" else "1.0e5"} | values
    stem = label.replace(", ", "_").replace("-", "") + "_" + values["initial"]
    for side in ("grains", "solid", "coupled"):
        write_deck(case, f"{stem}_{side}.nml", f"{side}.nml", stem=stem, **values)
    case.run("talus-couple", f"{stem}_coupled.nml")
    summary = json.loads((case.folder / f"{stem}_coupled_summary.json").read_text())
    steps = list(field_steps(case.folder / f"{stem}_grains.h5"))
    way = np.linalg.norm(steps[-1].grains["x"] - steps[0].grains["x"], axis=1).max() / D
    case.metric(f"{label}: exchanges", summary["steps"], 20, 0)
    return summary["overlap"], float(way)


def run(case: Case) -> None:
    """Lattices on both solids, a random pack; each beside the same without initial stress."""
    ways = {}
    for name, label, material, element in (
        ("cubic", "cubic", CLASSICAL, "hex8_full"),
        ("fcc", "fcc, B-bar", CLASSICAL, "hex8_bbar"),
        ("fcc", "fcc, micropolar", POLAR, "hex8/hex8"),
        ("random", "random", CLASSICAL, "hex8_full"),
    ):
        scale = write_pack(case, name)
        values = {"material": material, "element": element, "moduli": "affine"}
        told, way = judge(case, name, label, initial="stress", **values)
        case.below(f"{label}: rest of the corrected stress", told["initial_rest"], 1e-10, "gate")
        case.below(f"{label}: rest as the solvers give it", told["start_rest"], 1e-10, "gate")
        case.below(f"{label}: largest change of stress / pressure", told["initial_change"], 0.5)
        case.below(f"{label}: way of a grain / diameter", way, 1e-6, "nothing moves")
        if label == "cubic":
            shear = STIFFNESS / (2 * scale)
            case.metric("cubic: G / (k/2a)", told["shear_Pa"] / shear, 1.0, 1e-9)
            case.below("cubic: lambda / G", abs(told["lambda_Pa"]) / shear, 1e-9)
        free = np.nan
        if name in ("cubic", "random"):
            _, free = judge(case, name, label, initial="none", **values)
            case.above(f"{label}: way without initial stress / diameter", free, 1e-5)
        ways[label] = (way, free)
    values = {"material": YIELDING, "element": "hex8_full", "moduli": "deck"}
    _, way = judge(case, "cubic", "cubic, yielding", initial="dead_load", **values)
    case.below("cubic, yielding, dead loads: way of a grain / diameter", way, 1e-6, "nothing moves")
    fig, ax = case.figure()
    at = np.arange(len(ways))
    ax.semilogy(at, [max(w[0], 1e-17) for w in ways.values()], "o", label="initial = 'stress'")
    ax.semilogy(at, [w[1] for w in ways.values()], "s", label="initial = 'none'")
    ax.axhline(1e-6, color="k", lw=0.8, label="limit")
    ax.set_xticks(at, list(ways))
    ax.set(xlabel="pack [-]", ylabel="way of a grain / diameter [-]")
    ax.legend()
    case.save(fig)
