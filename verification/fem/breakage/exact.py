"""Crushing of grains at a point against the closed line and an independent integration."""

import json

import numpy as np

from talus.verification import Case, read_history

K, G, CRITICAL, OMEGA = 13833.0e6, 7588.0e6, 4.65e6, np.radians(70.0)
SLOPE = 1.7
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
RATIO, DIMENSION = 0.001 / 0.105, 2.6
THETA = 1 - (3 - DIMENSION) / (5 - DIMENSION) * (1 - RATIO ** (5 - DIMENSION)) / (
    1 - RATIO ** (3 - DIMENSION)
)
RATE = np.array([0.1, 0.02, 0.04, 0.015, -0.01, 0.025])  # of the general path, compressive tensor
NO_VOLUME = "&control  strain_part = 1.0, 1.0, 1.0, 0.0, 0.0, 0.0 /\n"
EVEN = "&control  strain_part = 1.0, -1.0, 0.0, 0.0, 0.0, 0.0 /\n"
STEPS = (200, 400, 800)

Found = dict[str, np.ndarray]


def strain_row(component: str, scale: float) -> str:
    """Prescribe a component of strain along the curve."""
    row = f"component = '{component}', kind = 'strain', curve = 'path', scale = {scale!r}"
    return f"&control  {row} /\n"


def side_rows(pressure: float) -> str:
    """Hold the pressure on the sides [Pa]."""
    rows = (f"component = '{c}', kind = 'stress', scale = {-pressure!r}" for c in ("xx", "yy"))
    return "".join(f"&control  {row} /\n" for row in rows)


def run_path(case: Case, name: str, p0: float, controls: str, steps: int,
             curve: tuple = ((0.0, 1.0), (0.0, 1.0))) -> Found:  # fmt: skip
    """Run a path from isotropic pressure [Pa]."""
    text = (case.folder / "point.nml").read_text()
    for word, value in {
        "PATH": name, "P0": p0, "STEPS": steps, "CONTROLS": controls,
        "YOUNG": repr(9 * K * G / (3 * K + G)),
        "POISSON": repr((3 * K - 2 * G) / (2 * (3 * K + G))),
        "TIMES": ", ".join(map(str, curve[0])), "VALUES": ", ".join(map(repr, curve[1])),
    }.items():  # fmt: skip
        text = text.replace(word, str(value))
    stem = f"{name}_{steps}"
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml", "--point")
    found = read_history(case.folder / f"{stem}_point.csv")
    work = found["stored_energy"] + found["dissipation"] + found["numerical"]
    growth = float(np.diff(found["dissipation"]).min() / abs(work).max())
    case.above(f"{name}, {steps}: least growth of the dissipation / work", growth, -1e-12)
    return found


def stress_of(found: Found) -> np.ndarray:
    """Return the compressive stress, a row a step [Pa]."""
    return -np.column_stack([found[f"stress {c}"] for c in COMPONENTS])


def closed_line(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return breakage and compression of isotropic stress [Pa]."""
    critical = np.sqrt(2 * K * CRITICAL / THETA)
    x = np.maximum(p / critical, 1.0)
    crushed = (x - 1) / (x - THETA)
    volume = p / (K * (1 - THETA * crushed))
    volume += CRITICAL * np.tan(OMEGA) ** 2 / ((1 - THETA) * critical) * np.log(x)
    return crushed, volume


def judge_isotropic(case: Case, table: dict) -> Found:
    """Judge the closed line, at each of three numbers of steps and extrapolated."""
    b, volume = closed_line(np.array(table["p"]))
    case.below("closed line here and in the tables: B", abs(b - table["B"]).max(), 1e-8)
    worst = []
    for steps in STEPS:
        rows = "".join(
            f"&control  component = '{c}', kind = 'stress', curve = 'path', scale = -1.0 /\n"
            for c in ("xx", "yy", "zz")
        )
        found = run_path(case, "isotropic", 1.0e6, rows, steps, ((0.0, 1.0), (1.0e6, 1.2e9)))
        volume = -(found["strain xx"] + found["strain yy"] + found["strain zz"])
        exact_b, exact = closed_line(found["p"])
        exact = exact - 1.0e6 / K
        worst.append(
            (abs(found["breakage"] - exact_b).max(), abs(volume - exact).max() / exact.max())
        )
    case.below("isotropic: B, error", float(worst[-1][0]), 1e-9, "exact in the multiplier")
    case.below("isotropic: volume, error", float(worst[-1][1]), 5e-3)
    order = np.log2(worst[0][1] / worst[-1][1]) / 2
    case.metric("isotropic: order of the volume", float(order), 1.0, 0.1)
    return found


def controls_of(name: str, p0: float) -> str:
    """Return the conditions of a path of the tables, at its end."""
    rows = zip(COMPONENTS, -RATE * TWICE, strict=True)
    general = "".join(strain_row(c, float(s)) for c, s in rows)
    held = strain_row("xx", 0.0) + strain_row("yy", 0.0)
    mean = f"&control  stress_part = 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, scale = {-3 * p0!r} /\n"
    return {
        "drained": strain_row("zz", -0.2) + side_rows(p0),
        "drained_low": strain_row("zz", -0.2) + side_rows(p0),
        "undrained": strain_row("zz", -0.2) + NO_VOLUME + EVEN,
        "constant_p": strain_row("zz", -0.2) + mean + EVEN,
        "oedometric": strain_row("zz", -0.2) + held,
        "general": general,
        "implicit": general,
    }[name]


def judge_path(case: Case, name: str, table: dict) -> Found:
    """Judge stress and breakage of a path: limit and order of first-order steps."""
    wanted, p = np.array(table["stress"]), np.array(table["stress"])[:, :3].mean(axis=1)
    errors, stresses = [], []
    for steps in STEPS:
        found = run_path(case, name, table["p0"], controls_of(name, table["p0"]), steps)
        each = steps // 10
        stresses.append(stress_of(found)[each::each])
        off = (abs(stresses[-1] - wanted).max(axis=1) / p).max()
        errors.append((float(off), float(abs(found["breakage"][each::each] - table["B"]).max())))
    off = (abs(2 * stresses[-1] - stresses[-2] - wanted).max(axis=1) / p).max()
    case.below(f"{name}: stress extrapolated to no step, error / p", float(off), 5e-3)
    if errors[0][0] > 1e-6:
        order = float(np.log2(errors[0][0] / errors[-1][0]) / 2)
        case.metric(f"{name}: order of the stress", order, 1.0, 0.15)
    case.below(f"{name}: B, error", errors[-1][1], 5e-3)
    if errors[0][1] > 1e-6:
        order = float(np.log2(errors[0][1] / errors[-1][1]) / 2)
        case.metric(f"{name}: order of B", order, 1.0, 0.15)
    return found


def tangent_of_rates(stress: np.ndarray, crushed: float) -> np.ndarray:
    """Return dσ/dε [Pa] of a yielding state, by engineering shears, from Einav's rates.

    The stress (6) [Pa] is compressive. Flow and breakage of a unit multiplier are m and b; the
    multiplier of a rate keeps y = 0. Inside, shears count √2 times (Mandel's notation).
    """
    root = np.sqrt(TWICE)
    s, one = stress * root, np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    p = s @ one / 3
    dev = s - p * one
    left = 1 - THETA * crushed
    whole = K * np.outer(one, one) + 2 * G * (np.eye(6) - np.outer(one, one) / 3)
    elastic = np.linalg.solve(whole, s) / left
    energy = THETA * elastic @ whole @ elastic / 2
    scale = (1 - crushed) ** 2 / CRITICAL
    b = 2 * scale * np.cos(OMEGA) ** 2
    m = 2 * scale * energy * np.sin(OMEGA) ** 2 / p * one / 3 + 3 * dev / (SLOPE * p) ** 2
    by_stress = scale * THETA * elastic / left + 3 * dev / (SLOPE * p) ** 2
    by_stress -= 3 * (dev @ dev) / (SLOPE**2 * p**3) * one / 3
    by_b = 2 * scale * energy * (THETA / left - 1 / (1 - crushed))
    loss = left * whole @ m + THETA * b * s / left
    slopes = left * whole
    slopes -= np.outer(loss, by_stress @ slopes) / (by_stress @ loss - by_b * b)
    return slopes / np.outer(root, root)


def judge_tangent(case: Case, table: dict) -> None:
    """Judge the tangent at rest after the general path: in its state, and in that of the table."""
    wanted = np.array(table["tangent"])
    there = tangent_of_rates(np.array(table["stress"][-1]), table["B"][-1])
    off = abs(there - wanted).max() / abs(wanted).max()
    case.below("tangent of rates here and in the tables, error / largest", float(off), 1e-7)
    errors, all_slopes = [], []
    rest = ((0.0, 0.5, 1.0), (0.0, 1.0, 1.0))
    for steps in STEPS:
        controls = controls_of("general", table["p0"])
        found = run_path(case, "tangent", table["p0"], controls, 2 * steps, rest)
        slopes = np.array(
            [[found[f"stress {a} by strain {b}"][-1] for b in COMPONENTS] for a in COMPONENTS]
        )
        own = tangent_of_rates(stress_of(found)[-1], float(found["breakage"][-1]))
        off = abs(slopes - own).max() / abs(own).max()
        case.below(f"general, {steps}: tangent at rest / rates, error", float(off), 1e-10)
        errors.append(abs(slopes - wanted).max() / abs(wanted).max())
        all_slopes.append(slopes)
    off = abs(2 * all_slopes[-1] - all_slopes[-2] - wanted).max() / abs(wanted).max()
    case.below("general: tangent extrapolated to no step, error / largest", float(off), 5e-3)
    order = float(np.log2(errors[0] / errors[-1]) / 2)
    case.metric("general: order of the tangent", order, 1.0, 0.15)


def judge_implicit(case: Case, table: dict) -> None:
    """Judge ten steps of backward Euler."""
    found = run_path(case, "implicit", table["p0"], controls_of("implicit", 0.0), 10)
    wanted = np.array(table["stress"])
    p = wanted[:, :3].mean(axis=1)
    off = (abs(stress_of(found)[1:] - wanted).max(axis=1) / p).max()
    case.below("ten implicit steps: stress, error / p", float(off), 1e-8)
    off = abs(found["breakage"][1:] - table["B"]).max()
    case.below("ten implicit steps: B, error", float(off), 1e-8)


def run(case: Case) -> None:
    """Judge all; plot compression lines and breakage."""
    tables = json.loads((case.folder / "reference.json").read_text())
    line = judge_isotropic(case, tables["isotropic"])
    judge_implicit(case, tables["implicit"])
    judge_tangent(case, tables["general"])
    fig, axes = case.figure(ncols=2, figsize=(10, 4.2))
    volume = -(line["strain xx"] + line["strain yy"] + line["strain zz"])
    exact = closed_line(line["p"])
    axes[0].semilogx(line["p"] / 1e6, 100 * (exact[1] - 1.0e6 / K), "-", label="exact")
    axes[0].semilogx(line["p"][::40] / 1e6, 100 * volume[::40], "o", mfc="none", label="Talus")
    axes[0].set(xlabel="pressure p [MPa]", ylabel="volumetric compression [%]", title="isotropic")
    axes[0].invert_yaxis()
    axes[0].legend()
    for name in ("drained", "undrained", "constant_p", "oedometric", "general", "drained_low"):
        found = judge_path(case, name, tables[name])
        line = axes[1].plot(-100 * found["strain zz"], found["breakage"], "-", lw=1, label=name)
        axes[1].plot(100 * np.array(tables[name]["zz"]), tables[name]["B"], "o", mfc="none", ms=4,
                     color=line[0].get_color())  # fmt: skip
    axes[1].set(xlabel="axial compression [%]", ylabel="breakage B [-]", title="marks: exact")
    axes[1].legend(fontsize="x-small")
    case.save(fig)
