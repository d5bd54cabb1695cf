"""A column of grains that break in motion: what the micro-inertia of whole grains does."""

import numpy as np
from cube import judge_ledger, judge_restart
from solid import save

from talus.mesh import Mesh, structured
from talus.verification import Case, field_steps, read_history

LENGTH, DENSITY = 1.0, 2000.0
SPEED = np.sqrt((32.0e6 + 80.0e6) / DENSITY)  # of a wave of whole grains, chi held [m/s]
TRANSIT = LENGTH / SPEED
INERTIA = 4.0e-4  # [m2], a fifth of the square of the length of the gradient's moduli
RUNS = {"twenty": (20, 20), "hundred": (100, 5)}  # transits, steps of each
LIMITS = {"twenty": (1e-3, 3e-3), "hundred": (1e-4, 3e-4)}  # of mean force and dissipation

Found = dict[str, str | float | np.ndarray]


def write_column(case: Case) -> None:
    """Write eight cubes above each other."""
    side = np.array([0.0, LENGTH / 8])
    x, cells = structured((side, side, np.linspace(0.0, LENGTH, 9)))
    mesh = Mesh(x, cells, {"all": np.arange(len(cells))})
    mesh.nodes["all_nodes"] = np.arange(len(x))
    mesh.nodes["base"] = np.flatnonzero(x[:, 2] == 0.0)
    mesh.nodes["top"] = np.flatnonzero(np.isclose(x[:, 2], LENGTH))
    save(mesh, case.folder / "column.h5")


def run_column(case: Case, name: str, inertia: float) -> Found:
    """Run a column; return its stem, force on the base [N], breakage and dissipation [J]."""
    transits, steps = RUNS[name]
    end = float(transits * TRANSIT)
    words = {"NAME": name, "END": repr(end), "INERTIA": repr(inertia)}
    words |= {"STEP": repr(float(TRANSIT / steps)), "ROW": repr(float(TRANSIT / 4))}
    words |= {"HALF": repr(0.5 * end)}
    text = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    stem = f"{name}_{inertia:g}"
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    energy = judge_ledger(case, f"{name}, {inertia:g} m2", stem, -1e-9, 1e-7)
    warned = "W306" in (case.folder / f"{stem}.log").read_text()
    case.metric(f"{name}, {inertia:g} m2: warned of", float(warned), 1.0, 0)
    force = read_history(case.folder / f"{stem}_reactions.csv")
    last = field_steps(case.folder / f"{stem}.h5")[-1].solid["breakage"]
    return {"stem": stem, "time": force["time"], "force": force["base z"],
            "crushed": float(last.mean()), "work": float(energy["plastic"][-1])}  # fmt: skip


def run(case: Case) -> None:
    """Judge what a quarter of the micro-inertia changes; plot the forces on the base."""
    write_column(case)
    fig, axes = case.figure(ncols=2, figsize=(10, 4.2))
    for (name, (force, work)), ax in zip(LIMITS.items(), axes, strict=True):
        whole, broken = (run_column(case, name, i) for i in (INERTIA, INERTIA / 4))
        if name == "twenty":
            judge_restart(case, whole["stem"], 2)
        case.above(f"{name} transits: mean breakage at the end", whole["crushed"], 0.25)
        off = abs(broken["force"].mean() / whole["force"].mean() - 1)
        case.below(f"{name} transits: mean force, change", float(off), force)
        off = abs(broken["work"] / whole["work"] - 1)
        case.below(f"{name} transits: dissipation, change", float(off), work)
        for found, label in ((whole, "micro-inertia of whole grains"), (broken, "a quarter of it")):
            stress = 1e-3 * found["force"] / (LENGTH / 8) ** 2
            ax.plot(found["time"] / TRANSIT, stress, "-", lw=0.9, label=label)
        ax.set(xlabel="time [transits of a wave]", ylabel="axial stress at the base [kPa]")
        ax.legend(fontsize="small")
    case.save(fig)
