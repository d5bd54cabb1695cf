"""Critical state of a pack of spheres under simple shear at constant pressure."""

from pathlib import Path

import numpy as np

from talus.generate import cloud
from talus.packing import read_h5, write_h5
from talus.verification import Case, field_steps, read_history

COUNT, BOX, RADIUS, SEED = 300, 18.5e-3, 1.0e-3, 7
PRESSURE, RATE = 20.0e3, 2.0  # [Pa], [1/s]
STARTS = {"dense": (0.0, 3.0), "loose": (0.5, 2.0)}  # friction of the compression, shear
RATIO, SOLID = 0.382, 0.587  # published, friction 0.5
PLATEAU = 1.0  # from this shear on


def run(case: Case) -> None:
    """Compress with and without friction, shear both, compare the plateaus."""
    pack = cloud(np.ones(COUNT), np.full(3, BOX), np.full(3, RADIUS), seed=SEED, periodic=True)
    write_h5(case.folder / "cloud.h5", pack)
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for name, (friction, shear) in STARTS.items():
        simulate(case, name, friction, shear)
        gamma, ratio, solid = curves(case, name)
        late = gamma >= PLATEAU
        case.metric(f"shear stress / pressure, {name}", float(ratio[late].mean()), RATIO, 0.03,
                    "plateau, mean over a shear of 1 and more")  # fmt: skip
        case.metric(f"solid fraction, {name}", float(solid[late].mean()), SOLID, 0.012)
        ax.plot(gamma, ratio, label=f"{name} at the start")
        ax2.plot(gamma, solid, label=f"{name} at the start")
    ax.axhline(RATIO, color="0.5", lw=0.8, ls="--")
    ax2.axhline(SOLID, color="0.5", lw=0.8, ls="--")
    ax.set(xlabel="shear [-]", ylabel="shear stress over pressure [-]")
    ax2.set(xlabel="shear [-]", ylabel="solid fraction [-]")
    ax.legend(fontsize=8)
    case.save(fig)


def simulate(case: Case, name: str, friction: float, shear: float) -> None:
    """Compress and shear; judge pressure, momentum and ledgers."""
    words = {"FRICTION": f"{friction}", "PACK": name, "T_END": f"{shear / RATE}", "RATE": f"{RATE}"}
    for part in ("compress", "shear"):
        deck = (case.folder / f"{part}.nml").read_text()
        for word, value in words.items():
            deck = deck.replace(word, value)
        (case.folder / f"{part}_{name}.nml").write_text(deck)
        case.run("talus-dem", f"{part}_{name}.nml", "--threads=1")
        if part == "compress":
            stop(case.folder / f"{name}.h5")
        energy = read_history(case.folder / f"{part}_{name}_energy.csv")
        closure = float(energy["relative_closure"][-1])
        case.below(f"ledger, {part}, {name}", closure, 1e-4)
    rows = read_history(case.folder / f"compress_{name}_cell.csv")
    final = field_steps(case.folder / f"shear_{name}.h5")[-1].grains
    size = np.linalg.norm(final["v"].sum(axis=0)) / np.linalg.norm(final["v"], axis=1).sum()
    case.below(f"momentum relative to the flow, {name}", float(size), 1e-9)
    rows = read_history(case.folder / f"shear_{name}_cell.csv")
    p = -(rows["stress_xx"] + rows["stress_yy"] + rows["stress_zz"]) / 3.0
    late = rows["deform_xz"] > 0.5
    case.metric(f"mean pressure / target, {name}", float(p[late].mean() / PRESSURE), 1.0, 1e-3)


def stop(path: Path) -> None:
    """Set all velocities of a packing to zero, so that its momentum is zero."""
    packing = read_h5(path)
    packing.v[:], packing.omega[:] = 0.0, 0.0
    write_h5(path, packing)


def curves(case: Case, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shear, shear stress over pressure, solid fraction of a run."""
    rows = read_history(case.folder / f"shear_{name}_cell.csv")
    p = -(rows["stress_xx"] + rows["stress_yy"] + rows["stress_zz"]) / 3.0
    solid = COUNT * 4.0 / 3.0 * np.pi * RADIUS**3 / rows["volume"]
    shear = RATE * rows["time"]
    return shear, 0.5 * (rows["stress_xz"] + rows["stress_zx"]) / p, solid
