"""The liquid's forces on the cone and the shaft of a penetrometer."""

from pathlib import Path

import numpy as np
from same_bits import judge

from talus.packing import FIXED, make_packing, write_h5
from talus.verification import Case, read_history

D, RADIUS, TOP = 1.0e-3, 2.0e-3, 0.016  # of grains and cone, height of the box [m]
HIGH = RADIUS / np.tan(np.pi / 6.0)  # of the cone
AREA = np.pi * RADIUS**2
AT = np.array([0.0061, 0.0058])  # the tip [m]
WEIGHT, PRESSURE = 9810.0, 700.0  # of water [N/m3], over the hydrostatic one [Pa]


def spheres(tip: float, axis: np.ndarray, path: Path, fixed: bool) -> None:
    """Write a lattice of spheres with room for the penetrometer."""
    places = np.meshgrid(*(np.arange(k) for k in (12, 12, 16)), indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    away = x - np.array([*AT, tip])
    along = away @ axis
    side = np.linalg.norm(away - np.outer(along, axis), axis=1)
    room = along * np.tan(np.pi / 6.0) + 0.51 * D / np.cos(np.pi / 6.0)
    inside = (along > -0.6 * D) & (side < np.minimum(room, RADIUS + 0.51 * D))
    kind = np.full((~inside).sum(), FIXED) if fixed else None
    write_h5(path, make_packing(x[~inside], np.full(((~inside).sum(), 3), 0.5 * D), kind=kind))


def parts(rows: dict, what: str) -> np.ndarray:
    """Return a force of tip and shaft, (rows, tip and shaft, 3) [N]."""
    return np.stack([np.stack([rows[f"{part}_{what}_{axis}"] for axis in "xyz"], 1)
                     for part in ("tip", "shaft")], 1)  # fmt: skip


def run(case: Case) -> None:
    """Hold it upright through the top and inclined under water; push it."""
    held(case, "upright", np.array([0.0, 0.0, 1.0]), 0.02)
    held(case, "inclined", np.array([0.15, -0.1, 1.0]), 4.0e-3)
    pushed(case)


def held(case: Case, name: str, axis: np.ndarray, shaft: float) -> None:
    """Compare the forces of still water, and of a pressure on top of it, with closed forms."""
    axis, tip = axis / np.linalg.norm(axis), 5.0e-3
    spheres(tip, axis, case.folder / "held.h5", True)
    words = {
        "TIP": f"{tip}", "AXIS": ", ".join(f"{a}" for a in axis), "SHAFT": f"{shaft}",
        "PRESSURE": f"{PRESSURE}",
    }  # fmt: skip
    text = (case.folder / "held.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_penetrometers.csv")
    up = np.array([0.0, 0.0, 1.0])
    through = name == "upright"  # the top, where the hydrostatic pressure is zero
    base = WEIGHT * (TOP - tip - HIGH * axis[2])
    length = TOP - tip - HIGH if through else shaft
    cone = base * AREA * axis + WEIGHT * AREA * HIGH / 3.0 * up
    rod = WEIGHT * AREA * length * up - base * AREA * axis
    lift = parts(rows, "lift")[-1]
    liquid = parts(rows, "liquid")[-1] / (PRESSURE * AREA)
    case.below(f"{name}, still water: cone, error",
               float(np.abs(lift[0] - cone).max() / np.linalg.norm(cone)), 1e-9)  # fmt: skip
    case.below(f"{name}, still water: shaft, error / force on the cone",
               float(np.abs(lift[1] - rod).max() / np.linalg.norm(cone)),
               0.02 if through else 1e-9)  # fmt: skip
    case.below(f"{name}, uniform pressure: cone / (p A), error",
               float(np.abs(liquid[0] - axis).max()), 1e-6)  # fmt: skip
    rest = up - axis if through else -axis
    case.below(f"{name}, uniform pressure: shaft / (p A), error",
               float(np.abs(liquid[1] - rest).max()), 1e-6)  # fmt: skip
    case.below(f"{name}, uniform pressure: at the shoulder, error",
               float(abs(rows["shoulder"][-1] / PRESSURE - 1.0)), 1e-6)  # fmt: skip


def pushed(case: Case) -> None:
    """Push it: forces of the parts add up to those of the whole; same bits."""
    axis = np.array([0.05, 0.0, 1.0])
    spheres(7.9e-3, axis / np.linalg.norm(axis), case.folder / "loose.h5", False)
    case.run("talus-dem", "pushed.nml", "--threads=1")
    rows = read_history(case.folder / "pushed_penetrometers.csv")
    tools = read_history(case.folder / "pushed_tools.csv")
    surfaces = read_history(case.folder / "pushed_surfaces.csv")

    def of_tools(what: str) -> np.ndarray:
        return np.stack([tools[f"{what}_{axis}"] for axis in "xyz"], 1)

    whole = {
        "liquid": of_tools("force") + of_tools("drag"),
        "lift": of_tools("lift"),
        "contacts": np.stack([surfaces[f"force_{k}"].reshape(-1, 3).sum(1) for k in "xyz"], 1),
    }
    for what, all_of_it in whole.items():
        found = parts(rows, what)
        off = float(np.abs(found.sum(1) - all_of_it).max() / np.abs(all_of_it).max())
        case.below(f"pushed, {what}: tip and shaft less the whole, relative", off, 1e-12)
        least = float(np.abs(found).max((0, 2)).min() / np.abs(all_of_it).max())
        case.above(f"pushed, {what}: both parts bear some of it", least, 0.01)
    keep = case.folder / "first.csv"
    keep.write_bytes((case.folder / "pushed_penetrometers.csv").read_bytes())
    judge(case, "pushed", "pushed, ")
    same = keep.read_bytes() == (case.folder / "pushed_penetrometers.csv").read_bytes()
    case.metric("pushed, restart: the same history", float(same), 1.0, 0.0)
    fig, axes = case.figure(figsize=(5.0, 3.6))
    for what, style in (("contacts", "-"), ("liquid", "--")):
        for k, part in enumerate(("tip", "shaft")):
            axes.plot(1e3 * rows["time"], parts(rows, what)[:, k, 2], style, color=f"C{k}",
                      label=f"{part}, {what}")  # fmt: skip
    axes.set(xlabel="time [ms]", ylabel="force along z [N]")
    axes.legend(fontsize=8)
    case.save(fig)
