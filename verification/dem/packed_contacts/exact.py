"""Contacts of packings: the same forces, rest that lasts; what is lost without them."""

from pathlib import Path

import numpy as np

from talus.compare import max_of
from talus.generate import cloud
from talus.packing import FIXED, FREE, Packing, read_h5, write_h5
from talus.verification import Case, field_steps, read_history

BOX, GRAINS, AXES = (0.020, 0.020, 0.040), 500, (1.25e-3, 1.0e-3, 0.75e-3)
SHELL = 2.0e-3  # thickness of the layer that is fixed, from walls and top [m]
WAYS = {"again": "packing as it is", "other": "grains numbered anew", "bare": "without contacts"}


def run(case: Case) -> None:
    """Press, fix the outside, come to rest; go on from that packing in three ways."""
    bed = cloud(np.ones(GRAINS), np.array(BOX), np.array(AXES), seed=3)
    write_h5(case.folder / "cloud.h5", bed)
    case.run("talus-dem", "press.nml", "--threads=1")
    write_h5(case.folder / "shell.h5", shelled(read_h5(case.folder / "pressed.h5")))
    case.run("talus-dem", "rest.nml", "--threads=1")
    rest = read_h5(case.folder / "rest_pack.h5")
    wanted = forces(case.folder / "rest.h5", -1)
    mean = float(np.mean([np.linalg.norm(force) for force in wanted.values()]))
    other = np.random.default_rng(1).permutation(rest.id)
    fig, ax = case.figure()
    for way, text in WAYS.items():
        packing = rest.numbered(other) if way == "other" else rest.take(np.arange(rest.count))
        if way == "bare":
            packing.pairs, packing.tangential = packing.pairs[:0], packing.tangential[:0]
        old = dict(zip(packing.id.tolist(), rest.id.tolist(), strict=True))
        start, moved, times, kinetic = go_on(case, way, packing)
        changed = difference(start, old, wanted) / mean
        case_rows(case, way, text, changed, moved / (2.0 * AXES[0]))
        ax.semilogy(1e3 * times[1:], kinetic[1:], label=text)
    ax.set(xlabel="time [ms]", ylabel="kinetic energy [J]")
    ax.legend(fontsize=8)
    case.save(fig)


def case_rows(case: Case, way: str, text: str, changed: float, moved: float) -> None:
    """What is asked of a way to go on."""
    if way == "bare":
        case.above(f"largest change of a contact force / mean, {text}", changed, 0.1)
        case.above(f"largest displacement / diameter, {text}", moved, 1e-4)
        return
    case.below(f"largest change of a contact force / mean, {text}", changed, 1e-6, "unrest left")
    case.below(f"largest displacement / diameter, {text}", moved, 1e-6, "a millionth of a diameter")


def shelled(bed: Packing) -> Packing:
    """The bed with its outer grains fixed."""
    top = bed.x[:, 2].max()
    lower, upper = np.full(3, SHELL), np.array([BOX[0] - SHELL, BOX[1] - SHELL, top - SHELL])
    inside = np.all((bed.x > lower) & (bed.x < upper), axis=1)
    bed.kind = np.where(inside, FREE, FIXED)
    bed.v[:], bed.omega[:] = 0.0, 0.0
    return bed


def go_on(case: Case, way: str, packing: Packing) -> tuple[dict, float, np.ndarray, np.ndarray]:
    """Forces at the start, largest displacement [m], times [s] and kinetic energies [J]."""
    write_h5(case.folder / f"{way}_pack.h5", packing)
    text = (case.folder / "again.nml").read_text().replace("again_pack", f"{way}_pack")
    (case.folder / f"{way}.nml").write_text(text)
    case.run("talus-dem", f"{way}.nml", "--threads=1")
    states = field_steps(case.folder / f"{way}.h5")
    moved = np.linalg.norm(states[-1].grains["x"] - states[0].grains["x"], axis=1).max()
    rows = read_history(case.folder / f"{way}_energy.csv")
    return forces(case.folder / f"{way}.h5", 0), float(moved), rows["time"], rows["kinetic"]


def forces(path: Path, step: int) -> dict[tuple[int, int], np.ndarray]:
    """Forces of contacts on the second grain [N], by ids."""
    contacts = field_steps(path)[step].contacts
    return dict(zip(map(tuple, contacts["ids"].tolist()), contacts["force"], strict=True))


def difference(start: dict, old: dict[int, int], wanted: dict) -> float:
    """Largest difference of a contact force from the wanted one [N]."""
    worst = 0.0 if len(start) == len(wanted) else np.inf
    for (first, second), force in start.items():
        pair, sign = (old[first], old[second]), 1.0
        if pair[0] > pair[1]:
            pair, sign = pair[::-1], -1.0
        worst = max_of(worst, float(np.linalg.norm(sign * force - wanted.get(pair, np.inf))))
    return worst
