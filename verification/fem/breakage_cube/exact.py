"""Cubes of grains that crush against the material point; restart amid crushing, threads, ranks."""

import numpy as np
from cube import judge_ledger, judge_ranks, judge_restart, write_cube, write_deck

from talus.verification import Case, field_steps, read_history

K, G, CRITICAL, OMEGA = 13833.0e6, 7588.0e6, 4.65e6, 70.0
GRAINS = (
    f"law = 'breakage', density = DENSITY, young = {9 * K * G / (3 * K + G)!r}, "
    f"poisson = {(3 * K - 2 * G) / (2 * (3 * K + G))!r},\n          critical_slope = 1.7, "
    f"breakage_energy = {CRITICAL!r}, breakage_angle_deg = {OMEGA!r}, grain_size_max = 0.105e-3,\n"
    "          grain_size_min = 0.001e-3, fractal_dimension = 2.6"
)
RAMP = "&motion group = '{0}1', component = '{0}', curve = 'ramp', scale = {1!r} /\n"
HELD = "&control component = '{0}{0}', kind = 'strain', curve = 'ramp', scale = {1!r} /\n"
PUSHED = "&control component = '{0}{0}', kind = 'stress', scale = -1.0e8 /\n"


def sides(scale: float) -> tuple[str, str]:
    """Deck lines that move both sides of cube and point by a share of the top's motion."""
    return tuple("".join(row.format(c, scale) for c in "xy") for row in (RAMP, HELD))


DRAINED = (
    "&pressure group = 'x1', value = 1.0e8 /\n&pressure group = 'y1', value = 1.0e8 /",
    "".join(PUSHED.format(c) for c in "xy"),
)
PATHS = {"drained": DRAINED, "constant volume": sides(0.5), "oedometric": sides(0.0)}
STATIC = "kind = 'static', dt = 3.0e-3, tolerance = 1.0e-11"
SLOW = {
    "newmark": "kind = 'newmark', dt = 5.0e-5, tolerance = 1.0e-9, rayleigh_mass = 5.0e4",
    "explicit": "kind = 'explicit', rayleigh_mass = 5.0e4",
}
DENSITY = 10.0  # [kg/m^3], small: waves cross the cube 600 times in a test
FINE = 2000  # steps of the point beside dynamics
AT_BREAKAGE = 11  # of the states of a point, from 0

Found = dict[str, np.ndarray]


def fill(case: Case, name: str, template: str, words: dict[str, str]) -> str:
    """Fill a template with grains; return the stem of the deck."""
    more = {"GRAINS": GRAINS, "DENSITY": repr(DENSITY)}
    return write_deck(case, name, template, words | more)


def run_point(case: Case, name: str, steps: int) -> Found:
    """Run the material point of a path."""
    words = {"SIDES": PATHS[name][1], "STEPS": str(steps)}
    stem = fill(case, f"{name} {steps}", "point.nml", words)
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def run_cube(case: Case, name: str, deck: tuple[str, str], limit: float,
             ranks: int = 0) -> tuple[str, Found]:  # fmt: skip
    """Run a cube on a path by an analysis; judge its ledger; return stem and axial stress.

    What is dissipated follows from breakage: E_c/cos²ω (1/(1 - B) - 1) per volume, here 1 m³.
    """
    path, analysis = deck
    stem = fill(case, name, "deck.nml", {"SIDES": PATHS[path][0], "ANALYSIS": analysis})
    case.run("talus-fem", f"{stem}.nml", ranks=ranks)
    lost = judge_ledger(case, name, stem, -1e-12)["plastic"]
    points = field_steps(case.folder / f"{stem}.h5")[-1].solid["state_points"]
    crushed = float((1 / (1 - points[:, AT_BREAKAGE]) - 1).mean())
    exact = CRITICAL / np.cos(np.radians(OMEGA)) ** 2 * crushed
    off = abs(lost[-1] / exact - 1)
    case.below(f"{name}: dissipation / that of its breakage - 1", float(off), limit)
    forces = read_history(case.folder / f"{stem}_reactions.csv")
    return stem, {"time": forces["time"], "axial": -forces["z1 z"], "lost": lost}


def judge_static(case: Case, name: str) -> Found:
    """Judge axial stress, breakage and dissipation at all points against the material point."""
    point = run_point(case, name, 10)
    stem, found = run_cube(case, name, (name, STATIC), 1e-9)
    wanted = -point["stress zz"]
    off = abs(found["axial"] - wanted).max() / wanted.max()
    case.below(f"{name}: axial stress, error / largest", float(off), 1e-9)
    last = field_steps(case.folder / f"{stem}.h5")[-1].solid["state_points"]
    off = abs(last[:, AT_BREAKAGE] - point["breakage"][-1]).max()
    case.below(f"{name}: breakage at all points, error", float(off), 1e-9)
    case.above(f"{name}: breakage at the end", float(point["breakage"][-1]), 0.05)
    off = abs(found["lost"] - point["dissipation"]).max() / point["dissipation"][-1]
    case.below(f"{name}: dissipation, error / largest", float(off), 1e-9)
    return found


def judge_slow(case: Case, name: str, analysis: str, exact: Found) -> Found:
    """Judge dynamics against a path of many steps; what it takes by its own steps is small."""
    stem, found = run_cube(case, name, ("drained", analysis), 1e-3)
    wanted = np.interp(found["time"], -exact["strain zz"], -exact["stress zz"])
    off = abs(found["axial"] - wanted)[2:].max() / wanted.max()
    case.below(f"{name}: axial stress, error / largest", float(off), 1e-2,
               "dynamics about the static path")  # fmt: skip
    taken = read_history(case.folder / f"{stem}_energy.csv")["numerical"]
    off = float(abs(taken).max() / found["lost"][-1])
    case.below(f"{name}: taken by the integration / dissipated", off, 1e-3)
    judge_restart(case, stem, 2)
    other, _ = run_cube(case, f"{name} on ranks", ("drained", analysis), 1e-3, ranks=2)
    judge_ranks(case, stem, other)
    return found


def run(case: Case) -> None:
    """Judge all; plot the axial stress."""
    write_cube(case, "cube.h5")
    fig, ax = case.figure()
    for name in PATHS:
        found = judge_static(case, name)
        exact = run_point(case, name, FINE)
        ax.plot(-100 * exact["strain zz"], -exact["stress zz"] / 1e6, "-",
                label=f"{name}, point, {FINE} steps")
        ax.plot(100 * found["time"], found["axial"] / 1e6, "o", mfc="none",
                label=f"{name}, 10 steps")
    judge_restart(case, "drained")
    judge_restart(case, "drained", 2)
    stem, _ = run_cube(case, "drained on ranks", ("drained", STATIC), 1e-9, ranks=2)
    judge_ranks(case, "drained", stem)
    exact = run_point(case, "drained", FINE)
    for (name, analysis), mark in zip(SLOW.items(), "x+", strict=True):
        found = judge_slow(case, name, analysis, exact)
        ax.plot(100 * found["time"], found["axial"] / 1e6, mark, label=f"drained, {name}")
    ax.set(xlabel="axial compression [%]", ylabel="axial stress [MPa]")
    ax.legend(fontsize="small")
    case.save(fig)
