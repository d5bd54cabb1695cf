"""Fragments that grow: masses, sizes over time, energy of a jump, work of slow growth."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

DENSITY, YOUNG, POISSON, RADIUS = 2650.0, 70.0e9, 0.25, 1.0e-3
SPEED = np.array([0.0, 3.0, -2.0])  # of the grain that breaks [m/s]
SIX, EIGHT = np.sqrt(2.0) - 1.0, 0.2300931878706982  # radii of fragments of a unit sphere
GROWN = (6.0 * SIX**3 + 8.0 * EIGHT**3) ** (-1.0 / 3.0)  # last size over that at birth
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
STEP = 2.0e-8  # [s], a ninth of the Rayleigh time of the least fragment
SLOW = (0.5e-4, 1.0e-4, 2.0e-4, 4.0e-4)  # that growth takes [s]


def fly(case: Case, name: str, words: dict[str, str]) -> dict:
    """Break a sphere in flight; return rows and fields."""
    x = np.array([[0.0, 0.0, 0.0], [2.0 * RADIUS - 2.0e-7, 0.0, 0.0]])
    v = np.array([[-5.0, 0.0, 0.0], SPEED])
    write_packing(case.folder / "pack.h5", x, np.full((2, 3), RADIUS), v=v,
                  kind=np.array([2, 0], dtype=np.int32))  # fmt: skip
    text = (case.folder / "flight.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    return {
        "energy": read_history(case.folder / f"{name}_energy.csv"),
        "rows": read_history(case.folder / f"{name}_breakage.csv"),
        "steps": field_steps(case.folder / f"{name}.h5"),
        "broken": read_history(case.folder / f"{name}_broken.csv"),
    }


def fragments(step: object) -> dict[str, np.ndarray]:
    """Return radii, masses at the end of growth, places and velocities of the fragments."""
    some = step.grains["generation"] == 1
    radius = step.grains["axes"][some, 0]
    return {"radius": radius, "mass": MASS * radius**3 / (radius**3).sum(),
            "x": step.grains["x"][some], "v": step.grains["v"][some]}  # fmt: skip


def stored(x: np.ndarray, radius: np.ndarray) -> float:
    """Return Hertz's energy of all pairs of spheres [J]."""
    i, j = np.triu_indices(len(radius), 1)
    overlap = np.maximum(radius[i] + radius[j] - np.linalg.norm(x[i] - x[j], axis=1), 0.0)
    root = np.sqrt(radius[i] * radius[j] / (radius[i] + radius[j]))
    modulus = YOUNG / (2.0 * (1.0 - POISSON**2))
    return float((8.0 / 15.0 * modulus * root * overlap**2.5).sum())


def check_jump(case: Case) -> None:
    """Judge growth at one stroke, in the look after the break."""
    words = {"T_END": "8.0e-8", "DAMPING": "0.0", "CHECK": "1", "REGROW": "1.0e-9",
             "STEP": f"{STEP}", "OUTPUT": f"{STEP}"}  # fmt: skip
    item = fly(case, "jump", words)
    case.metric("grains broken", item["rows"]["broken"][-1], 1.0, 0.0)
    steps = [s for s in item["steps"] if (s.grains["generation"] == 1).sum() == 14]
    born, after = (fragments(s) for s in steps[:2])
    case.metric("size of the largest at birth / of the grain", born["radius"].max() / RADIUS, SIX,
                1e-8)  # fmt: skip
    case.metric("last size / that at birth", max_of(after["radius"] / born["radius"]), GROWN, 1e-8)
    x = np.vstack([steps[1].grains["x"][steps[1].grains["generation"] == 0], after["x"]])
    wanted = stored(x, np.append(RADIUS, after["radius"]))
    wanted -= stored(x, np.append(RADIUS, born["radius"]))
    growth = item["energy"]["growth"]
    case.metric("growth / Hertz's energy of all overlaps", growth[growth > 0.0][0] / wanted, 1.0,
                1e-9)  # fmt: skip
    case.metric("mass that leaves / of the grain", item["rows"]["fines_mass"][-1] / MASS, 0.0,
                1e-14)  # fmt: skip


def grow(case: Case, k: int, damping: float) -> dict:
    """Grow in the time of number k, looks in all steps."""
    words = {"T_END": f"{1.2 * SLOW[k]}", "DAMPING": f"{damping}", "CHECK": "1",
             "REGROW": f"{SLOW[k]}", "STEP": f"{STEP}", "OUTPUT": f"{0.05 * SLOW[k]}"}  # fmt: skip
    return fly(case, f"slow_{k + 1}_{damping:.0f}", words)


def check_line(case: Case) -> dict:
    """Judge sizes over time, momentum and speeds of contacts that stay closed; return sizes."""
    item = grow(case, 0, 1.0)
    span, born = SLOW[0], item["broken"]["time"][0]
    steps = [s for s in item["steps"] if (s.grains["generation"] == 1).sum() == 14]
    found = [fragments(s)["radius"].max() / RADIUS for s in steps]
    wanted = [SIX * (1.0 + (GROWN - 1.0) * min((s.time - born) / span, 1.0)) for s in steps]
    case.below("size of the largest over time, from its line",
               max_of(np.abs(np.array(found) - wanted)), 1e-3, "of a step")  # fmt: skip
    last = fragments(steps[-1])
    case.metric("volume at the end / of the grain", (last["radius"] ** 3).sum() / RADIUS**3, 1.0,
                1e-12)  # fmt: skip
    push = (last["mass"][:, None] * last["v"]).sum(0) / MASS
    case.below("momentum, change / of the grain",
               max_of(np.abs(push - SPEED)[1:]) / np.linalg.norm(SPEED), 1e-9)  # fmt: skip
    case.below("closure of the ledger", item["energy"]["relative_closure"][-1], 1e-4)
    speed = np.linalg.norm(last["v"] - push, axis=1)
    six = last["radius"] > last["radius"].mean()
    for name, some, place in (("six", six, 1.0 - SIX), ("eight", ~six, 1.0 - EIGHT)):
        case.metric(f"speed of the {name} / (g - 1) c/T",
                    speed[some].mean() / ((GROWN - 1.0) * place * RADIUS / span), 1.0, 1e-2,
                    "a touch moved some of them before")  # fmt: skip
    return {"time": [s.time - born for s in steps], "size": found, "line": wanted}


def check_slow(case: Case) -> np.ndarray:
    """Judge the work of slow growth without dashpots; return the works [J]."""
    works = [grow(case, k, 0.0)["energy"]["growth"][-1] for k in range(len(SLOW))]
    order = np.polyfit(np.log(SLOW), np.log(works), 1)[0]
    case.metric("order of the work of growth in its time", order, -2.0, 0.2)
    return np.array(works)


def run(case: Case) -> None:
    """Run all, draw work over time of growth, and sizes over time."""
    check_jump(case)
    sizes = check_line(case)
    works = check_slow(case)
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.0, 4.0))
    ax.loglog(np.array(SLOW) * 1e3, works, "o", label="Talus")
    line = works[-1] * (np.array(SLOW) / SLOW[-1]) ** -2.0
    ax.loglog(np.array(SLOW) * 1e3, line, "k-", label="slope −2")
    ax.set(xlabel="time of growth [ms]", ylabel="work of growth [J]")
    ax.legend()
    time = np.array(sizes["time"]) * 1e3
    ax2.plot(time, sizes["line"], "k-", label="line to the volume of the grain")
    ax2.plot(time, sizes["size"], "o", ms=4, label="Talus")
    ax2.set(xlabel="time since the break [ms]", ylabel="largest fragment / grain [-]")
    ax2.legend()
    case.save(fig)
