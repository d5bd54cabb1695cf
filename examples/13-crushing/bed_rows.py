"""Rows of a bed that is compressed, as the studies judge them."""

from pathlib import Path

import numpy as np

from talus.verification import read_history

STRENGTH, DENSITY = 30.0e6, 2650.0  # [Pa], [kg/m3]
PARTS = (0.002, 0.01, 0.05, 0.2, 0.4)  # of the grains, broken


def compression(run: Path, area: float, count: int) -> dict[str, np.ndarray]:
    """Return stress over strength, its largest so far, closure, void ratio, events, slope.

    Area [m2] and number of grains are those of the bed; works [J] are `boundary`, `growth`.
    """
    walls = read_history(run / "compress_walls.csv")
    grading = read_history(run / "compress_grading.csv")
    broken = read_history(run / "compress_breakage.csv")
    energy = read_history(run / "compress_energy.csv")
    n = min(len(grading["time"]), len(broken["time"]), len(walls["time"]) // 2,
            len(energy["time"]))  # fmt: skip
    floor, top = walls["wall"] == 1, walls["wall"] == 2
    stress = -walls["force_z"][floor][:n] / area / STRENGTH
    height = walls["z"][top][:n]
    work = {name: energy.get(name, np.zeros(n))[:n] for name in ("boundary", "growth")}
    return work | {
            "closure": 1.0 - height / height[0], "broken": broken["broken"][:n],
            "stress": stress, "most": np.maximum.accumulate(stress),
            "void_ratio": height * area * DENSITY / grading["mass"][:n] - 1.0,
            "events": broken["broken"][:n] / count, "slope": grading["slope"][:n]}  # fmt: skip


def at_parts(rows: dict[str, np.ndarray]) -> list[str]:
    """Return the largest stress so far when so many have broken."""
    found = []
    for part in PARTS:
        k = int(np.argmax(rows["events"] >= part))
        found.append(f"{rows['most'][k]:6.3f}" if rows["events"][k] >= part else "     -")
    return found


def slope_of(rows: dict[str, np.ndarray]) -> str:
    """Return the slope of log e over log stress, where stress is 1.05 times that of yield or more.

    Yield: the largest stress so far when a twentieth has broken; a range of less than a fifth of
    the stress gives none.
    """
    most = rows["most"]
    start = 1.05 * most[np.argmax(rows["events"] >= 0.05)]
    beyond = most >= start
    if not beyond.any() or most[-1] < 1.2 * start:
        return "    -"
    line = np.polyfit(np.log(most[beyond]), np.log(rows["void_ratio"][beyond]), 1)
    return f"{line[0]:5.2f}"


def table(runs: dict[str, dict], width: int) -> list[str]:
    """Return the lines of the table of all runs."""
    lines = ["largest stress / strength when so many of the grains have broken",
             f"{'run':{width}s}" + "".join(f" {part:6.3f}" for part in PARTS)
             + "   at the end: stress events slope; log e/log stress"]  # fmt: skip
    for name, rows in runs.items():
        end = [rows[key][-1] for key in ("most", "events", "slope")]
        lines.append(f"{name:{width}s} " + " ".join(at_parts(rows)) + f"   {end[0]:16.3f} "
                     f"{end[1]:6.2f} {end[2]:5.2f}       {slope_of(rows)}")  # fmt: skip
    return lines
