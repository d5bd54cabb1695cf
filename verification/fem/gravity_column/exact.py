"""Confined column under gravity against the closed form."""

import numpy as np

from talus import mesh as meshes
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, DENSITY, GRAVITY, HEIGHT = 20.0e6, 0.3, 1800.0, 9.81, 10.0
CONFINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))


def energy() -> float:
    """Strain energy of the exact solution: int sigma^2/(2 M) dz = (rho g)^2 H^3/(6 M) [J]."""
    return (DENSITY * GRAVITY) ** 2 * HEIGHT**3 / (6 * CONFINED)


def run(case: Case) -> None:
    """Judge settlement, stresses, reaction, energy; plot settlement over height."""
    mesh = meshes.box(np.zeros(3), np.array([1.0, 1.0, HEIGHT]), (2, 2, 40))
    meshes.write_mesh(case.folder / "column.h5", mesh)
    case.run("talus-fem", "deck.nml")
    last = field_steps(case.folder / "deck.h5")[-1].solid
    z = mesh.x[:, 2]
    exact = -DENSITY * GRAVITY / CONFINED * (HEIGHT * z - z**2 / 2)
    top = last["u"][z > HEIGHT - 1e-9, 2].mean()
    case.metric(
        "settlement of the top / exact",
        top / exact.min(),
        1.0,
        1e-12,
        "nodally exact in one dimension",
    )
    centre = mesh.x[mesh.hex8].mean(axis=1)[:, 2]
    vertical = -DENSITY * GRAVITY * (HEIGHT - centre)
    off = np.abs(last["stress"][:, 2] - vertical).max() / (DENSITY * GRAVITY * HEIGHT)
    case.below("error of mean vertical stress / (rho g H)", float(off), 1e-12)
    ratio = last["stress"][:, 0] / last["stress"][:, 2]
    case.metric("K0", float(ratio.mean()), POISSON / (1 - POISSON), 1e-12)
    base = read_history(case.folder / "deck_reactions.csv")["z0 z"][-1]
    case.metric(
        "base reaction with its nodes' share / weight",
        base / (DENSITY * GRAVITY * HEIGHT),
        1.0,
        1e-12,
    )
    ledger = read_history(case.folder / "deck_energy.csv")
    case.metric(
        "strain energy / exact, energy",
        ledger["strain"][-1] / energy(),
        1.0,
        1e-3,
        "elements hold constant stress",
    )
    fig, ax = case.figure()
    line = np.linspace(0, HEIGHT, 101)
    ax.plot(
        -1e3 * DENSITY * GRAVITY / CONFINED * (HEIGHT * line - line**2 / 2),
        line,
        "-",
        label="exact",
    )
    column = (mesh.x[:, 0] < 1e-9) & (mesh.x[:, 1] < 1e-9)
    ax.plot(1e3 * last["u"][column, 2], z[column], "o", ms=4, label="Talus")
    ax.set(xlabel="settlement [mm]", ylabel="height [m]")
    ax.legend()
    case.save(fig)
