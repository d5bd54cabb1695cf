"""Liakopoulos' column against finite volumes of another program."""

import shutil
from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of, same_arrays
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

HEIGHTS = (0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
# time [s]: pressures at HEIGHTS [Pa], settlement [m], outflow [m/s]
ROWS = {
    60: ((-15.3037084789, -53.0472812982, -234.375399697, -785.60645009, -1509.02803577,
          -2309.0092273), 0.000181755269932, 4.35017728468e-06),
    300: ((-233.526592899, -596.343617683, -1306.21005344, -2344.96481924, -3294.13682519,
           -4156.36152964), 0.000549739477992, 3.36719311601e-06),
    600: ((-376.791699726, -949.790482037, -1982.04750262, -3283.27199169, -4335.63291847,
           -5222.88289343), 0.000771136298208, 2.72085906573e-06),
    1200: ((-535.630176442, -1343.59529101, -2742.53578753, -4340.11440201, -5502.87596386,
            -6415.48963019), 0.00101468462493, 2.00509268261e-06),
    2400: ((-698.62329518, -1748.77103676, -3529.06443178, -5433.16127424, -6706.53474661,
            -7643.75871748), 0.00125863571444, 1.27105298835e-06),
    4800: ((-843.040316585, -2108.40347623, -4230.32240084, -6410.52611903, -7782.85515595,
            -8741.86345315), 0.00146795853165, 6.20907019936e-07),
    7200: ((-906.990881444, -2267.83815808, -4542.39657781, -6847.45099065, -8264.92118967,
            -9233.89821147), 0.00155827321219, 3.33068631119e-07),
}  # fmt: skip
AREA, POROSITY, DENSITY, GRAVITY = 0.01, 0.2975, 1000.0, 9.81
MOST_CORRECTIONS = 6


def run_column(case: Case, element: str, name: str, *options: str, more: str = "") -> Path:
    """Run a column of 20 elements; return the stem of its results."""
    kind = element.split("_")[0]
    path = case.folder / f"mesh_{kind}.h5"
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, 1.0]), (1, 1, 20))
    meshes.write_mesh(path, converted(mesh, kind))
    text = (case.folder / "deck.nml").read_text()
    text = text.replace("MESH", path.stem).replace("ELEMENT", element)
    (case.folder / f"{name}.nml").write_text(text + more)
    case.run("talus-fem", f"{name}.nml", *options)
    return case.folder / name


def judge_books(case: Case, stem: Path, element: str) -> dict[str, np.ndarray]:
    """Judge mass, ledger and corrections; return the table of the liquid."""
    books = read_history(Path(f"{stem}_pore.csv"))
    off = abs(books["balance"]).max() / abs(books["z0 entered"]).max()
    case.below(f"{element}: liquid unaccounted for", float(off), 1e-12)
    energy = read_history(Path(f"{stem}_energy.csv"))
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{element}: ledger", float(abs(energy["closure"]).max() / largest), 1e-9)
    newton = read_history(Path(f"{stem}_newton.csv"))
    case.below(f"{element}: corrections of a step", float(newton["iteration"].max()),
               MOST_CORRECTIONS)  # fmt: skip
    return books


def judge_column(case: Case, element: str, axes: tuple) -> None:
    """Judge pressures, settlement, outflow and the weight on the base."""
    stem = run_column(case, element, element)
    z = meshes.read_mesh(case.folder / f"mesh_{element.split('_')[0]}.h5").x[:, 2]
    books = judge_books(case, stem, element)
    steps = {round(s.time): s.solid for s in field_steps(stem.with_suffix(".h5"))}
    mark = "o" if element == "hex20" else "x"
    off, sink, flow = [], [], []
    for t, (pressure, settlement, outflow) in ROWS.items():
        solid = steps[t]
        found = np.array([solid["pore_pressure"][np.isclose(z, h)].mean() for h in HEIGHTS])
        off.append(np.abs(found - pressure).max())
        down = -solid["u"][np.isclose(z, 1.0), 2].mean()
        sink.append(abs(down / settlement - 1))
        at = int(np.argmin(np.abs(books["time"] - t)))
        out = -books["z0 inflow"][at] / AREA
        flow.append(abs(out / outflow - 1))
        axes[0].plot(pressure, HEIGHTS, "k-", lw=1)
        axes[0].plot(found, HEIGHTS, mark, ms=4, mfc="none")
        axes[1].loglog(t, out, mark, ms=4, mfc="none", color="C0")
    case.below(f"{element}: pressure, error [Pa]", max_of(off), 100.0)
    case.below(f"{element}: settlement, error", max_of(sink), 0.02)
    case.below(f"{element}: outflow, error", max_of(flow), 0.02)
    judge_weight(case, element, steps)


def judge_weight(case: Case, element: str, steps: dict[int, dict]) -> None:
    """Judge what the base carries: the solid, full pores at the start, less what is missing."""
    off = []
    for t in (60, 600, 7200):
        missing = POROSITY * DENSITY * GRAVITY * AREA * (1.0 - steps[t]["saturation"].mean())
        weight = (2000.0 + POROSITY * DENSITY) * GRAVITY * AREA
        carried = steps[t]["reaction"][:, 2].sum()
        off.append(abs(carried / (weight - missing) - 1))
    case.below(f"{element}: weight on the base, error", max_of(off), 1e-9)


def judge_bits(case: Case) -> None:
    """Judge a run that goes on from a checkpoint, and one of two threads, against a whole one."""
    more = "&checkpoint every_time = 3600.0 /\n"
    stem = run_column(case, "hex8_bbar", "bits", more=more)
    whole = field_steps(stem.with_suffix(".h5"))
    kept = {p: p.read_bytes() for p in case.folder.glob("bits_*.csv")}
    shutil.copy(case.folder / "bits.chk.1.h5", case.folder / "half.chk.h5")
    for what, option in (("restart", "--restart=half.chk.h5"), ("two threads", "--threads=2")):
        run_column(case, "hex8_bbar", "bits", option, more=more)
        again = field_steps(stem.with_suffix(".h5"))
        same = len(kept) > 0 and len(whole) == len(again)
        for a, b in zip(whole, again, strict=True):
            same = same and same_arrays(a.solid, b.solid)
        same = same and all(p.read_bytes() == data for p, data in kept.items())
        case.metric(f"{what}: every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge columns of two elements and bits; plot pressures and outflow."""
    fig, axes = case.figure(ncols=2)
    times = np.array(list(ROWS))
    axes[1].loglog(times, [row[2] for row in ROWS.values()], "k-", lw=1)
    for element in ("hex20", "hex8_bbar"):
        judge_column(case, element, axes)
    judge_bits(case)
    axes[0].set(xlabel="pore pressure [Pa]", ylabel="height [m]", title="1 min to 2 h")
    axes[1].set(xlabel="time [s]", ylabel="outflow [m/s]")
    case.save(fig)
