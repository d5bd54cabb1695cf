"""Dynamics of unsaturated columns: frequency, full pores, the static limit."""

import shutil

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of, same_arrays
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

# exact saturated column of the case saturated_column: time, top, pressures at 0, 5 and 9 m
COLUMN = (
    (0.02, -5.42503112258e-05, (2414.88216041, 2414.96803495, 2295.53358972)),
    (0.05, -0.000250023622371, (5661.60942879, 5661.26266943, 3749.04342793)),
    (0.1, -0.000170847708709, (1614.3280896, 1591.87102209, 508.05489861)),
    (0.15, -0.00033818140439, (2612.16401976, 2500.15960604, -175.040950266)),
    (0.2, -0.000346690443779, (5020.44115968, 4806.16795356, 3350.64791212)),
    (0.3, -0.00049422820707, (5768.21195861, 5354.67999555, 3079.95487185)),
)
POISSON = 0.2
CONFINED = (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)
SUCTION, RESIDUAL, ENTRY, POWER = 1.0e4, 0.05, 1.0e-4, 2.0
POROSITY, DENSITY, LIQUID, MODULUS, HEIGHT = 0.5, 800.0, 2.0e9, 1.0e5, 1.0
GRAVITY = 1.0e-3  # so little that the suction is one, so much that a level gives it
CYCLES, STEPS = 4, 160


def write_run(case: Case, source: str, name: str, values: dict[str, object], *words: str) -> None:
    """Write the deck of a run with its values, and run it."""
    text = (case.folder / f"{source}.nml").read_text()
    for key, value in values.items():
        text = text.replace(key, value if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", *words)


def judge_books(case: Case, name: str, title: str, held: float = 0.0) -> None:
    """Judge the ledger and the liquid's balance, over what passed or, if nothing did, is `held`."""
    energy = read_history(case.folder / f"{name}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{title}: ledger", float(abs(energy["closure"]).max() / largest), 1e-6)
    books = read_history(case.folder / f"{name}_pore.csv")
    off = abs(books["balance"]).max() / (held or max_of(abs(books["content"])))
    case.below(f"{title}: liquid unaccounted for", float(off), 1e-9)


def exact_speed(liquid: bool = True) -> float:
    """Return the speed of waves at constant content; without `liquid` as if pores were full of it.

    Constant S (n + alpha e + c_f p), alpha = 1, gives dp/de = -S/(n S' + c_f (S + S' p)); the
    stress has -d(S p)/de = -(S + S' p) dp/de besides the modulus.
    """
    p, m = -SUCTION, 1 - 1 / POWER
    base = 1 + (ENTRY * SUCTION) ** POWER
    steep = m * POWER * ENTRY * (ENTRY * SUCTION) ** (POWER - 1) * base ** (-m - 1)
    rise = (1 - RESIDUAL) * steep
    s = RESIDUAL + (1 - RESIDUAL) * base**-m
    fall = s / (rise * (POROSITY + POROSITY / LIQUID * p) + s * POROSITY / LIQUID)
    density = DENSITY + POROSITY * 1000.0 * (s if liquid else 1.0)
    return float(np.sqrt((MODULUS + (s + rise * p) * fall) / density))


def frequency_of(t: np.ndarray, u: np.ndarray, guess: float) -> float:
    """Return the frequency of the sine and its third that fit best [Hz]."""

    def left(f: float) -> float:
        phase = 2 * np.pi * f * t
        basis = np.column_stack([np.ones_like(t)] + [g(k * phase) for k in (1, 3, 5)
                                                     for g in (np.sin, np.cos)])  # fmt: skip
        return float(np.linalg.lstsq(basis, u, rcond=None)[1][0])

    for width in (0.1, 0.01, 0.001):
        tries = guess * np.linspace(1 - width, 1 + width, 41)
        guess = float(tries[np.argmin([left(f) for f in tries])])
    return guess


def judge_swing(case: Case, element: str, kind: str, ax: object) -> None:
    """Judge the frequency of a column of one suction."""
    title = f"{element}, {kind.split(chr(39))[1]}"
    name = title.replace(", ", "_")
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, HEIGHT]), (1, 1, 20))
    mesh = converted(mesh, "hex20") if element == "hex20" else mesh
    meshes.write_mesh(case.folder / "swing.h5", mesh)
    period = 4 * HEIGHT / exact_speed()
    write_run(case, "swing", name, {
        "T_END": CYCLES * period, "GRAVITY": -GRAVITY, "DENSITY": DENSITY,
        "YOUNG": MODULUS / CONFINED, "LIQUID": LIQUID, "POROSITY": POROSITY, "ELEMENT": element,
        "LEVEL": -SUCTION / 1000.0 / GRAVITY, "KIND": kind, "STEP": period / STEPS,
    })  # fmt: skip
    steps = field_steps(case.folder / f"{name}.h5")
    t = np.array([s.time for s in steps])
    u = np.array([s.solid["u"][np.isclose(mesh.x[:, 2], HEIGHT), 2].mean() for s in steps])
    found = frequency_of(t, u, 1 / period)
    case.metric(f"{title}: frequency / exact", found * period, 1.0, 3e-3)
    wrong = exact_speed(liquid=False) / exact_speed()
    case.metric(f"{title}: frequency with full pores / found", wrong / (found * period), 0.94, 0.02)
    judge_books(case, name, title, POROSITY * 0.01 * HEIGHT)
    ax.plot(t / period, u / abs(u).max(), lw=1, label=title)
    ax.set(xlabel="time / exact period", ylabel="top / largest", xlim=(0, 3))
    ax.legend()


def judge_full(case: Case) -> None:
    """Judge pores that stay full against the exact saturated column."""
    mesh = converted(meshes.box(np.zeros(3), np.array([0.5, 0.5, 10.0]), (1, 1, 100)), "hex20")
    meshes.write_mesh(case.folder / "full.h5", mesh)
    times = np.linspace(0.0, 0.3, 301)
    listed = (", ".join(repr(float(v)) for v in w) for w in (times, 1 - np.cos(75.0 * times)))
    write_run(case, "full", "wet", {
        "T_END": 0.3, "MESH": "full", "YOUNG": 19.541e6 / CONFINED, "DENSITY": 0.67 * 2000.0,
        "FLUID": 0.33e12, "POROSITY": 0.33, "PERMEABILITY": 1.0e-9, "TIMES": next(listed),
        "VALUES": next(listed), "LOAD": 3000.0, "STEP": 1e-3, "THETA": 0.5, "OUTPUT": 1e-2,
        "KIND": "'newmark'",
    })  # fmt: skip
    steps = field_steps(case.folder / "wet.h5")
    z, time = mesh.x[:, 2], np.array([s.time for s in steps])
    top = np.array([s.solid["u"][np.isclose(z, 10.0), 2].mean() for s in steps])
    p = np.array([[s.solid["pore_pressure"][np.isclose(z, at)].mean() for at in (0.0, 5.0, 9.0)]
                  for s in steps])  # fmt: skip
    rows = [(int(np.argmin(abs(time - t))), u, q) for t, u, q in COLUMN]
    off = max_of(abs(top[k] - u) for k, u, _ in rows) / abs(top).max()
    case.below("full pores: top, error / largest", float(off), 0.02)
    off = max_of(np.abs(p[k] - q).max() for k, _, q in rows) / abs(p).max()
    case.below("full pores: pressures, error / largest", float(off), 0.02)
    judge_books(case, "wet", "full pores")


def judge_drain(case: Case, ax: object) -> None:
    """Judge slow drainage by dynamics against statics, and a restart."""
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, 1.0]), (1, 1, 20))
    meshes.write_mesh(case.folder / "drain.h5", mesh)
    damped = "'newmark', beta = 0.3025, gamma = 0.6"
    kinds = {"static": "'static'", "newmark": damped, "hht": "'hht', alpha = -0.2"}
    last, out = {}, {}
    for name, kind in kinds.items():
        write_run(case, "drain", name, {"KIND": kind})
        last[name] = field_steps(case.folder / f"{name}.h5")[-1].solid
        out[name] = read_history(case.folder / f"{name}_pore.csv")["z0 entered"]
    z = mesh.x[:, 2]
    for name in ("newmark", "hht"):
        for key, what in (("u", "displacements"), ("pore_pressure", "pressures")):
            off = abs(last[name][key] - last["static"][key]).max() / abs(last["static"][key]).max()
            case.below(f"slow drainage, {name}: {what} from statics", float(off), 1e-4)
        off = abs(out[name] - out["static"]).max() / abs(out["static"]).max()
        case.below(f"slow drainage, {name}: outflow from statics", float(off), 1e-4)
        judge_books(case, name, f"slow drainage, {name}")
        ax.plot(last[name]["pore_pressure"] / 1e3, z, "o", ms=4 if name == "hht" else 7,
                mfc="none", label=name)  # fmt: skip
    ax.plot(last["static"]["pore_pressure"][np.argsort(z)] / 1e3, np.sort(z), "k-", label="static")
    ax.set(xlabel="p [kPa]", ylabel="z [m]", title="two hours of drainage")
    ax.legend()
    kept = {p: p.read_bytes() for p in case.folder.glob("newmark_*.csv")}
    shutil.copy(min(case.folder.glob("newmark.chk.*.h5"), key=lambda p: p.stat().st_mtime),
                case.folder / "half.h5")  # fmt: skip
    for what, word in (("restart", "--restart=half.h5"), ("two threads", "--threads=2")):
        write_run(case, "drain", "newmark", {"KIND": damped}, word)
        same = same_arrays(field_steps(case.folder / "newmark.h5")[-1].solid, last["newmark"])
        same = same and len(kept) > 0 and all(p.read_bytes() == d for p, d in kept.items())
        case.metric(f"{what}: every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge swings, full pores and slow drainage; plot the first and the last."""
    fig, (ax, bx) = case.figure(ncols=2)
    judge_swing(case, "hex20", "'newmark'", ax)
    judge_swing(case, "hex8_bbar", "'hht', alpha = -0.05", ax)
    judge_full(case)
    judge_drain(case, bx)
    case.save(fig)
