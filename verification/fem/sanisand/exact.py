"""Sand with a critical state at a point against an independent integration and closed limits."""

import json

import numpy as np

from talus.verification import Case, read_history

M, E0, LINE, XI, ATMOSPHERE = 1.25, 0.934, 0.019, 0.7, 101.0e3
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
RATE = np.array([0.2, -0.9, 1.0, 0.3, -0.4, 0.5])  # of the general path, compressive tensor
NO_VOLUME = "&control  strain_part = 1.0, 1.0, 1.0, 0.0, 0.0, 0.0 /\n"
EVEN = "&control  strain_part = 1.0, -1.0, 0.0, 0.0, 0.0, 0.0 /\n"

Found = dict[str, np.ndarray]


def strain_row(component: str, scale: float) -> str:
    """Prescribe a component of strain along the curve."""
    row = f"component = '{component}', kind = 'strain', curve = 'path', scale = {scale}"
    return f"&control  {row} /\n"


def side_rows(pressure: float) -> str:
    """Hold the pressure on the sides [Pa]."""
    rows = (f"component = '{c}', kind = 'stress', scale = {-pressure}" for c in ("xx", "yy"))
    return "".join(f"&control  {row} /\n" for row in rows)


def run_path(case: Case, name: str, start: tuple[float, float], controls: str,
             curve: tuple = ((0.0, 1.0), (0.0, 1.0)), steps: int = 100) -> Found:  # fmt: skip
    """Run a path from isotropic pressure [Pa] and void ratio."""
    text = (case.folder / "point.nml").read_text()
    for word, value in {
        "PATH": name, "VOID": start[1], "P0": start[0], "STEPS": steps, "CONTROLS": controls,
        "TIMES": ", ".join(map(str, curve[0])), "VALUES": ", ".join(map(str, curve[1])),
    }.items():  # fmt: skip
        text = text.replace(word, str(value))
    stem = name.replace(" ", "_")
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def stress_of(found: Found) -> np.ndarray:
    """Return the compressive stress, a row a step [Pa]."""
    return -np.column_stack([found[f"stress {c}"] for c in COMPONENTS])


def critical_void(p: float) -> float:
    """Return the void ratio of the critical state at a pressure [Pa]."""
    return E0 - LINE * (p / ATMOSPHERE) ** XI


def judge_drained(case: Case, tables: list[dict]) -> list[Found]:
    """Judge deviatoric stress and void ratio of drained compression to 25 %, and its limit."""
    off, runs = [], []
    for k, table in enumerate(tables):
        controls = strain_row("zz", -0.25) + side_rows(table["p0"])
        found = run_path(case, f"drained {k}", (table["p0"], table["e"]), controls, steps=200)
        q, e = found["q"][20::20], found["void_ratio"][20::20]
        off.append((abs(q / table["q"] - 1).max(), abs(e - table["void"]).max()))
        runs.append(found)
    case.below("drained: q, error", float(max(o[0] for o in off)), 1e-4)
    case.below("drained: void ratio, error", float(max(o[1] for o in off)), 1e-5)
    start = (tables[1]["p0"], tables[1]["e"])
    controls = strain_row("zz", -1.0) + side_rows(start[0])
    last = run_path(case, "drained to the end", start, controls, steps=200)
    p = start[0] / (1 - M / 3)
    case.metric("drained: q/p at the end / M", float(last["q"][-1] / last["p"][-1]) / M, 1.0, 1e-3)
    case.metric("drained: p at the end / critical", float(last["p"][-1]) / p, 1.0, 1e-3)
    case.metric("drained: e at the end / critical",
                float(last["void_ratio"][-1]) / critical_void(p), 1.0, 1e-3)  # fmt: skip
    return runs


def judge_undrained(case: Case, tables: list[dict]) -> list[Found]:
    """Judge the stress of undrained compression to 25 %, its limit and phase transformation."""
    off, runs, limit, turn = [], [], [], []
    for k, table in enumerate(tables):
        controls = strain_row("zz", -0.25) + NO_VOLUME + EVEN
        found = run_path(case, f"undrained {k}", (table["p0"], table["e"]), controls)
        p = np.array(table["p"])
        off += [abs(found[c][10::10] - np.array(table[c])).max() / p.min() for c in "pq"]
        runs.append(found)
        exact = ATMOSPHERE * ((E0 - table["e"]) / LINE) ** (1 / XI)
        last = run_path(case, f"undrained {k} to the end", (table["p0"], table["e"]),
                        strain_row("zz", -1.0) + NO_VOLUME + EVEN, steps=200)  # fmt: skip
        limit.append(abs(last["p"][-1] / exact - 1))
        limit.append(abs(last["q"][-1] / (M * exact) - 1))
        turn += phase_transformation(found)
    case.below("undrained: p and q, error / p", float(max(off)), 1e-4)
    case.below("undrained: p and q at strain 1 / critical, error", float(max(limit)), 1e-3)
    case.above("undrained: paths with phase transformation", float(len(turn)), 0.5)
    case.below("phase transformation: q/p against M exp(n_d psi), error", float(max(turn)), 5e-3,
               "the surface is m from its axis, the fabric is still none")  # fmt: skip
    growth = min(float(np.diff(f["dissipation"]).min()) for f in runs)
    case.above("undrained: least growth of the dissipation", growth, -1e-9)
    return runs


def phase_transformation(found: Found) -> list[float]:
    """Return how far q/p is from the dilatancy surface where p is least, if it turns inside."""
    p = found["p"]
    k = int(np.argmin(p[:60]))
    if not 2 < k < 59 or p[-1] < 1.02 * p[k]:
        return []
    curve = np.polyfit(np.arange(-1, 2), p[k - 1 : k + 2], 2)
    at = k - curve[1] / (2 * curve[0])
    ratio = np.interp(at, np.arange(len(p)), found["q"] / p)
    psi = np.interp(at, np.arange(len(p)), found["state_parameter"])
    return [abs(ratio / (M * np.exp(3.5 * psi)) - 1)]


def judge_general(case: Case, tables: dict) -> None:
    """Judge simple shear, a path with all components and its tangent, and cycles."""
    table = tables["shear"]
    held = "".join(strain_row(c, 0.0) for c in COMPONENTS[:5])
    found = run_path(case, "shear", (table["p0"], table["e"]), held + strain_row("zx", -0.3))
    wanted = np.array(table["stress"])
    p = wanted[:, :3].mean(axis=1)
    off = abs(stress_of(found)[10::10] - wanted).max(axis=1) / p
    case.below("simple shear: stress, error / p", float(off.max()), 1e-4)
    table = tables["general"]
    rows = zip(COMPONENTS, -0.05 * RATE * TWICE, strict=True)
    controls = "".join(strain_row(c, s) for c, s in rows)
    found = run_path(case, "general", (table["p0"], table["e"]), controls,
                     ((0.0, 0.5, 1.0), (0.0, 1.0, 1.0)), 40)  # fmt: skip
    wanted = np.array(table["stress"])
    p = wanted[:, :3].mean(axis=1)
    off = abs(stress_of(found)[2:21:2] - wanted).max(axis=1) / p
    case.below("general path: stress, error / p", float(off.max()), 1e-4)
    slopes = [[found[f"stress {a} by strain {b}"][-1] for b in COMPONENTS] for a in COMPONENTS]
    wanted = np.array(table["tangent"])
    off = abs(np.array(slopes) - wanted).max() / abs(wanted).max()
    case.below("general path: tangent of rates, error / largest", float(off), 1e-4)
    table = tables["cyclic"]
    rows = 0.002 * np.array([0, 1, 0, -1, 0, 1, 0, -1, 0, 1])
    curve = (tuple(np.arange(10) / 9), tuple(float(v) for v in rows))
    found = run_path(case, "cyclic", (table["p0"], table["e"]),
                     strain_row("zz", -1.0) + NO_VOLUME + EVEN, curve, 180)  # fmt: skip
    wanted = np.array(table["stress"])
    p = wanted[:, :3].mean(axis=1)
    off = abs(stress_of(found)[20::20] - wanted).max(axis=1) / p
    case.below("cyclic: stress, error / p", float(off.max()), 1e-3)


def run(case: Case) -> None:
    """Judge all; plot the undrained and the drained tests."""
    tables = json.loads((case.folder / "reference.json").read_text())
    drained = judge_drained(case, tables["drained"])
    undrained = judge_undrained(case, tables["undrained"])
    judge_general(case, tables)
    fig, axes = case.figure(ncols=2, figsize=(10, 4.2))
    strain = 2.5 * np.arange(1, 11)
    for k, (found, table) in enumerate(zip(undrained, tables["undrained"], strict=True)):
        label = ("exact", "Talus") if k == 0 else (None, None)
        axes[0].plot(np.array(table["p"]) / 1e6, np.array(table["q"]) / 1e6, "o", mfc="none", ms=4,
                     color="k", label=label[0])  # fmt: skip
        axes[0].plot(found["p"] / 1e6, found["q"] / 1e6, "-", lw=1, label=label[1])
    line = np.array([0.0, 3.0])
    axes[0].plot(line, M * line, "k--", lw=1, label="critical state")
    axes[0].set(xlabel="mean stress p [MPa]", ylabel="deviatoric stress q [MPa]", title="undrained")
    axes[0].legend()
    for found, table in zip(drained, tables["drained"], strict=True):
        axes[1].plot(strain, np.array(table["q"]) / table["p0"], "o", mfc="none", ms=4, color="k")
        axes[1].plot(-100 * found["strain zz"], found["q"] / table["p0"], "-", lw=1,
                     label=f"p0 = {table['p0'] / 1e3:.0f} kPa, e = {table['e']}")  # fmt: skip
    axes[1].set(xlabel="axial compression [%]", ylabel="q/p0 [-]", title="drained")
    axes[1].legend(fontsize="x-small")
    case.save(fig)
