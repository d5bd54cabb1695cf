"""The three containers of the benchmark, fallen and pushed: are all contacts found?"""

import json

import all_pairs
import numpy as np

from talus import generate
from talus.packing import read_packing, write_h5
from talus.verification import Case, field_steps

SLACK = 1.0e-12  # of the size; overlaps below it are rounding
GUARD = 40  # rows of fixed spheres above the walls while the grains fall


def judge(case: Case, name: str, deck: str) -> list[int]:
    """Compare all outputs of a run with brute force; return the contacts at each."""
    case.run("talus-dem", f"{deck}.nml")
    summary = json.loads((case.folder / f"{deck}_summary.json").read_text())
    found = [all_pairs.compare(step, {}, SLACK) for step in field_steps(case.folder / f"{deck}.h5")]
    case.metric(f"{name}, {deck}: contacts missed", sum(f["missed"] for f in found), 0, 0)
    case.metric(f"{name}, {deck}: contacts invented", sum(f["invented"] for f in found), 0, 0)
    case.metric(f"{name}, {deck}: late rebuilds", summary["health"]["late_rebuilds"], 0, 0)
    return [f["contacts"] for f in found]


def run(case: Case) -> None:
    """Fall and push in each container; draw the numbers of contacts."""
    fig, ax = case.figure()
    for name in ("small", "medium", "large"):
        write_h5(case.folder / "start.h5", generate.penetration(name, 1, guard_rows=GUARD))
        contacts = judge(case, name, "fall")
        fallen = read_packing(case.folder / "fallen.h5")
        if "guard" in fallen.groups:
            fallen = fallen.take(~np.isin(fallen.id, fallen.groups["guard"]))
        write_h5(case.folder / "tool.h5", generate.add_tool(fallen, generate.TOOL_AXES, None))
        contacts += judge(case, name, "push")
        free = int((fallen.kind == 0).sum())
        dense = contacts[-1] / free
        case.above(f"{name}: contacts a free grain at the end", dense, 2.0, "a dense bed has 2.5")
        ax.plot([c / free for c in contacts], "o-", ms=4, label=f"{name}, {free} free grains")
    ax.set(xlabel="output: fall, then push [-]", ylabel="contacts a free grain, all found [-]")
    ax.legend()
    case.save(fig)
