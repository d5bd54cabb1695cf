"""Normal stresses of tiles before and after the cycles of strain, and their edges."""

import numpy as np

from talus.cli import main
from talus.compare import max_of
from talus.packing import read_packing
from talus.tile_check import tile_facts
from talus.tile_stamp import read_stamp
from talus.verification import Case, read_history

GRAINS = "--count 400 --axes 1e-3 1e-3 1e-3 --spread 0.2 --young 2.9e9 --least-edges 6"
STRESS, ASPECT = 100e3, (1.0, 1.0, 1.25)
SEEDS, MAKING = (1, 2), (0.1, 0.3)
GIVEN = (80e3, 100e3, 120e3)


def run(case: Case) -> None:
    """Make eight tiles at one stress and one at three; judge stresses and edges."""
    before, after, edges = [], [], []
    for making in MAKING:
        for seed in SEEDS:
            name = f"tile_{making}_{seed}"
            aspect = " ".join(f"{a}" for a in ASPECT)
            words = f"--stress {STRESS} --making-friction {making} --seed {seed} --aspect {aspect}"
            normal, edge = made(case, name, words)
            rows = read_history(case.folder / f"{name}_stages" / "rest_cell.csv")
            before.append(-np.array([rows[f"stress_{a}{a}"][-1] for a in "xyz"]) / STRESS)
            after.append(normal / STRESS)
            edges.append(max_of(np.abs(edge / edge[0] / ASPECT - 1.0)))
    edges = np.array(edges)
    case.above("normal stresses without cycles off their mean, largest",
               spread(before), 0.02, "why it is needed")  # fmt: skip
    case.below("normal stresses off the wanted one, largest of all tiles",
               max_of(np.abs(np.array(after) - 1.0)), 0.01)  # fmt: skip
    kept = edges < 1e-6
    case.above("tiles whose edges keep their ratio to 1e-6, part", float(kept.mean()), 0.6)
    case.below("edges off their ratio in the others", max_of([0.0, *edges[~kept]]), 0.01)
    given = " ".join(f"{p}" for p in GIVEN)
    normal, edge = made(case, "given", f"--stresses {given} --making-friction 0.1 --seed 1")
    case.below("three given stresses, largest error / mean",
               max_of(np.abs(normal - GIVEN)) / np.mean(GIVEN), 0.01)  # fmt: skip
    draw(case, np.array(before), np.array(after))


def made(case: Case, name: str, words: str) -> tuple[np.ndarray, np.ndarray]:
    """Make a tile; return its normal stresses by a run of it [Pa], and its edges [m]."""
    path = case.folder / f"{name}.h5"
    if main(f"pack tile {GRAINS} {words} -o {path}".split()) != 0:
        raise RuntimeError(f"{path} was not made")
    tile = read_packing(path)
    facts = tile_facts(tile, read_stamp(path))
    return facts["normal stresses over the mean"] * facts["mean stress [Pa]"], np.diag(tile.cell)


def spread(parts: list[np.ndarray]) -> float:
    """Largest difference of normal stresses from their mean, over it."""
    return max_of(np.abs(np.array(part) / np.mean(part) - 1.0).max() for part in parts)


def draw(case: Case, before: np.ndarray, after: np.ndarray) -> None:
    """Normal stresses of all tiles before and after."""
    fig, ax = case.figure(figsize=(6.0, 3.8))
    place = np.arange(len(before))
    for k, (name, mark) in enumerate(zip(("xx", "yy", "zz"), "osD", strict=True)):
        ax.plot(
            place - 0.15, before[:, k], mark, mfc="none", color=f"C{k}", label=f"{name} pressed"
        )
        ax.plot(place + 0.15, after[:, k], mark, color=f"C{k}", label=f"{name} after cycles")
    ax.axhline(1.0, color="black", lw=0.8)
    ax.set(xlabel="tile [-]", ylabel="normal stress / wanted [-]", xticks=place)
    ax.legend(fontsize=7, ncols=2)
    case.save(fig)
