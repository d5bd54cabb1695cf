"""A cloud of a sieve curve and a table of shapes: mass by sieves, shapes by number, mass as run."""

import numpy as np

from talus.cli import main
from talus.forms import LEAST_EXPONENT, volumes
from talus.generate import passing_of
from talus.packing import read_packing
from talus.verification import Case, read_history

COUNT, BOX, SEED = 4000, 0.0145, 4  # [-], [m], [-]
DENSITY, GRAVITY = 2650.0, 9.81
SHARES = (0.5, 0.3, 0.2)  # of the shapes, by number


def run(case: Case) -> None:
    """Make the cloud by command, count it, let it fall."""
    words = f"pack cloud --count {COUNT} --box {BOX} {BOX} {BOX} --seed {SEED}".split()
    files = ["--sieves", case.folder / "sieves.txt", "--shapes", case.folder / "shapes.txt",
             "-o", case.folder / "sand.h5"]  # fmt: skip
    if main([*words, *map(str, files)]) != 0:
        raise RuntimeError("talus pack cloud failed")
    openings, wanted = np.loadtxt(case.folder / "sieves.txt").T
    sand = read_packing(case.folder / "sand.h5")
    made = passing_of(sand, openings)
    mass = volumes(sand.axes, sand.skew, sand.exponent) * DENSITY
    limits = sampling_error(mass, np.median(sand.axes, axis=1) * 2.0, openings)
    for d, share, goal, limit in list(zip(openings, made, wanted, limits, strict=True))[1:-1]:
        case.metric(f"mass that passes {1e3 * d:g} mm", float(share), float(goal),
                    float(limit), "three sampling errors, half of a grain")  # fmt: skip
    case.metric("mass that passes the largest sieve", float(made[-1]), 1.0, 1e-12)
    case.metric("mass that passes the least sieve", float(made[0]), 0.0, 1e-12)
    kinds = [(~sand.skew.any(axis=1)) & (sand.exponent == LEAST_EXPONENT),
             sand.skew.any(axis=1), sand.exponent > LEAST_EXPONENT]  # fmt: skip
    for number, (kind, goal) in enumerate(zip(kinds, SHARES, strict=True), 1):
        error = np.sqrt(goal * (1.0 - goal) / COUNT)
        case.metric(f"share of shape {number} by number", float(kind.mean()), goal,
                    3.0 * float(error), "three binomial errors")  # fmt: skip
    case.run("talus-dem", "fall.nml", "--threads=1")
    energy = read_history(case.folder / "fall_energy.csv")
    speed = GRAVITY * energy["time"][-1]
    weighed = 2.0 * energy["kinetic"][-1] / speed**2
    case.metric("mass in free fall / mass of the packing", float(weighed / mass.sum()), 1.0, 1e-10)
    draw(case, sand, mass, openings, wanted)


def sampling_error(mass: np.ndarray, size: np.ndarray, openings: np.ndarray) -> np.ndarray:
    """How far the mass that passes may be off: three standard errors of shapes drawn by chance for

    given sizes, and half of the largest grain's share, as grains are whole.
    """
    volume = mass / size**3
    passes = size[None] <= openings[:, None]
    share = (mass * passes).sum(axis=1) / mass.sum()
    weight = mass[None] * (passes - share[:, None]) / mass.sum()
    chance = np.sqrt((weight**2).sum(axis=1)) * volume.std() / volume.mean()
    return 3.0 * chance + 0.5 * mass.max() / mass.sum()


def draw(
    case: Case, sand: object, mass: np.ndarray, openings: np.ndarray, wanted: np.ndarray
) -> None:
    """Sieve curves asked for and made."""
    fig, ax = case.figure()
    size = 2.0 * np.median(sand.axes, axis=1)
    order = np.argsort(size)
    ax.semilogx(1e3 * size[order], np.cumsum(mass[order]) / mass.sum(), label="made")
    ax.semilogx(1e3 * openings, wanted, "o", label="asked for")
    ax.set(xlabel="opening [mm]", ylabel="share of the mass that passes")
    ax.legend(fontsize=8)
    case.save(fig)
