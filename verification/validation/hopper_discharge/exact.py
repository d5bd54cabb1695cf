"""A hopper with a flat floor and a round hole, kept full by a source: Beverloo's law."""

from pathlib import Path

import numpy as np

from talus.compare import extent, max_of
from talus.generate import cloud
from talus.packing import read_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, SPREAD, DENSITY, GRAVITY = 2.0e-3, 0.1, 2500.0, 9.81  # [m], [-], [kg/m3], [m/s2]
D = 2.0 * RADIUS
SHELL, FILL = 9.0 * D, 14.0 * D  # radius of the hopper, height of the bed [m]
ORIFICES = (5.0, 6.0, 7.0, 8.0)  # in diameters
FRICTION, ROUGH = 0.3, 0.5  # of the glass beads of this chapter, and of one run beside [-]
T_END, STEADY = 0.9, 0.3  # [s]


def run(case: Case) -> None:
    """Settle one bed, open four orifices, fit Beverloo's law."""
    height = settle(case)
    found = [discharge(case, size, height, FRICTION) for size in ORIFICES]
    rate = np.array([item["rate"] for item in found])
    across = D * np.array(ORIFICES)
    slope, constant = np.polyfit(across / D, rate**0.4, 1)
    bulk = DENSITY * float(np.mean([item["fraction"] for item in found]))
    free = (slope / D) ** 2.5 / (bulk * np.sqrt(GRAVITY))
    exponent = np.polyfit(np.log(across - 1.4 * D), np.log(rate), 1)[0]
    case.metric("exponent of the orifice less 1.4 beads", exponent, 2.5, 0.1, "Beverloo: 5/2")
    case.metric("factor C with k = 1.4, mean of four", float(factors(found).mean()), 0.60, 0.05,
                "Beverloo 0.58; Nedderman 0.55 to 0.65")  # fmt: skip
    case.metric("orifice without flow, in beads: k, both fitted", -constant / slope, 1.45, 0.45,
                "Beverloo 1.4; Nedderman 1.5 ± 0.1 for spheres")  # fmt: skip
    case.metric("factor C, both fitted", float(free), 0.60, 0.12,
                "where k is free to ± 0.45, C is to a fifth")  # fmt: skip
    rough = discharge(case, 7.0, height, ROUGH)
    case.metric("factor C with k = 1.4 at a friction of 0.5", float(factors([rough])[0]), 0.60,
                0.05, "nearly the same for all materials")  # fmt: skip
    judge(case, [*found, rough], height)
    draw(case, found, (slope, constant), bulk)


def factors(found: list[dict]) -> np.ndarray:
    """Beverloo's C of each run with k = 1.4, with the density of its own flowing bed."""
    size = D * (np.array([item["size"] for item in found]) - 1.4)
    bulk = DENSITY * np.array([item["fraction"] for item in found])
    return np.array([item["rate"] for item in found]) / (bulk * np.sqrt(GRAVITY) * size**2.5)


def judge(case: Case, found: list[dict], height: float) -> None:
    """Steadiness of the rates, level of the bed, mass, ledger."""
    for item in found:
        case.metric(f"rate of the second over the first half, {item['name']}", item["halves"], 1.0,
                    0.08)  # fmt: skip
    case.below("height of the bed at the ends, off the start / diameter",
               max_of(abs(item["height"] - height) / D for item in found), 3.0)  # fmt: skip
    case.below("beads that are neither there nor booked", max_of(i["lost"] for i in found), 0.0)
    case.below("closure of the ledger, relative", max_of(i["closure"] for i in found), 5e-3)


def settle(case: Case) -> float:
    """Write and run the closed hopper; return the height of the bed [m]."""
    solid = 0.6 * np.pi * SHELL**2 * FILL
    count = int(solid / (4.0 / 3.0 * np.pi * RADIUS**3))
    sizes = RADIUS * np.random.default_rng(3).uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    side = np.sqrt(2.0) * SHELL
    loose = cloud(sizes, np.array([side, side, 2.4 * solid / side**2 / 0.6]), np.ones(3), seed=3)
    loose.x -= [0.5 * side, 0.5 * side, 0.0]
    write_h5(case.folder / "start.h5", loose)
    write_deck(case, "settle", "settle_run", {"FRICTION": f"{FRICTION}"})
    case.run("talus-dem", "settle_run.nml", "--threads=1")
    bed = read_packing(case.folder / "bed.h5")
    return float(np.quantile(bed.x[:, 2], 0.98)) + RADIUS


def fraction_of(x: np.ndarray, radius: np.ndarray, height: float) -> float:
    """Solid fraction of a flowing bed, away from shell, floor and surface."""
    inner = SHELL - 2.0 * D
    core = (x[:, 2] > 0.2 * height) & (x[:, 2] < 0.8 * height) & (np.hypot(*x.T[:2]) < inner)
    return float(4.0 / 3.0 * np.pi * (radius[core] ** 3).sum() / (0.6 * height * np.pi * inner**2))


def write_deck(case: Case, part: str, name: str, words: dict[str, str]) -> None:
    """Write a deck with its words filled in."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in ({"SHELL": f"{SHELL}", "INNER": f"{SHELL - 1e-4}"} | words).items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)


def write_floor(path: Path, hole: float) -> None:
    """Write a flat ring from the hole's radius to beyond the shell as an STL, facing up."""
    angle = 2.0 * np.pi * np.arange(65) / 64
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(65)])
    inner, outer = hole * circle, 1.2 * SHELL * circle
    lines = ["solid floor"]
    for k in range(64):
        for corners in ((inner[k], outer[k], outer[k + 1]), (inner[k], outer[k + 1], inner[k + 1])):
            lines += ["facet normal 0 0 1", "outer loop"]
            lines += ["vertex " + " ".join(f"{value:.9g}" for value in x) for x in corners]
            lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid floor", ""]))


def discharge(case: Case, size: float, height: float, friction: float) -> dict:
    """Open the hopper by an orifice of some diameters; return rates, balances."""
    name = f"orifice_{size:g}" + ("_rough" if friction == ROUGH else "")
    write_floor(case.folder / f"{name}.stl", 0.5 * size * D)
    write_deck(case, "open", name, {"NAME": name, "LEVEL": f"{height + 0.5 * D:.5f}",
                                    "T_END": f"{T_END}", "FRICTION": f"{friction}"})  # fmt: skip
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    gone = read_history(case.folder / f"{name}_sinks.csv")
    fed = read_history(case.folder / f"{name}_sources.csv")
    energy = read_history(case.folder / f"{name}_energy.csv")
    last = field_steps(case.folder / f"{name}.h5")[-1].grains
    start = len(read_packing(case.folder / "bed.h5").id)
    steady = gone["time"] > STEADY
    t, mass = gone["time"][steady], gone["mass"][steady]
    half = len(t) // 2
    first, second = (
        (mass[half] - mass[0]) / (t[half] - t[0]),
        (mass[-1] - mass[half]) / (t[-1] - t[half]),
    )
    return {
        "name": name, "size": size, "time": gone["time"], "mass": gone["mass"],
        "rate": float((mass[-1] - mass[0]) / (t[-1] - t[0])), "halves": float(second / first),
        "height": float(np.quantile(last["x"][last["x"][:, 2] > 0.0, 2], 0.98)) + RADIUS,
        "lost": float(abs(start + fed["grains"][-1] - gone["grains"][-1] - len(last["id"]))),
        "closure": extent(energy["relative_closure"]), "grains": last,
        "fraction": fraction_of(last["x"], last["axes"][:, 0], height),
    }  # fmt: skip


def draw(case: Case, found: list[dict], line: tuple[float, float], bulk: float) -> None:
    """Draw discharged mass over time, rate over orifice, and a cut through the hopper."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(13.0, 4.2))
    for k, item in enumerate(found):
        ax.plot(item["time"], item["mass"], color=f"C{k}", label=f"D/d = {item['size']:g}")
        ax.axline((STEADY, float(np.interp(STEADY, item["time"], item["mass"]))),
                  slope=item["rate"], color=f"C{k}", lw=0.7, ls=":")  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="mass discharged [kg]")
    ax.legend(fontsize=8)
    size = np.linspace(0.0, 9.0, 100)
    law = 0.58 * bulk * np.sqrt(GRAVITY) * (D * np.maximum(size - 1.4, 0.0)) ** 2.5
    ax2.plot(size, law**0.4, "k", lw=1.0, label="Beverloo 1961: C = 0.58, k = 1.4")
    ax2.plot(size, np.maximum(line[0] * size + line[1], 0.0), "0.6", lw=0.8, label="fit")
    ax2.plot([i["size"] for i in found], [i["rate"] ** 0.4 for i in found], "o", label="Talus")
    ax2.set(xlabel="orifice / diameter", ylabel="rate$^{2/5}$ [(kg/s)$^{2/5}$]")
    ax2.legend(fontsize=8)
    g = found[-1]["grains"]
    near = np.abs(g["x"][:, 1]) < RADIUS
    speed = np.linalg.norm(g["v"][near], axis=1) if "v" in g else None
    dots = ax3.scatter(g["x"][near, 0] / D, g["x"][near, 2] / D, s=9, c=speed, vmax=0.5)
    fig.colorbar(dots, ax=ax3, label="speed [m/s]")
    ax3.set(xlabel="x / diameter", ylabel="z / diameter", aspect="equal")
    case.save(fig)
