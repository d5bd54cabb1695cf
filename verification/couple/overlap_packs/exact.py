"""Random packs of three sizes in a box of elements against the same packs without elements."""

import numpy as np
from cut_pack import STATES, Cell, errors, make_cell, overlap, write_overlap

from talus.verification import Case

PACKS = ((2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (3, 3), (4, 3), (4, 4))  # elements a side, seed
LARGE = 3  # elements a side from which on there are grains 3 d off all faces
SINGLE = 0.03  # of the stress, for one pack in one state
SHARED = ((3, 1), (4, 4))  # packs that also run without contacts between ghosts
# the gates of ramps times 0.33 / 0.27, what both gave in a slab, in an independent program
MOTION_SHARED = {"motion": 0.35 * 0.33 / 0.27, "motion 2 d inside": 0.25 * 0.33 / 0.27}


def run(case: Case) -> None:
    """Run all packs in both states; judge the means of each size, and roughly each pack."""
    table: list[tuple[int, str, dict]] = []
    shared: list[dict] = []
    for n, seed in PACKS:
        cell = make_cell(case, n, seed)
        write_overlap(case, cell)
        for state in STATES:
            rest = overlap(case, cell, state)
            found = errors(case, cell, state)
            table.append((n, state, found))
            label = f"{n} elements, seed {seed}, {state}"
            case.below(f"{label}: not balanced / contact force", rest, 1e-5)
            if n >= LARGE:
                case.below(f"{label}: stress 1 d inside", found["stress"], SINGLE)
        if (n, seed) in SHARED:
            shared += without_ghost_contacts(case, cell, f"{n} elements, seed {seed}")
    large = {n for n, _ in PACKS if n >= LARGE}
    for n in sorted(large):
        case.below(f"{n} elements: stress 1 d inside, mean", mean(table, {n}, "stress"), 0.02)
    whole = max(large)
    case.below(
        f"{whole} elements: stress of all, mean", mean(table, {whole}, "stress of all"), 0.02
    )
    ratio = mean(table, {4}, "motion of all") / mean(table, {2}, "motion of all")
    case.below("motion of all, 4 elements over 2", ratio, 0.8, "the surface")
    for what, limit in (("motion", 0.35), ("motion 2 d inside", 0.25)):
        case.below(f"mean of packs of {LARGE} and more: {what}", mean(table, large, what), limit)
    for what, limit in (("stress", 0.02), *MOTION_SHARED.items()):
        value = float(np.mean([found[what] for found in shared]))
        case.below(f"mean of two packs with shares: {what}", value, limit)
    draw(case, table)


def without_ghost_contacts(case: Case, cell: Cell, label: str) -> list[dict]:
    """Run a pack whose ghosts' contacts with one another do not count, in both states."""
    rows = []
    for state in STATES:
        rest = overlap(case, cell, state, "share")
        rows.append(errors(case, cell, state))
        case.below(f"{label}, {state}, shares: not balanced / contact force", rest, 1e-5)
    return rows


def mean(table: list[tuple[int, str, dict]], sizes: set[int], what: str) -> float:
    """Return the mean of a quantity over all packs of the sizes and both states."""
    return float(np.mean([found[what] for n, _, found in table if n in sizes]))


def draw(case: Case, table: list[tuple[int, str, dict]]) -> None:
    """Draw the motion's error by depth, and stress and motion of the whole box by its size."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for n, state, found in table:
        colour, mark = f"C{n - 2}", "o" if state == "compressed" else "s"
        y = found["profile"]
        left.plot(0.5 * np.arange(len(y)) + 0.25, y, mark + "-", color=colour, ms=3, lw=0.8)
        right.plot(n - 0.03, found["stress of all"], mark, color="C0", mfc="none")
        right.plot(n, found["stress"], mark, color="C0")
        right.plot(n - 0.03, found["motion of all"], mark, color="C1", mfc="none")
        right.plot(n + 0.03, found["motion"], mark, color="C1")
    for n in sorted({n for n, _, _ in table}):
        left.plot([], [], color=f"C{n - 2}", label=f"{n} elements a side")
    for mark, state in (("o", "compressed"), ("s", "sheared")):
        left.plot([], [], mark, color="k", ms=3, label=state)
    right.plot([], [], "o", color="k", label="1 d inside (stress), across a pair of faces (motion)")
    right.plot([], [], "o", color="k", mfc="none", label="of all")
    left.legend(fontsize=7)
    right.legend(fontsize=7, loc=(0.03, 0.15))
    left.axhline(0.25, color="k", lw=0.8)
    left.set(
        xlabel="depth below the faces / d [-]",
        ylabel="error / non-affine motion [-]",
        ylim=(0, None),
    )
    right.set_yscale("log")
    right.axhline(0.02, color="C0", lw=0.8)
    right.axhline(0.35, color="C1", lw=0.8)
    right.set(xlabel="elements of free grains a side [-]", ylabel="stress (blue), motion (red) [-]")
    case.save(fig)
