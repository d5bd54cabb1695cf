"""A sealed sample under cell pressure against a dry one at constant volume."""

import numpy as np
from matplotlib.axes import Axes

from talus.generate import cloud
from talus.packing import write_h5
from talus.specimens import Specimen, read_specimen
from talus.verification import Case, read_history

PRESSURE, SEED = 100.0e3, 5
TENSION = 20.0e3  # at which the liquid parts [Pa]


def run(case: Case) -> None:
    """Press a cloud, shear it twice, compare the paths."""
    sizes = np.random.default_rng(SEED).uniform(0.8, 1.2, 700)
    write_h5(case.folder / "cloud.h5", cloud(sizes, np.full(3, 0.024), np.full(3, 1e-3), seed=2))
    case.run("talus-dem", "press.nml", "--threads=1")
    walls = read_history(case.folder / "press_walls.csv")
    last = walls["time"] == walls["time"].max()
    for name in ("dry", "wet", "cavitated"):
        text = (case.folder / f"{name}.nml").read_text()
        for word, axis, wall in (("EAST", "x", 1), ("NORTH", "y", 3), ("TOP", "z", 5)):
            text = text.replace(word, repr(float(walls[axis][last][wall])))
        (case.folder / f"{name}.nml").write_text(text)
        case.run("talus-dem", f"{name}.nml", "--threads=1")
    dry, wet = (read_specimen(case.folder / f"{name}_walls.csv") for name in ("dry", "wet"))
    strain = 1.0 - wet.length[:, 2] / wet.length[0, 2]
    paths = [invariants(test.stress) for test in (dry, wet)]
    early = strain <= 0.01
    for k, what in enumerate(("p'", "q")):
        off = float(np.abs(paths[0][k] - paths[1][k])[early].max() / PRESSURE)
        case.below(f"{what} to 1 % of strain, difference / p'0", off, 0.01)
    rows = read_history(case.folder / "wet_pore.csv")
    pore = np.interp(wet.time, rows["time"], rows["pressure_x1"])
    total = wet.stress[:, :2].mean(axis=1) + pore
    off = float(abs(total[-1] / PRESSURE - 1.0))
    case.below("total stress sideways at the end, error", off, 0.02)
    case.above("largest pore pressure / cell pressure", float(pore.max() / PRESSURE), 0.1)
    case.below("pore pressure at the end / cell pressure", float(pore[-1] / PRESSURE), 0.0)
    case.below("liquid that came from nowhere / pores", float(rows["balance"].max()), 1e-12)
    energy = read_history(case.folder / "wet_energy.csv")
    case.below("closure of the ledger", float(energy["relative_closure"][-1]), 1e-4)
    fig, axes = case.figure(figsize=(5.6, 4.0))
    axes.plot(1e-3 * paths[0][0], 1e-3 * paths[0][1], label="dry, constant volume")
    axes.plot(1e-3 * paths[1][0], 1e-3 * paths[1][1], ".", ms=4, label="sealed, effective")
    axes.plot(1e-3 * (paths[1][0] + pore), 1e-3 * paths[1][1], ":", label="sealed, total")
    axes.set(xlabel="mean stress [kPa]", ylabel="q [kPa]")
    judge_cavities(case, dry, axes)
    axes.legend(fontsize=8)
    case.save(fig)


def judge_cavities(case: Case, dry: Specimen, axes: Axes) -> None:
    """Judge a sealed sample whose liquid parts, and is joined when the lid comes back."""
    wet = read_specimen(case.folder / "cavitated_walls.csv")
    rows = read_history(case.folder / "cavitated_pore.csv")
    strain = 1.0 - wet.length[:, 2] / wet.length[0, 2]
    paths = [invariants(test.stress) for test in (dry, wet)]
    down = len(dry.time)
    early = strain[:down] <= 0.005
    for k, what in enumerate(("p'", "q")):
        off = float(np.abs(paths[0][k] - paths[1][k][:down])[early].max() / PRESSURE)
        case.below(f"parting: {what} to 0.5 % of strain, difference / p'0", off, 0.01)
    turned = int(np.argmax(strain))
    back = wet.time[turned]
    most = np.maximum(np.abs(rows["least_pressure"]), np.abs(rows["most_pressure"]))
    whole = (rows["cavities"] == 0.0) & (rows["time"] > 0.0) & (rows["time"] < back)
    share = float((rows["alternating"][whole] / most[whole]).max())
    case.below("parting: what alternates before / largest pressure", share, 0.01)
    off = float(abs(rows["least_pressure"].min() / TENSION + 1.0))
    case.below("parting: least pressure / tension, error", off, 1e-9)
    held = float(np.interp(back, rows["time"], rows["pressure_x1"]) / TENSION)
    case.metric("parting: pressure at the side when the lid turns / tension", held, -1.0, 0.02)
    capped = float(paths[1][1][turned] / paths[0][1][-1])
    case.below("parting: q then / at constant volume", capped, 0.9)
    left = float(abs(rows["content"][-1] / rows["content"].min()))
    case.below("parting: what the liquid lacks in the end / lacked at most", left, 0.2)
    off = float(rows["balance"].max())
    case.below("parting: liquid that came from nowhere / pores", off, 1e-12)
    closure = float(read_history(case.folder / "cavitated_energy.csv")["relative_closure"][-1])
    case.below("parting: closure of the ledger", closure, 1e-4)
    part = slice(turned + 1)
    axes.plot(1e-3 * paths[1][0][part], 1e-3 * paths[1][1][part], label="parts at 20 kPa")


def invariants(stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean stress and axial stress less the lateral one [Pa]."""
    return stress.mean(axis=1), stress[:, 2] - stress[:, :2].mean(axis=1)
