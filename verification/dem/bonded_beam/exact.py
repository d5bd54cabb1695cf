"""A row of bonded spheres under its weight against sums over its bonds."""

import json

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

COUNT, RADIUS, GAP, DENSITY, G = 10, 5.0e-3, 1.0e-5, 2000.0, 9.81
YOUNG, RATIO, BEAM = 1.0e7, 2.0, 0.8 * 5.0e-3
LENGTH = 2 * RADIUS + GAP
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
AREA = np.pi * BEAM**2
NORMAL = YOUNG * AREA / LENGTH
SHEAR, BENDING = NORMAL / RATIO, NORMAL * BEAM**2 / 4.0
PLACE = LENGTH * np.arange(COUNT)  # of the grains
JOINT = PLACE[:-1] + LENGTH / 2.0  # of the bonds
BELOW = MASS * G * np.arange(COUNT - 1, 0, -1)  # weight beyond each bond
MOMENT = np.array([MASS * G * np.sum(PLACE[k + 1 :] - JOINT[k]) for k in range(COUNT - 1)])


def ran(case: Case, name: str, way: str, strength: float, load: float = 1.0) -> tuple:
    """Run the row under load times its weight; return places, energy history and summary."""
    words = {
        "END": 0.6, "GX": load * G if way == "hanging" else 0.0,
        "GZ": -load * G if way == "lying" else 0.0, "STRENGTH": strength,
        "DRAG": 240.0 if way == "lying" else 20000.0,
    }  # fmt: skip
    deck = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        deck = deck.replace(word, f"{value:.10e}")
    (case.folder / f"{name}.nml").write_text(deck)
    x = np.stack([PLACE, 0 * PLACE, 0 * PLACE], axis=1)
    kind = np.array([1] + [0] * (COUNT - 1))
    write_packing(case.folder / "pack.h5", x, np.full((COUNT, 3), RADIUS), kind=kind)
    case.run("talus-dem", f"{name}.nml")
    summary = json.loads((case.folder / f"{name}_summary.json").read_text())
    rows = read_history(case.folder / f"{name}_energy.csv")
    return field_steps(case.folder / f"{name}.h5")[-1].grains["x"], rows, summary["health"]


def broken(case: Case, way: str, limit: float, band: tuple, load: float = 1.0) -> dict:
    """Judge that the row holds and breaks at these parts of its largest tension."""
    _, _, health = ran(case, f"{way}_holds", way, band[1] * limit, load)
    case.metric(f"{way}: bonds broken at {1 / band[1]:.3f} of the strength", health["bonds_torn"],
                0, 0)  # fmt: skip
    _, rows, health = ran(case, f"{way}_breaks", way, band[0] * limit, load)
    case.metric(f"{way}: bonds broken at {1 / band[0]:.3f} of it", health["bonds_torn"], 1, 0)
    return rows


def run(case: Case) -> None:
    """Judge deflections, strengths, energies; plot the two lines."""
    x, rows, health = ran(case, "hanging", "hanging", 1.0e9)
    case.metric("bonds made", health["bonds_made"], COUNT - 1, 0)
    stretch = np.concatenate([[0.0], np.cumsum(BELOW / NORMAL)])
    case.metric("hanging: elongation / exact", (x[-1, 0] - PLACE[-1]) / stretch[-1], 1.0, 1e-3)
    held = rows["elastic_other"][-1] / np.sum(BELOW**2 / (2 * NORMAL))
    case.metric("hanging: energy of the bonds / exact", held, 1.0, 2e-3)
    closure = np.abs(rows["closure_error"]).max() / np.abs(rows["gravity"]).max()
    case.below("hanging: closure / work of gravity", closure, 1e-4)
    part = 0.02  # of the weight, so that the beam stays almost straight
    y, rows, _ = ran(case, "lying", "lying", 1.0e9, part)
    sag = np.array([
        np.sum(MOMENT[:k] * (PLACE[k] - JOINT[:k]) / BENDING + BELOW[:k] / SHEAR)
        for k in range(COUNT)
    ])  # fmt: skip
    down = -y[:, 2] / part
    case.metric("lying: deflection of the tip / exact", down[-1] / sag[-1], 1.0, 3e-3)
    closure = np.abs(rows["closure_error"]).max() / np.abs(rows["gravity"]).max()
    case.below("lying: closure / work of gravity", closure, 1e-4)
    rows = broken(case, "hanging", BELOW[0] / AREA, (0.99, 1.01))
    held = (0.99 * BELOW[0]) ** 2 / (2 * NORMAL)
    case.metric("hanging: breakage / energy of that bond", rows["breakage"][-1] / held, 1.0, 5e-3)
    edge = 4.0 * MOMENT[0] / (AREA * BEAM) * part
    broken(case, "lying", edge, (0.97, 1.10), part)
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    axes[0].plot(PLACE * 1e3, stretch * 1e6, "-", label="exact")
    axes[0].plot(PLACE * 1e3, (x[:, 0] - PLACE) * 1e6, "o", label="Talus")
    axes[0].set(xlabel="place [mm]", ylabel="displacement, hanging [um]")
    axes[0].legend()
    axes[1].plot(PLACE * 1e3, -sag * 1e3, "-", label="exact")
    axes[1].plot(PLACE * 1e3, -down * 1e3, "o", label="Talus")
    axes[1].set(xlabel="place [mm]", ylabel="deflection / load factor, lying [mm]")
    axes[1].legend()
    case.save(fig)
