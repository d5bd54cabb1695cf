"""A saturated column, half grains and half elements, against Terzaghi's series."""

from pathlib import Path

import h5py
import numpy as np
from coupled import write_box, write_deck
from interface_growth import judge_growth
from interface_swing import judge_swing

from talus.mesh import read_mesh
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

D, STIFFNESS, SIDE, HEIGHT = 1.0e-3, 1.0e5, 3, 0.1
LOAD, RAMP, STEP = 1.0e4, 5.0e-4, 1.0e-6
MODULUS, POROSITY, MOBILITY = STIFFNESS / D, 1.0 - np.pi / 6.0, 1.0e-9
STORAGE = POROSITY / 2.2e9
P0 = LOAD / (1.0 + MODULUS * STORAGE)
SPEED = MOBILITY / (STORAGE + 1.0 / MODULUS)
EXCHANGE, EXCHANGES = 20 * STEP, 1034
T_END = EXCHANGE * EXCHANGES
LOW, HIGH = 49.5e-3, 50.5e-3  #: of the facets, under elements and over them
FLOOR = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'floor' /"
WEIGHT = "&surcharge stress = 1.0e4, curve = 'ramp', lower = 0.0, 0.0, upper = 0.003, 0.003 /"
DRAIN = "&drain side = 'z1', pressure = 0.0 /"
LOADED = "&pressure group = 'z1', value = 1.0e4, curve = 'ramp' /"
OPEN = "&pore_pressure group = 'z1', value = 0.0 /"
#: Statics want a body that is held: 1e-6 of the column's stiffness, which bears 1e-6 of the load.
FAINT = "&spring group = 'z1', normal = 1.0e3 /"
HELD = "&support group = 'z0', fix = 'x', 'y', 'z' /"
OLD_CURVE = "&curve    id = 'ramp', times = 0.0, 5.0e-4, values = 0.0, 1.0 /"
#: Of the pulse: layers, elements [m], length and exchange [s], overlap of the lattice over D.
LAYERS, ELEMENT, PULSE, STEP_PULSE, PRELOAD = 200, 5.0e-3, 2.0e-4, 12 * STEP, 1.0e-4


def series(depth: np.ndarray, factor: float) -> np.ndarray:
    """Pressure at depths [Pa] at a time factor."""
    m = (2 * np.arange(2000) + 1) * np.pi / 2
    return P0 * 2 * np.sin(np.outer(depth / HEIGHT, m)) @ (np.exp(-(m**2) * factor) / m)


def settlement(factor: float, top: float) -> float:
    """Settlement of a height [m]: strain of all below it."""
    z = (np.arange(4000) + 0.5) / 4000 * top
    return float(np.mean(LOAD - series(HEIGHT - z, factor))) * top / MODULUS


def lattice(path: Path, layers: np.ndarray, ghosts: int) -> None:
    """Write a lattice with centres at these heights [m]; the layer `ghosts` is on the facets."""
    places = np.meshgrid(np.arange(SIDE), np.arange(SIDE), np.arange(len(layers)), indexing="ij")
    x = np.column_stack([D * (places[0].ravel() + 0.5), D * (places[1].ravel() + 0.5),
                         layers[places[2].ravel()]])  # fmt: skip
    chosen = np.flatnonzero(places[2].ravel() == ghosts % len(layers)) + 1
    write_h5(path, make_packing(x, np.full((len(x), 3), 0.5 * D), groups={"ghosts": chosen}))


def prepare(case: Case, name: str, grains_below: bool, end: float, threads: int = 1,
            scheme: str = "average", outputs: int = 2, every: int = 4) -> None:  # fmt: skip
    """Write packing, mesh and decks of a column whose lower or upper half is grains."""
    gamma = LOW if grains_below else HIGH
    across = [0.003, 0.003]
    if grains_below:
        lattice(case.folder / f"pack_{name}.h5", D * (np.arange(50) + 0.5), -1)
        ends, low, high = ([0.0, 0.0, gamma], [*across, HEIGHT]), 0.0, gamma
    else:
        lattice(case.folder / f"pack_{name}.h5", D * (np.arange(50, 100) + 0.5), 0)
        ends, low, high = ([0.0, 0.0, 0.0], [*across, gamma]), gamma, HEIGHT
    write_box(case.folder / f"mesh_{name}.h5", *ends, (1, 1, 10))
    common = {"permeability": 1.0e-12, "output": end / outputs}
    write_deck(case, f"grains_{name}.nml", "grains.nml", pack=f"pack_{name}.h5", lower=low,
               upper=high, bricks=10, every=every, **common,
               end=FLOOR if grains_below else WEIGHT + "\n" + DRAIN)  # fmt: skip
    tied = "\n".join([LOADED, OPEN, FAINT] if grains_below else [HELD])
    write_deck(case, f"solid_{name}.nml", "solid.nml", mesh=f"mesh_{name}.h5",
               element="hex8_bbar", end=tied, **common)  # fmt: skip
    write_deck(case, f"coupled_{name}.nml", "coupled.nml", grains=f"grains_{name}.nml",
               solid=f"solid_{name}.nml", facets="z0" if grains_below else "z1", t_end=end,
               exchange=EXCHANGE, scheme=scheme, threads=threads)  # fmt: skip


def pressures(case: Case, name: str, step: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Heights [m], pressures [Pa] of both halves and the time [s] of an output."""
    fields = field_steps(case.folder / f"solid_{name}.h5")[step]
    z = read_mesh(case.folder / f"mesh_{name}.h5").x[:, 2]
    with h5py.File(case.folder / f"grains_{name}_pore.h5") as file:
        height = file["mesh/x"][:, 2]
        p = file["steps"][sorted(file["steps"])[step]]["excess_pressure"][...]
    return np.append(z, height), np.append(fields.solid["pore_pressure"], p), fields.time


def judge_column(case: Case, name: str, grains_below: bool, ax: object = None) -> None:
    """Judge pressures, settlement, continuity and mass of a column that was run."""
    gamma = LOW if grains_below else HIGH
    grains = field_steps(case.folder / f"grains_{name}.h5")
    for step in (1, 2):
        z, p, time = pressures(case, name, step)
        factor = SPEED * (time - 0.5 * RAMP) / HEIGHT**2
        off = float(np.abs(p - series(HEIGHT - z, factor)).max() / LOAD)
        case.below(f"{name}, T = {factor:.2g}: pressures, error / load", off, 0.02, "P16")
        at = np.abs(z - gamma) < 1e-9
        jump = float(np.ptp(p[at]) / LOAD)
        case.below(f"{name}, T = {factor:.2g}: jump of p at the facets / load", jump, 1e-3)
        top, sunk = sinking(case, name, grains_below, step, grains)
        off = abs(sunk - settlement(factor, top)) / settlement(1e3, HEIGHT)
        case.below(f"{name}, T = {factor:.2g}: settlement, error / the final one", off, 0.01, "P16")
        if ax is not None:
            ax.plot(1e-3 * p, 1e3 * (HEIGHT - z), ".", ms=4)
            depth = np.linspace(0.0, HEIGHT, 101)
            ax.plot(1e-3 * series(depth, factor), 1e3 * depth, "k-", lw=0.8)
    rows = read_history(case.folder / f"coupled_{name}_pore.csv")
    off = float(rows["balance"][-1])
    case.below(f"{name}: liquid that came from nowhere / that went over", off, 1e-12, "P16")
    if ax is None:
        return
    ax.axhline(1e3 * (HEIGHT - gamma), color="0.7", lw=0.8)
    ax.set(title="grains below" if grains_below else "grains above", xlabel="pressure [kPa]")


def sinking(case: Case, name: str, below: bool, step: int, grains: list) -> tuple[float, float]:
    """Height of the uppermost nodes or centres and how far they have sunk [m]."""
    if below:
        u = field_steps(case.folder / f"solid_{name}.h5")[step].solid["u"][:, 2]
        z = read_mesh(case.folder / f"mesh_{name}.h5").x[:, 2]
        return HEIGHT, float(-u[z > HEIGHT - 1e-9].mean())
    x = grains[0].grains["x"][:, 2]
    top = x > HEIGHT - D
    return HEIGHT - 0.5 * D, float((x - grains[step].grains["x"][:, 2])[top].mean())


def judge_lag(case: Case) -> None:
    """Judge that springs carry what the ghosts push while pressures fall fastest beside them."""
    for name, below in (("falling", True), ("draining", False)):
        prepare(case, name, below, 310 * EXCHANGE, outputs=310 // 10)
        case.run("talus-couple", f"coupled_{name}.nml")
        off = 0.0
        for step in range(16, 32):
            z, p, time = pressures(case, name, step)
            factor = SPEED * (time - 0.5 * RAMP) / HEIGHT**2
            off = max(off, float(np.abs(p - series(HEIGHT - z, factor)).max() / LOAD))
        case.below(f"{name}, T = 0.03 to 0.06: pressures, error / load", off, 0.005)
        audit = read_history(case.folder / f"coupled_{name}_audit.csv")
        lag = float(audit["force_lag"][audit["time"] > 0.5 * audit["time"][-1]].max())
        case.below(f"{name}: force that the solid does not carry, share", lag, 0.02)


def judge_sealed(case: Case) -> None:
    """Judge the pressure of grains under dry elements that let no liquid through."""
    prepare(case, "sealed", True, 100 * EXCHANGE)
    solid, coupled = (case.folder / f"{side}_sealed.nml" for side in ("solid", "coupled"))
    lines = solid.read_text().splitlines()
    solid.write_text("\n".join(x for x in lines if not x.startswith(("&fluid", "&pore"))) + "\n")
    change(coupled, ("&pore_interface facets = 'z0'",
                     "&pore_interface facets = 'z0', permeable = .false."))  # fmt: skip
    case.run("talus-couple", "coupled_sealed.nml")
    rows = read_history(case.folder / "grains_sealed_pore.csv")
    for end in ("least", "most"):
        case.metric(f"sealed: {end} pressure / exact", float(rows[f"{end}_pressure"][-1] / P0),
                    1.0, 0.005, "P18")  # fmt: skip
    force = read_history(case.folder / "coupled_sealed_pore.csv")["force_z"][-1]
    case.metric("sealed: liquid's force on the facets / exact", float(force / (P0 * 9.0e-6)), 1.0,
                0.005, "P18")  # fmt: skip


def judge_rest(case: Case) -> None:
    """Judge that water at rest stays, in grains and elements that weigh as much as it does."""
    prepare(case, "rest", False, 20 * EXCHANGE)
    fall = ", gravity = 0.0, 0.0, -9.81 /"
    change(case.folder / "grains_rest.nml", (WEIGHT, ""), ("'Lattice' /", "'Lattice'" + fall),
           ("density = 2650.0", "density = 1000.0"))  # fmt: skip
    change(case.folder / "solid_rest.nml", ("'Elements' /", "'Elements'" + fall),
           ("density = 1387.0", f"density = {1000 * np.pi / 6}"),
           (HELD, HELD + "\n&water_table level = 0.1 /"))  # fmt: skip
    change(case.folder / "coupled_rest.nml",
           ("&checkpoint", "&limits allow = 'interface_work_error' /\n&checkpoint"))  # fmt: skip
    case.run("talus-couple", "coupled_rest.nml")
    rows = read_history(case.folder / "coupled_rest_pore.csv")
    exact = 9810.0 * (HEIGHT - HIGH)
    off = float(np.abs(rows["mean_pressure"] / exact - 1.0).max())
    case.below("rest: pressure at the facets, error / exact", off, 1e-6, "rounding of contacts")
    off = float(np.abs(rows["force_z"] / (exact * -9.0e-6) - 1.0).max())
    case.below("rest: force on the facets, error / exact", off, 1e-6, "rounding of contacts")
    off = float(np.abs(rows["to_solid"]).max() / (POROSITY * 9.0e-6 * HEIGHT))
    case.below("rest: liquid that went over / pores", off, 1e-12)


def change(path: Path, *pairs: tuple[str, str]) -> None:
    """Replace texts of a deck."""
    text = path.read_text()
    for old, new in pairs:
        text = text.replace(old, new)
    path.write_text(text)


def judge_bits(case: Case) -> None:
    """Judge that two threads and a restart change no bit."""
    for name in ("whole", "parts"):
        prepare(case, name, True, 40 * EXCHANGE, every=2)
    case.run("talus-couple", "coupled_whole.nml")
    prepare(case, "parts", True, 20 * EXCHANGE, threads=2, outputs=1, every=2)
    case.run("talus-couple", "coupled_parts.nml")
    prepare(case, "parts", True, 40 * EXCHANGE, every=2)
    case.run("talus-couple", "coupled_parts.nml", "--restart=auto")
    for name in ("coupled_{}_pore.csv", "coupled_{}_audit.csv", "grains_{}_pore.csv",
                 "solid_{}_pore.csv"):  # fmt: skip
        one, other = (case.folder / name.format(run) for run in ("whole", "parts"))
        differs = float(one.read_bytes() != other.read_bytes())
        case.metric(f"{name.format('*')} after a restart differs", differs, 0.0, 0.0, "bytes")
    p = read_history(case.folder / "coupled_whole_pore.csv")["mean_pressure"]
    case.above("pressure at the facets by then [Pa]", float(p[-1]), 0.5 * LOAD, "it is loaded")


def prepare_pulse(case: Case) -> float:
    """Write grains and elements of 200 mm each, with a pulse on top; return its end [s]."""
    close = D * (1.0 - PRELOAD)
    gamma = close * (LAYERS - 0.5)
    lattice(case.folder / "pack_pulse.h5", close * (np.arange(LAYERS) + 0.5), -1)
    write_box(case.folder / "mesh_pulse.h5", [0, 0, gamma], [3 * D, 3 * D, gamma + 0.2],
              (1, 1, round(0.2 / ELEMENT)))  # fmt: skip
    end = STEP_PULSE * round(1.6e-3 / STEP_PULSE)
    times = np.linspace(0.0, PULSE, 41)
    wave = np.sin(np.pi * times / PULSE) ** 2
    curve = (f"&curve id = 'ramp', times = {', '.join(f'{t:.8g}' for t in times)},\n"
             f"  values = {', '.join(f'{x:.8g}' for x in wave)} /")  # fmt: skip
    common = {"permeability": 1.0e-15, "output": STEP_PULSE}
    write_deck(case, "grains_pulse.nml", "grains.nml", pack="pack_pulse.h5", lower=0.0,
               upper=repr(gamma), bricks=40, every=4, end=FLOOR, **common)  # fmt: skip
    write_deck(case, "solid_pulse.nml", "solid.nml", mesh="mesh_pulse.h5", element="hex8_bbar",
               end=LOADED.replace("1.0e4", "1.0e3"), **common)  # fmt: skip
    write_deck(case, "coupled_pulse.nml", "coupled.nml", grains="grains_pulse.nml",
               solid="solid_pulse.nml", facets="z0", t_end=repr(end), exchange=STEP_PULSE,
               scheme="iterated", threads=1)  # fmt: skip
    change(case.folder / "coupled_pulse.nml", ("interface = 'springs', stiffness = 1.5e5",
           "interface = 'aitken'"))  # fmt: skip
    change(case.folder / "grains_pulse.nml", ("damping = 1000.0", "damping = 0.0"),
           ("2.2e9", "2.2e7"))  # fmt: skip
    change(case.folder / "solid_pulse.nml", ("2.2e9", "2.2e7"), ("'static'", "'newmark'"),
           (OLD_CURVE, curve))  # fmt: skip
    return gamma


def judge_pulse(case: Case) -> None:
    """Judge what comes back of an undrained pulse where elements meet grains."""
    gamma = prepare_pulse(case)
    case.run("talus-couple", "coupled_pulse.nml")
    z = read_mesh(case.folder / "mesh_pulse.h5").x[:, 2]
    middle = np.abs(z - gamma - 0.1) < 1e-6
    steps = field_steps(case.folder / "solid_pulse.h5")
    p = np.array([s.solid["pore_pressure"][middle].mean() for s in steps])
    time = np.array([s.time for s in steps])
    speed = np.sqrt((MODULUS + 2.2e7 / POROSITY) / (1387.0 + 1000.0 * POROSITY))
    split = 0.2 / speed + 0.5 * PULSE
    frequency = np.fft.rfftfreq(4096, time[2] - time[1])
    inward, back = (np.abs(np.fft.rfft(np.where(part, p, 0.0), 4096))
                    for part in (time < split, time >= split))  # fmt: skip
    size = 2.0 * np.pi * frequency * ELEMENT / (2.0 * speed)
    share = back / inward
    for limit in (0.06, 0.1, 0.2, 0.3):
        within = (size > 0.02) & (size <= limit)
        case.below(f"pulse: reflection up to n w = {limit}", float(share[within].max()), 0.02)
    case.above("pulse: its pressure on the way [Pa]", float(p.max()), 200.0, "it came by")


def run(case: Case) -> None:
    """Judge both columns, the bits, the growth of the exchange, and a pulse."""
    fig, axes = case.figure(ncols=2, figsize=(8.0, 4.0), sharey=True)
    prepare(case, "below", True, T_END)
    case.run("talus-couple", "coupled_below.nml")
    judge_column(case, "below", True, axes[0])
    prepare(case, "above", False, T_END)
    case.run("talus-couple", "coupled_above.nml")
    judge_column(case, "above", False, axes[1])
    prepare(case, "early", False, 100 * EXCHANGE, scheme="iterated")
    case.run("talus-couple", "coupled_early.nml")
    judge_column(case, "early", False)
    axes[0].set(ylabel="depth [mm]")
    axes[0].invert_yaxis()
    judge_lag(case)
    judge_sealed(case)
    judge_rest(case)
    judge_bits(case)
    judge_growth(case)
    judge_swing(case)
    case.save(fig)
    judge_pulse(case)
