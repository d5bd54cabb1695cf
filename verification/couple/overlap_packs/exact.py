"""Random packs of three sizes in a box of elements against the same packs without elements."""

import numpy as np
from cut_pack import STATES, errors, make_cell, overlap, write_overlap

from talus.verification import Case

PACKS = ((2, 1), (3, 1), (3, 2), (4, 3))  # elements of free grains a side, seed
LARGE = 3  # elements a side from which on there are grains 3 d off all faces


def run(case: Case) -> None:
    """Run all packs in both states; judge each stress, and the mean motion of the larger packs."""
    table: list[tuple[int, str, dict]] = []
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
                case.below(f"{label}: stress 1 d inside", found["stress"], 0.02)
            if n == PACKS[-1][0]:
                case.below(f"{label}: stress of all", found["stress of all"], 0.02)
    whole = [np.mean([f["motion of all"] for n, _, f in table if n == size]) for size in (2, 4)]
    case.below("motion of all, 4 elements over 2", float(whole[1] / whole[0]), 0.8, "the surface")
    for what, limit in (("motion", 0.35), ("motion 2 d inside", 0.25)):
        mean = np.mean([found[what] for n, _, found in table if n >= LARGE])
        case.below(f"mean of packs of {LARGE} and more: {what}", float(mean), limit)
    draw(case, table)


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
    right.legend(fontsize=7, loc="center left")
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
