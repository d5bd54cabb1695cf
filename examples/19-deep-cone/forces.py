"""The force on the cone over its way."""

from pathlib import Path

import numpy as np
from plans import Plan

from talus.verification import read_history


def force_curve(stem: Path | str, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return the way [mm] and the force on tip, cone and shaft [N], means over 1 mm, NaN if none."""
    rows = read_history(Path(f"{stem}_surfaces.csv"))
    time, at = np.unique(rows["time"], return_inverse=True)
    way, force = 1e3 * plan.speed * time, np.bincount(at, rows["force_z"])
    edges = np.arange(0.0, 1e3 * plan.stroke + 0.5)
    step = np.digitize(way, edges)
    means = [force[step == k].mean() if (step == k).any() else np.nan for k in range(1, len(edges))]
    return edges[1:] - 0.5, np.array(means)
