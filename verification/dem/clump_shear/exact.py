"""Critical states of spheres and dumbbells, as clumps, under simple shear at constant pressure."""

import argparse

import numpy as np

from talus.clumps import Template, mass_of
from talus.commands.pack_clump import cloud_of_clumps
from talus.packing import read_h5, write_h5
from talus.verification import Case, field_steps, read_history

COUNT, BOX, RADIUS, SEED = 200, 16.5e-3, 1.0e-3, 7
PRESSURE, RATE, SHEAR = 20.0e3, 2.0, 2.0  # [Pa], [1/s], [-]
RATIO = 0.382  # published for spheres with a friction of 0.5, see periodic_shear
PLATEAU = 1.0  # from this shear on
APART = 1.2  # of the spheres of a dumbbell, in their radii


def templates() -> dict[str, Template]:
    """Return a sphere and a dumbbell of the same volume."""
    unit = mass_of(np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * APART, np.ones(2))[0]
    small = RADIUS * (4.0 / 3.0 * np.pi / unit) ** (1.0 / 3.0)
    return {
        "spheres": Template(np.zeros((1, 3)), np.array([RADIUS])),
        "dumbbells": Template(small * APART * np.array([[-0.5, 0, 0], [0.5, 0, 0]]),
                              np.full(2, small)),
    }  # fmt: skip


def cloud(case: Case, name: str, template: Template) -> None:
    """Write a cloud of clumps in a periodic cell."""
    rows = [*zip(*template.centre.T, template.radius, strict=True)]
    table = case.folder / f"{name}.txt"
    table.write_text("\n".join(" ".join(repr(float(v)) for v in row) for row in rows) + "\n")
    none = dict.fromkeys(("axes", "shapes", "gradation", "sieves", "distribution"))
    options = argparse.Namespace(clumps=table, count=COUNT, spread=0.0, seed=SEED, periodic=True,
                                 box=[1.15 * BOX] * 3, **none)  # fmt: skip
    write_h5(case.folder / f"{name}_cloud.h5", cloud_of_clumps(options))


def simulate(case: Case, name: str) -> dict[str, np.ndarray]:
    """Compress, stop, shear; return the rows of the cell."""
    words = {"NAME": name, "T_END": f"{SHEAR / RATE}", "RATE": f"{RATE}"}
    for part in ("compress", "shear"):
        deck = (case.folder / f"{part}.nml").read_text()
        for word, value in words.items():
            deck = deck.replace(word, value)
        (case.folder / f"{part}_{name}.nml").write_text(deck)
        case.run("talus-dem", f"{part}_{name}.nml", "--threads=1")
        if part == "compress":
            pack = read_h5(case.folder / f"{name}.h5")
            pack.v[:], pack.omega[:] = 0.0, 0.0
            pack.clumps.v[:], pack.clumps.omega[:] = 0.0, 0.0
            write_h5(case.folder / f"{name}.h5", pack)
    return read_history(case.folder / f"shear_{name}_cell.csv")


def work_of_stress(rows: dict[str, np.ndarray]) -> float:
    """Integral of V sigma : L over the run [J]; trapezoids of the history."""
    power = np.zeros(len(rows["time"]))
    for i in "xyz":
        for j in "xyz":
            power += rows["volume"] * rows[f"stress_{i}{j}"] * rows.get(f"rate_{i}{j}", 0.0)
    return float(np.trapezoid(power, rows["time"]))


def run(case: Case) -> None:
    """Judge strength, work, symmetry and momentum of both; plot."""
    fig, axis = case.figure()
    found = {}
    for name, template in templates().items():
        cloud(case, name, template)
        rows = simulate(case, name)
        p = -(rows["stress_xx"] + rows["stress_yy"] + rows["stress_zz"]) / 3.0
        gamma = RATE * rows["time"]
        late = gamma >= PLATEAU
        ratio = 0.5 * (rows["stress_xz"] + rows["stress_zx"]) / p
        found[name] = float(ratio[late].mean())
        skew = (rows["stress_xz"] - rows["stress_zx"])[late].mean() / p[late].mean()
        case.below(f"asymmetry of the stress / pressure, {name}", float(abs(skew)), 5e-3,
                   "moments balance in the mean")  # fmt: skip
        energy = read_history(case.folder / f"shear_{name}_energy.csv")
        done = work_of_stress(rows) / float(energy["boundary"][-1])
        case.metric(f"work of the stress / of the flow, {name}", done, 1.0, 0.02,
                    "sampled each ms; kinetic stress")  # fmt: skip
        case.below(f"ledger, {name}", float(energy["relative_closure"][-1]), 1e-4)
        end = field_steps(case.folder / f"shear_{name}.h5")[-1].clumps
        size = np.linalg.norm(end["v"].sum(axis=0)) / np.linalg.norm(end["v"], axis=1).sum()
        case.below(f"momentum relative to the flow, {name}", float(size), 1e-9)
        axis.plot(gamma, ratio, label=name)
    case.metric("stress ratio of spheres", found["spheres"], RATIO, 0.03, "plateau")
    case.above("stress ratio, dumbbells - spheres", found["dumbbells"] - found["spheres"], 0.05)
    axis.axhline(RATIO, color="0.5", lw=0.8, ls="--")
    axis.set(xlabel="shear [-]", ylabel="shear stress over pressure [-]")
    axis.legend()
    case.save(fig)
