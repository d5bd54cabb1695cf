"""A bed falls on a block that talus-fem, then a solver of another make computes."""

import sys
from pathlib import Path

import numpy as np
from bed import write_bed
from coupled import audit_of, write_deck

from talus.verification import Case

EXAMPLE = Path(__file__).parents[3] / "examples/12-own-solver/elastic_block.py"
COLUMNS = ("force_on_solid_x", "force_on_solid_y", "force_on_solid_z")


def run(case: Case) -> None:
    """Run both, compare the forces on the block over time."""
    write_bed(case.folder)
    command = f"launch = 'command', command = '{sys.executable} {EXAMPLE}'"
    solvers = {"talus-fem": ("fem", "solid.nml", "threads = 1"),
               "numpy": ("numpy", "block.toml", command)}  # fmt: skip
    audits = {}
    for name, (stem, deck, start) in solvers.items():
        deck = write_deck(case, f"{stem}.nml", "coupled.nml", solver=name, deck=deck, start=start)
        case.run("talus-couple", deck)
        audits[name] = audit_of(case, stem)
    forces = {name: np.column_stack([audit[c] for c in COLUMNS]) for name, audit in audits.items()}
    largest = np.abs(forces["talus-fem"]).max()
    case.above("largest force on the block [N]", largest, 0.1, "the bed has met the ghosts")
    off = np.abs(forces["numpy"] - forces["talus-fem"]).max() / largest
    case.metric("forces that differ, over the largest", off, 0.0, 1.0e-6,
                "round-off of two assemblies, grown by contacts that open and close")  # fmt: skip
    elastic = [audit["solid_elastic"] for audit in audits.values()]
    off = np.abs(elastic[1] - elastic[0]).max() / elastic[0].max()
    case.metric("elastic energy that differs, over the largest", off, 0.0, 1.0e-6, "the same")
    fig, ax = case.figure()
    time = 1e3 * audits["talus-fem"]["time"]
    ax.plot(time, -forces["talus-fem"][:, 2], "k-", label="talus-fem")
    ax.plot(time[::8], -forces["numpy"][::8, 2], "o", mfc="none", label="numpy at the port")
    ax.set(xlabel="time [ms]", ylabel="force on the block [N]")
    ax.legend()
    case.save(fig)
