"""What cases of a bar that is dragged through a bed read from their runs."""

from pathlib import Path
from types import ModuleType

import numpy as np

from talus.verification import field_steps, read_history


def judged(window: ModuleType, folder: Path) -> dict:
    """Force over the way [N] as in the case `window`; conversions, largest jump of energy [J]."""
    rows = read_history(folder / "grains_surfaces.csv")
    way, force = window.SPEED * rows["time"], -rows["force_x"]
    edges = np.arange(window.SKIP, window.WAY + 1e-9, window.BLOCK)
    pairs = zip(edges[:-1], edges[1:], strict=True)
    block = np.array([force[(way > a) & (way <= b)].mean() for a, b in pairs])
    told = read_history(folder / "coupled_conversions.csv")
    audit = read_history(folder / "coupled_audit.csv")
    booked = np.isin(np.arange(len(audit["time"])), np.searchsorted(audit["time"], told["time"]))
    energy = audit["total_energy"] - audit["conversion_energy"]
    steps = np.abs(np.diff(energy))[booked[1:] | booked[:-1]]
    return {
        "way": way, "curve": force, "force": float(block.mean()), "told": told,
        "error": float(block.std(ddof=1) / np.sqrt(len(block))), "jump": steps.max(),
        "scatter": float(force[way > window.SKIP].std()),
        "last": field_steps(folder / "grains.h5")[-1].grains,
    }  # fmt: skip
