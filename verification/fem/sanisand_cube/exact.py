"""Cubes of sand in triaxial compression against the material point; restart amid plastic flow."""

import numpy as np
from cube import judge_ledger, judge_restart, write_cube, write_deck

from talus.verification import Case, field_steps, read_history

SAND = (
    "law = 'sanisand', density = DENSITY, poisson = 0.05, stiffness_number = 125.0, "
    "critical_slope = 1.25, extension_ratio = 0.712, critical_void_ratio = 0.934,\n          "
    "critical_line_slope = 0.019, plastic_hardening = 7.05, hardening_void = 0.968, "
    "bounding_rate = 1.1, dilatancy = 0.704,\n          dilatancy_rate = 3.5, fabric_limit = 4.0, "
    "fabric_rate = 600.0, void_ratio_max = 0.977, void_ratio_min = 0.597, "
)
DRAINED = (
    "&pressure group = 'x1', value = 1.0e5 /\n&pressure group = 'y1', value = 1.0e5 /",
    "&control  component = 'xx', kind = 'stress', scale = -1.0e5 /\n"
    "&control  component = 'yy', kind = 'stress', scale = -1.0e5 /",
)
CONSTANT_VOLUME = (
    "&motion   group = 'x1', component = 'x', curve = 'ramp', scale = 0.5 /\n"
    "&motion   group = 'y1', component = 'y', curve = 'ramp', scale = 0.5 /",
    "&control  component = 'xx', kind = 'strain', curve = 'ramp', scale = 0.5 /\n"
    "&control  component = 'yy', kind = 'strain', curve = 'ramp', scale = 0.5 /",
)
STATIC = "kind = 'static', dt = 4.0e-4, tolerance = 1.0e-10"
SLOW = {
    "hht": "kind = 'hht', alpha = -0.3, dt = 1.0e-4, tolerance = 1.0e-9, rayleigh_mass = 5.0e3",
    "explicit": "kind = 'explicit', rayleigh_mass = 5.0e3",
}
AT_VOID = 30  # of the states of a point

Found = dict[str, np.ndarray]


def fill(case: Case, name: str, template: str, words: dict[str, str]) -> str:
    """Fill a template with sand, a point's by its relative density; return the stem of the deck."""
    density = "void_ratio = 0.8"
    if template == "point.nml":
        density = f"relative_density = {(0.977 - 0.8) / (0.977 - 0.597)!r}"
    return write_deck(case, name, template, {"SAND": SAND + density} | words)


def run_point(case: Case, name: str, sides: str) -> Found:
    """Run the material point."""
    stem = fill(case, f"{name} point", "point.nml", {"SIDES": sides, "DENSITY": "1.0"})
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def run_cube(case: Case, name: str, sides: str, analysis: str = STATIC) -> tuple[str, Found]:
    """Run a cube; return its stem, the axial stress with its times, and judge the ledger."""
    words = {"SIDES": sides, "ANALYSIS": analysis, "DENSITY": "0.1"}
    stem = fill(case, name, "deck.nml", words)
    case.run("talus-fem", f"{stem}.nml")
    forces = read_history(case.folder / f"{stem}_reactions.csv")
    judge_ledger(case, name, stem, -1e-9)
    return stem, {"time": forces["time"], "axial": -forces["z1 z"]}


def judge_static(case: Case, name: str, sides: tuple[str, str]) -> tuple[Found, Found]:
    """Judge axial stress and void ratio at all points against the material point."""
    point = run_point(case, name, sides[1])
    stem, found = run_cube(case, name, sides[0])
    wanted = -point["stress zz"]
    off = abs(found["axial"] - wanted).max() / wanted.max()
    case.below(f"{name}: axial stress, error / largest", float(off), 1e-5)
    last = field_steps(case.folder / f"{stem}.h5")[-1].solid["state_points"]
    off = abs(last[:, AT_VOID - 1] - point["void_ratio"][-1]).max()
    case.below(f"{name}: void ratio at all points, error", float(off), 1e-7)
    return point, found


def run(case: Case) -> None:
    """Judge all; plot the deviatoric stress."""
    write_cube(case, "cube.h5")
    point, drained = judge_static(case, "drained", DRAINED)
    judge_restart(case, "drained")
    other, held = judge_static(case, "constant volume", CONSTANT_VOLUME)
    fig, ax = case.figure()
    for label, exact, found in (("drained", point, drained), ("constant volume", other, held)):
        ax.plot(-100 * exact["strain zz"], -exact["stress zz"] / 1e3, "-", label=f"{label}, point")
        ax.plot(100 * found["time"], found["axial"] / 1e3, "o", mfc="none", label=label)
    for (name, analysis), mark in zip(SLOW.items(), "x+", strict=True):
        stem, found = run_cube(case, name, DRAINED[0], analysis)
        wanted = np.interp(found["time"], -point["strain zz"], -point["stress zz"])
        off = abs(found["axial"] - wanted)[2:].max() / wanted.max()
        case.below(f"{name}: axial stress, error / largest", float(off), 2e-2,
                   "dynamics about the static path")  # fmt: skip
        judge_restart(case, stem)
        ax.plot(100 * found["time"], found["axial"] / 1e3, mark, label=f"drained, {name}")
    ax.set(xlabel="axial compression [%]", ylabel="axial stress [kPa]")
    ax.legend()
    case.save(fig)
