"""Consolidation of a saturated cubic lattice against Terzaghi's series."""

import h5py
import numpy as np
from same_bits import judge

from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

D, STIFFNESS, LAYERS, SIDE = 1.0e-3, 1.0e5, 100, 3
FLUID, MOBILITY, LOAD, RAMP = 2.2e9, 1.0e-9, 1.0e4, 5.0e-4
HEIGHT, MODULUS = LAYERS * D, STIFFNESS / D
POROSITY = 1.0 - np.pi / 6.0
STORAGE = POROSITY / FLUID
P0 = LOAD / (1.0 + MODULUS * STORAGE)
SPEED = MOBILITY / (STORAGE + 1.0 / MODULUS)
# the table of P16: T, p at 25, 50 and 100 mm from the top
TABLE = (
    (0.05, (5587.06110302, 8673.69069346, 9757.39936375)),
    (0.2, (2956.81077623, 5414.50986713, 7559.41984718)),
    (1.0, (404.452014071, 747.329874423, 1056.88404209)),
)


def series(depth: np.ndarray, factor: float) -> np.ndarray:
    """Pressure at depths [Pa] at a time factor."""
    m = (2 * np.arange(2000) + 1) * np.pi / 2
    return P0 * 2 * np.sin(np.outer(depth / HEIGHT, m)) @ (np.exp(-(m**2) * factor) / m)


def settlement(factor: float) -> float:
    """Settlement of the uppermost centres [m]: springs at the lower end of each layer."""
    springs = HEIGHT - D * np.arange(LAYERS)
    return float(np.sum(LOAD - series(springs, factor))) * D**2 / STIFFNESS


def run(case: Case) -> None:
    """Load the column at once and look at two times."""
    table = max(
        abs(p / wanted - 1.0)
        for factor, row in TABLE
        for p, wanted in zip(series(np.array([25e-3, 50e-3, 100e-3]), factor), row, strict=True)
    )
    case.below("series of this case / table of P16, error", float(table), 1e-9, "rounding")
    places = np.meshgrid(*(np.arange(n) for n in (SIDE, SIDE, LAYERS)), indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    write_h5(case.folder / "lattice.h5", make_packing(x, np.full((len(x), 3), 0.5 * D)))
    case.run("talus-dem", "column.nml", "--threads=1")
    steps = field_steps(case.folder / "column.h5")
    top = steps[0].grains["x"][:, 2] > HEIGHT - D
    fig, axes = case.figure(figsize=(5.6, 4.0))
    depth = np.linspace(0.0, HEIGHT, 101)
    with h5py.File(case.folder / "column_pore.h5") as file:
        z = file["mesh/x"][:, 2]
        pressures = [file["steps"][name]["excess_pressure"][...] for name in sorted(file["steps"])]
    for step, p in list(zip(steps, pressures, strict=True))[1:]:
        factor = SPEED * (step.time - 0.5 * RAMP) / HEIGHT**2
        where = np.array([25e-3, 50e-3, 100e-3])
        found = np.interp(HEIGHT - where, z[::4], p[::4])
        off = float(np.abs(found - series(where, factor)).max() / LOAD)
        case.below(f"T = {factor:.1f}: pressures, error / load", off, 0.02, "P16")
        sunk = float(steps[0].grains["x"][top, 2].mean() - step.grains["x"][top, 2].mean())
        off = abs(sunk - settlement(factor)) / (LOAD * HEIGHT / MODULUS)
        case.below(f"T = {factor:.1f}: settlement, error / the final one", off, 0.01, "P16")
        axes.plot(1e-3 * series(depth, factor), 1e3 * depth, label=f"series, T = {factor:.1f}")
        axes.plot(1e-3 * p, 1e3 * (HEIGHT - z), ".", ms=4)
    rows = read_history(case.folder / "column_pore.csv")
    case.below("liquid that came from nowhere / pores", float(rows["balance"].max()), 1e-12, "P16")
    energy = read_history(case.folder / "column_energy.csv")
    case.below("closure of the ledger", float(energy["relative_closure"][-1]), 1e-4)
    case.above("Darcy's dissipation / all work of the load", energy_share(energy), 0.5)
    case.run("talus-dem", "bits.nml", "--threads=1")
    judge(case, "bits")
    axes.set(xlabel="pressure [kPa]", ylabel="depth [mm]")
    axes.invert_yaxis()
    axes.legend(fontsize=8)
    case.save(fig)


def energy_share(energy: dict[str, np.ndarray]) -> float:
    """Dissipation by the flow over what the load has given to grains and liquid together."""
    given = energy["external"][-1] + energy["darcy"][-1] + energy["liquid"][-1]
    return float(energy["darcy"][-1] / given)
