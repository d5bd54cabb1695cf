"""Two bonds in a row, pulled, sheared and twisted until one breaks."""

import json

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, GAP, YOUNG, RATIO, BEAM = 5.0e-3, 1.0e-5, 1.0e7, 2.0, 0.8 * 5.0e-3
LENGTH = 2 * RADIUS + GAP
AREA = np.pi * BEAM**2
NORMAL = YOUNG * AREA / LENGTH
SHEAR, BENDING = NORMAL / RATIO, NORMAL * BEAM**2 / 4
TWIST = SHEAR * BEAM**2 / 2
# of both bonds in a row; in shear the sphere between them turns until the moments are equal
CHAIN = {
    "pull": NORMAL / 2,
    "shear": SHEAR / 2 / (1 + SHEAR * LENGTH**2 / (4 * BENDING)),
    "twist": TWIST / 2,
}
PER_LOAD = {"pull": 1 / AREA, "shear": 1 / AREA, "twist": 2 / (AREA * BEAM)}  # stress
RATE, END, STRONG = {"pull": 1.0e-3, "shear": 2.0e-3, "twist": 1.0}, 0.05, 1.0e9


def ran(case: Case, name: str, way: str, strength: float, *args: str, end: float = END) -> tuple:
    """Run the row; return the history of the driven sphere, summary and last fields."""
    words = {
        "END": f"{end}", "TENSILE": f"{strength if way == 'pull' else STRONG:.12e}",
        "SHEAR": f"{strength if way != 'pull' else STRONG:.12e}",
        "VELOCITY": {"pull": f"{RATE['pull']}, 0.0, 0.0", "shear": f"0.0, 0.0, {RATE['shear']}",
                     "twist": "0.0, 0.0, 0.0"}[way],
        "SPIN": f"{RATE['twist'] if way == 'twist' else 0.0}, 0.0, 0.0",
    }  # fmt: skip
    deck = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        deck = deck.replace(word, value)
    (case.folder / f"{name}.nml").write_text(deck)
    x = LENGTH * np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    write_packing(case.folder / "pack.h5", x, np.full((3, 3), RADIUS), kind=np.array([1, 0, 2]))
    case.run("talus-dem", f"{name}.nml", *args)
    summary = json.loads((case.folder / f"{name}_summary.json").read_text())
    grains = field_steps(case.folder / f"{name}.h5")[-1].grains
    return read_history(case.folder / f"{name}_driven.csv"), summary["health"], grains


def load_of(rows: dict, way: str) -> np.ndarray:
    """Load that the row answers with [N, N m]."""
    return -rows[{"pull": "force_x", "shear": "force_z", "twist": "moment_x"}[way]]


def same(first: dict, second: dict) -> bool:
    """Return whether two states are the same to the bit."""
    return all(np.array_equal(first[key], second[key]) for key in ("x", "v", "omega", "force"))


def run(case: Case) -> None:
    """Judge stiffness and strength of three loads, threads and restart; plot all three."""
    fig, axes = case.figure(ncols=3, figsize=(12.0, 3.6))
    for ax, (way, chain) in zip(axes, CHAIN.items(), strict=True):
        rows, health, whole = ran(case, f"{way}_strong", way, STRONG)
        moved, load = RATE[way] * rows["time"], load_of(rows, way)
        late = rows["time"] > 0.6 * END
        slope = np.polyfit(moved[late], load[late], 1)[0]
        case.metric(f"{way}: stiffness / exact", slope / chain, 1.0, 1e-3)
        case.metric(f"{way}: bonds broken", health["bonds_torn"] + health["bonds_sheared"], 0, 0)
        strength = 0.7 * chain * RATE[way] * END * PER_LOAD[way]
        weak, health, _ = ran(case, f"{way}_weak", way, strength)
        counted = [health["bonds_torn"], health["bonds_sheared"]]
        wanted = [1, 0] if way == "pull" else [0, 1]
        case.metric(f"{way}: breaks as asked for", float(counted == wanted), 1.0, 0.0)
        last = np.flatnonzero(np.abs(load_of(weak, way)) > 0.2 * strength / PER_LOAD[way])[-1]
        reached = weak["time"][last] / (0.7 * END)
        case.metric(f"{way}: last row before the break / exact", reached, 1.0, 0.03, "rows of 1 ms")
        _, _, two = ran(case, f"{way}_threads", way, STRONG, "--threads=2")
        case.metric(f"{way}: two threads, same bits", float(same(whole, two)), 1.0, 0.0)
        ran(case, f"{way}_again", way, STRONG, end=0.5 * END)
        _, _, again = ran(case, f"{way}_again", way, STRONG, "--restart=auto")
        case.metric(f"{way}: restart, same bits", float(same(whole, again)), 1.0, 0.0)
        scale = 1e3 if way == "twist" else 1e6
        ax.plot(moved * scale, chain * moved, "-", label="exact")
        ax.plot(moved[::3] * scale, load_of(weak, way)[::3], "o", label="Talus, weak bonds")
        ax.axhline(strength / PER_LOAD[way], ls=":", color="0.5", label="strength")
        ax.set(
            xlabel="turn [mrad]" if way == "twist" else f"{way} [um]",
            ylabel="moment [N m]" if way == "twist" else "force [N]",
        )
        ax.legend()
    case.save(fig)
