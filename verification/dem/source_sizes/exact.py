"""Grains of three sources, sieved: the mass that passes beside the laws in closed form."""

from math import erf, exp, log, sqrt

import numpy as np

from talus.verification import Case, field_steps

SIEVES = (0.7e-3, 1.0e-3, 1.3e-3, 1.6e-3)  # [m]
LIMITS = (5.0e-4, 2.0e-3)  # [m]
PITCH = 0.1  # between the regions of the sources [m]
COUNT = 3000


def normal(d: float) -> float:
    """Share of the mass below d, mean 1 mm, standard deviation 0.2 mm."""
    return 0.5 * (1.0 + erf((d - 1.0e-3) / (2.0e-4 * sqrt(2.0))))


def lognormal(d: float) -> float:
    """Share of the mass below d, median 1 mm, standard deviation of ln d 0.3."""
    return 0.5 * (1.0 + erf(log(d / 1.0e-3) / (0.3 * sqrt(2.0))))


def rosin_rammler(d: float) -> float:
    """Share of the mass below d, 63.2 % at 1.1 mm, exponent 4."""
    return 1.0 - exp(-((d / 1.1e-3) ** 4.0))


LAWS = {"normal": normal, "lognormal": lognormal, "rosin_rammler": rosin_rammler}


def run(case: Case) -> None:
    """Feed the grains, sieve those of each source."""
    case.run("talus-dem", "feed.nml", "--threads=1")
    grains = field_steps(case.folder / "feed.h5")[-1].grains
    source = np.floor(grains["x"][:, 0] / PITCH).astype(int)
    fig, ax = case.figure()
    for number, (name, law) in enumerate(LAWS.items()):
        axes = grains["axes"][source == number]
        size, mass = 2.0 * np.median(axes, axis=1), axes.prod(axis=1)
        low, high = (law(d) for d in LIMITS)
        case.metric(f"{name}: grains", len(size), COUNT, 0.0, "all have entered")
        outside = ((size < LIMITS[0] * (1 - 1e-12)) | (size > LIMITS[1] * (1 + 1e-12))).sum()
        case.metric(f"{name}: grains outside the limits", int(outside), 0, 0.0)
        for d in SIEVES:
            passes = size <= d
            share = float((mass * passes).sum() / mass.sum())
            error = np.sqrt((mass**2 * (passes - share) ** 2).sum()) / mass.sum()
            goal = (law(d) - low) / (high - low)
            case.metric(f"{name}: mass that passes {1e3 * d:g} mm", share, goal,
                        3.0 * float(error), "three sampling errors")  # fmt: skip
        order = np.argsort(size)
        d = np.geomspace(*LIMITS, 200)
        exact = [(law(x) - low) / (high - low) for x in d]
        ax.plot(1e3 * d, exact, "k-", lw=0.8, label="exact" if number == 0 else None)
        passing = np.cumsum(mass[order]) / mass.sum()
        made = [float(passing[np.searchsorted(size[order], x) - 1]) for x in d[6::8]]
        ax.plot(1e3 * d[6::8], made, "osd"[number], ms=4, label=name.replace("_", "-"))
    ax.set(xlabel="opening [mm]", ylabel="share of the mass that passes")
    ax.legend(fontsize=8)
    case.save(fig)
