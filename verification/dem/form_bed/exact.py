"""Ledger, threads, restart and contacts of a settling bed of four kinds of grains."""

import form_pairs
import h5py
import numpy as np
import same_bits

from talus.forms import Forms, bounding_radii, volumes
from talus.generate import random_quaternions
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

COUNT = 100
COLUMNS = ("friction", "contact_damping", "tangential_relaxation")


def bed() -> object:
    """100 grains on a 5 x 5 lattice of pitch 5.5 mm, of four kinds in turn."""
    rng = np.random.default_rng(3)
    i, j, k = np.meshgrid(np.arange(5), np.arange(5), np.arange(4), indexing="ij")
    x = np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * 5.5e-3 + [4e-3, 4e-3, 3e-3]
    axes = np.tile([2.2e-3, 1.8e-3, 1.4e-3], (COUNT, 1))
    kind = np.arange(COUNT) % 4
    axes[kind == 0] = 2.0e-3
    packing = make_packing(x, axes, random_quaternions(rng, COUNT))
    packing.skew[kind == 2] = rng.uniform(-0.3, 0.3, (COUNT // 4, 3))
    packing.exponent[kind == 3] = rng.uniform(2.5, 6.0, COUNT // 4)
    return packing


def unproven_pairs(case: Case) -> tuple[int, int]:
    """Pairs near each other without a contact, and those for which no separating plane is found."""
    now = field_steps(case.folder / "deck.h5")[-1]
    g = now.grains
    upper, lower = g["axes"] * (1.0 + g["skew"]), g["axes"] * (1.0 - g["skew"])
    shapes = form_pairs.Shapes(upper, lower, g["exponent"], g["quat"], np.zeros(COUNT, int))
    radius = bounding_radii(Forms(g["axes"], g["skew"], g["exponent"]))
    i, j = np.triu_indices(COUNT, 1)
    near = np.linalg.norm(g["x"][j] - g["x"][i], axis=1) < radius[i] + radius[j]
    touching = {tuple(sorted(pair)) for pair in now.contacts["ids"].tolist()}
    known = np.array([(a + 1, b + 1) in touching for a, b in zip(i, j, strict=True)])
    i, j = i[near & ~known], j[near & ~known]
    a, b, r = shapes.take(i), shapes.take(j), g["x"][j] - g["x"][i]
    n = r / np.linalg.norm(r, axis=1, keepdims=True)
    best, step = form_pairs.gap(a, b, r, n), np.full((len(i), 1), 0.3)
    for _ in range(400):
        uphill = r - a.support(n)[1] + b.support(-n)[1]
        trial = n + step * uphill / np.linalg.norm(uphill, axis=1, keepdims=True)
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        value = form_pairs.gap(a, b, r, trial)
        better = value > best
        n[better], best[better] = trial[better], value[better]
        step[~better] *= 0.7
    return len(i), int((best <= -1e-9).sum())


def run(case: Case) -> None:
    """Judge all claims; plot the columns of the ledger."""
    packing = bed()
    write_h5(case.folder / "pack.h5", packing)
    case.run("talus-dem", "deck.nml", "--threads=1")
    rows = read_history(case.folder / "deck_energy.csv")
    scale = np.abs(rows["gravity"]).max()
    spent = rows["kinetic"] - rows["kinetic"][0] + rows["elastic"]
    for name in COLUMNS:
        spent = spent + rows[name]
    error = np.abs(rows["gravity"] + rows["boundary"] + rows["curvature"] - spent) / scale
    case.below("largest closure error / work of gravity", float(error.max()), 1e-4)
    with h5py.File(case.folder / "deck.h5") as file:
        made = file["steps/000000/grains"]
        for name in ("axes", "skew", "exponent"):
            case.metric(f"{name} as in the packing", float(np.abs(
                made[name][...] - getattr(packing, name)).max()), 0.0, 0.0)  # fmt: skip
    weight = 2650.0 * 9.81 * volumes(packing.axes, packing.skew, packing.exponent)
    start, end = (field_steps(case.folder / "deck.h5")[k].grains["x"][:, 2] for k in (0, -1))
    work = float((weight * (start - end)).sum())
    case.metric("weight of the volumes times the fall / work of gravity",
                work / rows["gravity"][-1], 1.0, 1e-9)  # fmt: skip
    same_bits.judge(case, "deck")
    pairs, missed = unproven_pairs(case)
    case.above("pairs near each other without a contact", pairs, 50)
    case.metric("of these not shown to be apart", missed, 0, 0)
    fig, ax = case.figure()
    ax.plot(rows["time"], rows["gravity"], "-", label="work of gravity")
    for name in ("kinetic", "elastic", "curvature", *COLUMNS):
        ax.plot(rows["time"], rows[name], "--", label=name.replace("_", " "))
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    ax.legend(fontsize=8)
    case.save(fig)
