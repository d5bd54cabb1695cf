"""Infiltration to a water table against the series of Srivastava and Yeh."""

from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HEIGHT, GARDNER, CONDUCTIVITY, LOST = 1.0, 1.0, 1.0e-5, 0.34
WEIGHT, VISCOSITY = 9810.0, 1.0e-3
BEFORE, AFTER, START = 1.0e-6, 9.0e-6, 108000.0
TIMES = (3600.0, 10800.0, 36000.0)
# pressure heads at z = 0.5 m and TIMES, of another program of the same series [m]
HALF_WAY = (-0.349330914104, -0.174553745462, -0.0487585231714)
MOST_CORRECTIONS = 6
RAIN, POND = 2.7e-5, 0.1


def roots(terms: int) -> np.ndarray:
    """Roots of sin x L + 2 x cos x L, by halving, each in its interval."""
    length = GARDNER * HEIGHT
    low = ((np.arange(terms) + 0.5) * np.pi + 1e-12) / length
    high = (np.arange(terms) + 1) * np.pi / length
    for _ in range(80):
        middle = (low + high) / 2
        same = np.sign(np.sin(middle * length) + 2 * middle * np.cos(middle * length)) == np.sign(
            np.sin(low * length) + 2 * low * np.cos(low * length)
        )
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


ROOTS = roots(200)


def relative(z: np.ndarray, t: float) -> np.ndarray:
    """Relative permeability at heights z [m], t [s] after the rain has grown."""
    length, up = GARDNER * HEIGHT, GARDNER * z
    scaled = GARDNER * CONDUCTIVITY * t / LOST
    first, last = BEFORE / CONDUCTIVITY, AFTER / CONDUCTIVITY
    terms = np.sin(ROOTS * length) * np.exp(-(ROOTS**2) * scaled)
    terms = terms / (1 + length / 2 + 2 * ROOTS**2 * length)
    waves = np.exp((length - up) / 2 - scaled / 4) * (np.sin(np.outer(up, ROOTS)) @ terms)
    return last - (last - 1) * np.exp(-up) - 4 * (last - first) * waves


def flow_at_table(t: float) -> float:
    """Flow down through the table [m/s]."""
    dz = 1.0e-5
    low, middle = relative(np.array([0.0, dz]), t)
    far = relative(np.array([2 * dz]), t)[0]
    slope = (-3 * low + 4 * middle - far) / (2 * dz * GARDNER)
    return CONDUCTIVITY * (low + slope)


def run_column(case: Case, element: str, n: int, name: str, **other: object) -> Path:
    """Run n elements; return the stem of the results."""
    kind = element.split("_")[0]
    path = case.folder / f"{kind}_{n}.h5"
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, HEIGHT]), (1, 1, n))
    meshes.write_mesh(path, converted(mesh, kind))
    values = {"T_END": START + TIMES[-1], "MESH": path.stem, "ELEMENT": element,
              "PERMEABILITY": CONDUCTIVITY * VISCOSITY / WEIGHT, "GARDNER": GARDNER / WEIGHT,
              "STEPS": "dt = 15.0, step_error = 7.0e-5", "OUTPUT": 3600.0} | other  # fmt: skip
    text = (case.folder / "deck.nml").read_text()
    for key, value in values.items():
        text = text.replace(key, value if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    return case.folder / name


def heights(element: str, n: int, case: Case) -> np.ndarray:
    """Heights of the nodes of a column [m]."""
    return meshes.read_mesh(case.folder / f"{element.split('_')[0]}_{n}.h5").x[:, 2]


def heads_of(step: object, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressure heads, computed and exact, t after the rain has grown [m]."""
    exact = np.log(relative(z, step.time - START)) / GARDNER
    return step.solid["pore_pressure"] / WEIGHT, exact


def judge_column(case: Case, element: str, ax: object, bx: object) -> None:
    """Judge suctions, flow, mass, ledger and corrections."""
    stem = run_column(case, element, 20, f"column_{element}")
    z = heights(element, 20, case)
    order = np.argsort(z)
    steps = {round(s.time - START): s for s in field_steps(stem.with_suffix(".h5"))}
    books = read_history(Path(f"{stem}_pore.csv"))
    off, flow = [], []
    for t in TIMES:
        found, exact = heads_of(steps[round(t)], z)
        off.append(np.abs(found - exact).max())
        at = int(np.argmin(np.abs(books["time"] - START - t)))
        out = -books["z0 inflow"][at] / 0.01
        flow.append(abs(out / flow_at_table(t) - 1))
        bx.plot(t, out, "o" if element == "hex20" else "x", ms=4, mfc="none", color="C0")
        ax.plot(exact[order], z[order], "k-", lw=1)
        ax.plot(found, z, "o" if element == "hex20" else "x", ms=4, mfc="none")
    case.below(f"{element}: pressure head, error / height", max_of(off) / HEIGHT, 0.01)
    case.below(f"{element}: flow at the table, error", max_of(flow), 0.01)
    through = abs(books["z0 entered"]).max()
    case.below(f"{element}: liquid unaccounted for", float(abs(books["balance"]).max() / through),
               1e-12)  # fmt: skip
    energy = read_history(Path(f"{stem}_energy.csv"))
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{element}: ledger", float(abs(energy["closure"]).max() / largest), 1e-12)
    newton = read_history(Path(f"{stem}_newton.csv"))
    case.below(f"{element}: corrections of a step", float(newton["iteration"].max()),
               MOST_CORRECTIONS)  # fmt: skip


def judge_order(case: Case) -> None:
    """Judge the order of the pressure head 3600 s after the rain has grown."""
    z5 = np.linspace(0.0, HEIGHT, 6)
    errors = []
    for n in (5, 10, 20):
        dt = 1200.0 * (5 / n) ** 2
        stem = run_column(case, "hex20", n, f"order_{n}", T_END=START + 3600.0,
                          STEPS=f"dt = {dt!r}", OUTPUT=3600.0)  # fmt: skip
        z = heights("hex20", n, case)
        found, exact = heads_of(field_steps(stem.with_suffix(".h5"))[-1], z)
        at = [int(np.argmin(np.abs(z - h))) for h in z5]
        errors.append(float(np.sqrt(np.mean((found - exact)[at] ** 2))))
    case.metric("hex20: order of the pressure head", float(np.log2(errors[1] / errors[2])), 2.0,
                0.3)  # fmt: skip


def judge_rain(case: Case) -> None:
    """Judge rain that never ponds against the same flux, and heavy rain that stands as a pond."""
    flux = "&flux     group = 'z1', value = 1.0e-6"
    short = {"T_END": START + 3600.0, "STEPS": "dt = 300.0", "OUTPUT": 3600.0}
    plain = run_column(case, "hex8_bbar", 10, "flux", **short)
    rain = flux.replace("&flux", "&infiltration").replace("value", "rate")
    rains = run_column(case, "hex8_bbar", 10, "rain", **short, **{flux: rain})
    p, q = (field_steps(s.with_suffix(".h5"))[-1].solid["pore_pressure"] for s in (plain, rains))
    case.below("rain against a flux, difference of the pressure / least", float(
        np.abs(p - q).max() / np.abs(p).max()), 1e-12)  # fmt: skip
    heavy = {flux: rain.replace("1.0e-6", f"{RAIN / 9!r}, pond = {POND!r}")}
    long = {"T_END": START + TIMES[-1], "STEPS": "dt = 15.0, step_error = 1.0e-3", "OUTPUT": 3600.0}
    stem = run_column(case, "hex8_bbar", 10, "pond", **long, **heavy)
    books = read_history(Path(f"{stem}_pore.csv"))
    inflow = books["z1 infiltration inflow"] / 0.01
    late = books["time"] > START
    case.metric("pond: first inflow / rain", float(inflow[late][0] / RAIN), 1.0, 1e-12)
    steady = CONDUCTIVITY * (HEIGHT + POND) / HEIGHT
    case.metric("pond: steady flow / exact", float(inflow[-1] / steady), 1.0, 1e-9)
    z = heights("hex8_bbar", 10, case)
    top = field_steps(stem.with_suffix(".h5"))[-1].solid["pore_pressure"][np.isclose(z, HEIGHT)]
    case.metric("pond: head / depth", float(top.mean() / WEIGHT / POND), 1.0, 1e-12)


def run(case: Case) -> None:
    """Judge columns, order and rain; plot suctions and flow."""
    series = [float(np.log(relative(np.array([0.5]), t))[0]) / GARDNER for t in TIMES]
    off = max_of(abs(a - b) for a, b in zip(series, HALF_WAY, strict=True))
    case.below("series against another program [m]", off, 1e-10)
    fig, (ax, bx) = case.figure(ncols=2)
    times = np.geomspace(100.0, TIMES[-1], 60)
    bx.semilogx(times, [flow_at_table(t) for t in times], "k-", lw=1)
    for element in ("hex20", "hex8_bbar"):
        judge_column(case, element, ax, bx)
    judge_order(case)
    judge_rain(case)
    ax.set(xlabel="pressure head [m]", ylabel="height [m]", title="1, 3 and 10 h")
    bx.set(xlabel="time [s]", ylabel="flow at the table [m/s]")
    case.save(fig)
