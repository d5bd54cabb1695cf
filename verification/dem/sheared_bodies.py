"""Bodies in a periodic cell under simple shear at constant pressure: strength, stress and work."""

from dataclasses import dataclass

import numpy as np

from talus.packing import Packing, read_h5, write_h5
from talus.verification import Case, field_steps, read_history


@dataclass
class Shear:
    """Rate [1/s], shear at the end and where the plateau begins."""

    rate: float
    end: float
    plateau: float


def simulate(case: Case, name: str, cloud: Packing, shear: Shear) -> dict[str, np.ndarray]:
    """Compress, stop, shear; return the rows of the cell."""
    write_h5(case.folder / f"{name}_cloud.h5", cloud)
    words = {"NAME": name, "T_END": f"{shear.end / shear.rate}", "RATE": f"{shear.rate}"}
    for part in ("compress", "shear"):
        deck = (case.folder / f"{part}.nml").read_text()
        for word, value in words.items():
            deck = deck.replace(word, value)
        (case.folder / f"{part}_{name}.nml").write_text(deck)
        case.run("talus-dem", f"{part}_{name}.nml", "--threads=1")
        if part == "compress":
            pack = read_h5(case.folder / f"{name}.h5")
            pack.v[:], pack.omega[:] = 0.0, 0.0
            pack.clumps.v[:], pack.clumps.omega[:] = 0.0, 0.0
            write_h5(case.folder / f"{name}.h5", pack)
    return read_history(case.folder / f"shear_{name}_cell.csv")


def work_of_stress(rows: dict[str, np.ndarray]) -> float:
    """Integral of V sigma : L over the run [J]; trapezoids of the history."""
    power = np.zeros(len(rows["time"]))
    for i in "xyz":
        for j in "xyz":
            power += rows["volume"] * rows[f"stress_{i}{j}"] * rows.get(f"rate_{i}{j}", 0.0)
    return float(np.trapezoid(power, rows["time"]))


def judge_kind(case: Case, name: str, cloud: Packing, shear: Shear, axis: object) -> float:
    """Judge work, symmetry and momentum of a kind of bodies; plot and return its stress ratio."""
    rows = simulate(case, name, cloud, shear)
    p = -(rows["stress_xx"] + rows["stress_yy"] + rows["stress_zz"]) / 3.0
    gamma = shear.rate * rows["time"]
    late = gamma >= shear.plateau
    ratio = 0.5 * (rows["stress_xz"] + rows["stress_zx"]) / p
    skew = (rows["stress_xz"] - rows["stress_zx"])[late].mean() / p[late].mean()
    case.below(f"asymmetry of the stress / pressure, {name}", float(abs(skew)), 5e-3,
               "moments balance in the mean")  # fmt: skip
    energy = read_history(case.folder / f"shear_{name}_energy.csv")
    done = work_of_stress(rows) / float(energy["boundary"][-1])
    case.metric(f"work of the stress / of the flow, {name}", done, 1.0, 0.02,
                "sampled each ms; kinetic stress")  # fmt: skip
    case.below(f"ledger, {name}", float(energy["relative_closure"][-1]), 1e-4)
    end = field_steps(case.folder / f"shear_{name}.h5")[-1].clumps
    size = np.linalg.norm(end["v"].sum(axis=0)) / np.linalg.norm(end["v"], axis=1).sum()
    case.below(f"momentum relative to the flow, {name}", float(size), 1e-9)
    axis.plot(gamma, ratio, label=name)
    return float(ratio[late].mean())
