"""Dense random packs of four kinds of grains: are all contacts found, and none invented?"""

import json

import all_pairs
import numpy as np

from talus.generate import random_quaternions
from talus.verification import Case, field_steps, write_packing

COUNT, COLUMNS = 500, 7
SIZE = 2.5e-3  # largest semi-axis [m]
PITCH = 2.02 * SIZE
EDGE, HEIGHT = COLUMNS * PITCH, -(-COUNT // COLUMNS**2) * PITCH
T_END = 0.04  # s, as in the deck
EVERY = 4.0  # ms between the fields, as in the deck
DENSE = 0.5  # solid fraction below the lid at the end
SLACK = 1.0e-12  # of the size; overlaps below it are rounding


def semi_axes(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Semi-axes (n, 3) [m] of one kind of grains, none above SIZE."""
    if kind == "benchmark":
        return np.tile([2.5e-3, 2.0e-3, 1.5e-3], (COUNT, 1))
    if kind == "triaxial":
        return SIZE * rng.uniform(0.4, 1.0, (COUNT, 3))
    if kind == "needles_plates":
        thin = rng.uniform(0.2, 0.3, (COUNT, 1))
        shape = np.where(rng.random((COUNT, 1)) < 0.5, [[1.0, 0.0, 0.0]], [[1.0, 1.0, 0.0]])
        return SIZE * np.where(shape > 0.0, shape, thin)
    size = SIZE * np.exp(rng.uniform(np.log(0.25), 0.0, (COUNT, 1)))
    round_ones = rng.random((COUNT, 1)) < 0.5
    return size * np.where(round_ones, 1.0, rng.uniform(0.5, 1.0, (COUNT, 3)))


def run_pack(case: Case, kind: str, seed: int) -> list[dict[str, int]]:
    """Press one pack together; return the comparison at each time."""
    rng = np.random.default_rng(seed)
    k = np.arange(COUNT)
    site = np.column_stack([k % COLUMNS, k // COLUMNS % COLUMNS, k // COLUMNS**2])
    axes = semi_axes(kind, rng)
    room = 0.5 * PITCH - axes.max(axis=1, keepdims=True)
    x = (site + 0.5) * PITCH + room * rng.uniform(-1.0, 1.0, (COUNT, 3))
    v = rng.normal(0.0, 0.3, (COUNT, 3))
    write_packing(
        case.folder / f"{kind}.h5", x, axes, random_quaternions(rng, COUNT), v=v,
        omega=rng.normal(0.0, 100.0, (COUNT, 3)),
    )  # fmt: skip
    solid = 4.0 / 3.0 * np.pi * axes.prod(axis=1).sum()
    speed = (solid / (DENSE * EDGE**2) - HEIGHT) / T_END
    text = (case.folder / "deck.nml").read_text()
    words = {
        "PACK": kind,
        "EDGE": f"{EDGE:.9g}",
        "HEIGHT": f"{HEIGHT:.9g}",
        "SPEED": f"{speed:.9g}",
    }
    for word, value in words.items():
        text = text.replace(word, value)
    name = f"run_{kind}"
    (case.folder / f"{name}.nml").write_text(text.split("\n", 1)[1])
    case.run("talus-dem", f"{name}.nml")
    health = json.loads((case.folder / f"{name}_summary.json").read_text())["health"]
    case.metric(f"{kind}: late rebuilds of the list", health["late_rebuilds"], 0, 0)
    case.above(f"{kind}: rebuilds of the list", health["rebuilds"], 10, "the list is put to work")
    still = {
        -1: ((0, 0, 0), (0, 0, 1)), -2: ((0, 0, 0), (1, 0, 0)), -3: ((EDGE, 0, 0), (-1, 0, 0)),
        -4: ((0, 0, 0), (0, 1, 0)), -5: ((0, EDGE, 0), (0, -1, 0)),
    }  # fmt: skip
    return [
        all_pairs.compare(
            step, still | {-6: ((0, 0, HEIGHT + speed * step.time), (0, 0, -1))}, SLACK
        )
        for step in field_steps(case.folder / f"{name}.h5")
    ]


def run(case: Case) -> None:
    """Judge contacts missed and invented; draw how many there were."""
    fig, ax = case.figure()
    for seed, kind in enumerate(("benchmark", "triaxial", "needles_plates", "mixed_sizes"), 1):
        found = run_pack(case, kind, seed)
        case.metric(f"{kind}: contacts missed", sum(f["missed"] for f in found), 0, 0)
        case.metric(f"{kind}: contacts invented", sum(f["invented"] for f in found), 0, 0)
        dense = found[-1]["contacts"] / COUNT
        case.above(
            f"{kind}: contacts a grain at the end", dense, 1.0, "guard: there is a list to judge"
        )
        time = EVERY * np.arange(len(found))
        contacts = [f["contacts"] / COUNT for f in found]
        ax.plot(time, contacts, "o-", ms=4, label=kind.replace("_", " "))
    ax.set(xlabel="time [ms]", ylabel="contacts a grain, all found [-]")
    ax.legend()
    case.save(fig)
