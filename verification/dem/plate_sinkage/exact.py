"""Rigid plates go down into loose and dense beds of spheres: Bekker's law, bearing capacity."""

import json

import numpy as np

from talus.compare import max_of, min_of
from talus.drivers import Bekker, bekker
from talus.generate import cloud
from talus.packing import make_packing, read_packing, write_h5
from talus.verification import Case, read_history

RADIUS, SPREAD = 2.0e-3, 0.2  # mean [m], relative half width
D = 2.0 * RADIUS
LONG, WIDTH, HIGH = 44.0 * D, 4.0 * D, 22.0 * D  # of the box, of the bed as it falls [m]
LEVEL = 20.0 * D  # where centres are cut off [m]
PLATES = (5.0 * D, 8.0 * D)  # widths [m]
SPEED, DEPTH = 0.03, 4.5 * D  # [m/s], [m]
FITTED = (0.25 * D, 4.0 * D)  # sinkage over which the law is fitted [m]
FIRST = (0.05 * D, 0.75 * D)  # the same for the first sinkage, up to 0.15 of the narrower plate
DEEP = (1.5 * D, 4.0 * D)  # sinkage over which bearing capacity is compared [m]
TOUCH = 0.02  # of the mean pressure, from which on sinkage counts
SEEDS = (1, 2)
FALLING = {"loose": 0.5, "dense": 0.0}  # friction while a bed is made; 0.5 under the plates
DENSITY, GRAVITY = 2650.0, 9.81
STRAIN, RATE, COUNT = 0.36, 0.3, 1000  # of the plane strain test [-], [1/s], [-]


def run(case: Case) -> None:
    """Judge loose and dense beds, and one beside the other."""
    found = {bed: sunk(case, bed) for bed in FALLING}
    judge_loose(case, found["loose"])
    judge_dense(case, found["dense"])
    first = [one["first"].pressure(0.5 * D, PLATES[0]) for one in found.values()]
    case.above("pressure at 2 mm under 20 mm, dense / loose", float(first[1] / first[0]), 1.5,
               "denser is stiffer")  # fmt: skip
    draw(case, found)


def sunk(case: Case, bed: str) -> dict:
    """Settle beds and press both plates; fit p = (kc/b + kphi) z^n, find the angles of friction."""
    tests = [press(case, bed, seed, width) for seed in SEEDS for width in PLATES]
    found = {"tests": tests, "law": law_of(tests, "fitted"), "first": law_of(tests, "first")}
    case.metric(f"{bed}: exponent n of the first sinkage", found["first"].exponent, 1.0, 0.3,
                "dry sand: 1.1; plates that sink little")  # fmt: skip
    case.below(f"{bed}: ledger, largest", max_of(t["closure"] for t in tests), 1e-4)
    case.below(f"{bed}: work of the plate less force times way, relative",
               max_of(t["work_error"] for t in tests), 5e-3)  # fmt: skip
    found["angles"] = friction(case, bed)
    return found


def judge_loose(case: Case, found: dict) -> None:
    """One law for all sinkages; bearing capacity for the mean of peak and critical angle."""
    law = found["law"]
    case.metric("loose: exponent n of the sinkage", law.exponent, 0.85, 0.3,
                "sands: 0.6 to 1.1 in Wong's table")  # fmt: skip
    case.below("loose: rms of the law / mean pressure", law.misfit, 0.25)
    case.below("loose: scatter of k between beds", scatter(found["tests"], law.exponent), 0.3)
    case.above("loose: k_phi [N/m^(n+2)]", law.k_phi, 0.0, "deeper is stronger under any width")
    for width in PLATES:
        measured, both = strengths(found, width)
        case.metric(f"loose: mean pressure / bearing capacity, {1e3 * width:.0f} mm",
                    measured / float(np.mean(both)), 1.0, 0.25,
                    "Prandtl, Reissner, Vesic")  # fmt: skip


def judge_dense(case: Case, found: dict) -> None:
    """After the first sinkage the bed fails: above the critical angle's capacity, below the peak's.

    What has failed along its bands has the critical angle, what has not the peak's.
    """
    for width in PLATES:
        measured, (peak, critical) = strengths(found, width)
        name = f"dense: mean pressure / capacity, {1e3 * width:.0f} mm"
        case.above(f"{name}, critical angle", measured / critical, 1.0, "not all has failed")
        case.below(f"{name}, peak angle", measured / peak, 1.0)


def strengths(found: dict, width: float) -> tuple[float, list[float]]:
    """Mean pressure of a width where it is deep, and bearing capacity for both angles [Pa]."""
    own = [t for t in found["tests"] if t["width"] == width]
    measured = float(np.mean([t["pressure"][t["deep"]].mean() for t in own]))
    return measured, [float(np.mean([bearing(t, phi) for t in own])) for phi in found["angles"]]


def law_of(tests: list[dict], part: str) -> Bekker:
    """Bekker's law through a part of all curves."""
    return bekker([(t["width"], t["sinkage"][t[part]], t["pressure"][t[part]]) for t in tests])


def bearing(test: dict, angle: float) -> float:
    """Bearing capacity of a strip, gamma z Nq + gamma b Ngamma/2, mean over the sinkages [Pa]."""
    return float(capacity(test, angle, test["sinkage"][test["deep"]]).mean())


def capacity(test: dict, angle: float, sinkage: np.ndarray) -> np.ndarray:
    """Bearing capacity at sinkages [Pa]: Nq of Prandtl and Reissner, Ngamma of Vesic."""
    slope = np.tan(np.radians(angle))
    deep = np.exp(np.pi * slope) * np.tan(np.radians(45.0 + 0.5 * angle)) ** 2
    wide = 2.0 * (deep + 1.0) * slope
    return test["weight"] * (sinkage * deep + 0.5 * test["width"] * wide)


def friction(case: Case, bed: str) -> tuple[float, float]:
    """Peak and critical angle of the same grains in plane strain, without walls [deg]."""
    rng = np.random.default_rng(9)
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, COUNT)
    cube = cloud(sizes, np.full(3, 0.066), np.ones(3), seed=9, periodic=True)
    write_h5(case.folder / "cube.h5", cube)
    name = deck(case, "cell_press", bed, {"FRICTION": f"{FALLING[bed]}"})
    case.run("talus-dem", name, "--threads=1")
    start = json.loads((case.folder / f"cell_press_{bed}_summary.json").read_text())["time_s"]
    name = deck(case, "cell_shear", bed, {"T_END": f"{start + STRAIN / RATE:.9g}"})
    case.run("talus-dem", name, "--threads=1", f"--restart=cell_press_{bed}.chk.h5")
    rows = read_history(case.folder / f"cell_shear_{bed}_cell.csv")
    most, least = -rows["stress_zz"], -rows["stress_xx"]
    angle = np.degrees(np.arcsin((most - least) / (most + least)))
    smooth = np.convolve(angle, np.ones(16) / 16.0, mode="valid")
    strain = RATE * (rows["time"] - start)
    return float(smooth.max()), float(angle[strain > 0.5 * STRAIN].mean())


def scatter(tests: list[dict], exponent: float) -> float:
    """Largest relative difference of the k of two beds under one plate."""
    found = []
    for width in PLATES:
        k = []
        for test in (t for t in tests if t["width"] == width):
            power = test["sinkage"][test["fitted"]] ** exponent
            k.append(float((test["pressure"][test["fitted"]] * power).sum() / (power**2).sum()))
        found.append((max_of(k) - min_of(k)) / np.mean(k))
    return float(max_of(found))


def deck(case: Case, part: str, name: str, words: dict[str, str]) -> str:
    """Write a deck with its words filled in; return its name."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{part}_{name}.nml").write_text(text)
    return f"{part}_{name}.nml"


def press(case: Case, kind: str, seed: int, width: float) -> dict:
    """Settle and level a bed, let a plate down; return its curve."""
    made = f"{kind}_{seed}"
    words = {"LONG": f"{LONG}", "WIDTH": f"{WIDTH}", "SPEED": f"{SPEED}"}
    if not (case.folder / f"settled_{made}.h5").exists():
        rng = np.random.default_rng(seed)
        room = 0.62 * LONG * WIDTH * HIGH
        count = int(room / (4.0 / 3.0 * np.pi * RADIUS**3 * (1.0 + SPREAD**2)))
        sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
        box = np.array([LONG, WIDTH, 2.2 * HIGH])
        write_h5(case.folder / f"start_{made}.h5", cloud(sizes, box, np.ones(3), seed=seed))
        own = words | {"NAME": made, "FRICTION": f"{FALLING[kind]}"}
        case.run("talus-dem", deck(case, "settle", made, own), "--threads=1")
    bed = read_packing(case.folder / f"settled_{made}.h5")
    keep = bed.x[:, 2] < LEVEL
    name = f"{made}_{round(width / D)}"
    write_h5(case.folder / f"bed_{name}.h5",
             make_packing(bed.x[keep], bed.axes[keep], bed.quat[keep]))  # fmt: skip
    begin = float((bed.x[keep, 2] + bed.axes[keep, 0]).max()) + 1.0e-5
    left, right = 0.5 * (LONG - width), 0.5 * (LONG + width)
    corners = (left, -0.01, begin, right, -0.01, begin, right, WIDTH + 0.01, begin)
    words |= {"NAME": name, "CORNERS": ", ".join(f"{v:.9g}" for v in corners),
              "T_END": f"{DEPTH / SPEED:.6g}"}  # fmt: skip
    case.run("talus-dem", deck(case, "press", name, words), "--threads=1")
    rows = read_history(case.folder / f"press_{name}_surfaces.csv")
    pressure = rows["force_z"] / (width * WIDTH)
    touch = rows["z"][int(np.argmax(pressure > TOUCH * pressure.mean()))]
    sinkage = touch - rows["z"]
    energy = read_history(case.folder / f"press_{name}_energy.csv")
    way = SPEED * np.diff(rows["time"])
    solid = fraction(bed.x[keep], bed.axes[keep, 0])
    own = float((0.5 * (rows["force_z"][1:] + rows["force_z"][:-1]) * way).sum())
    return {
        "name": name, "seed": seed, "width": width, "sinkage": sinkage, "pressure": pressure,
        "weight": DENSITY * GRAVITY * solid, "solid": solid,
        "deep": (sinkage >= DEEP[0]) & (sinkage <= DEEP[1]),
        "first": (sinkage >= FIRST[0]) & (sinkage <= FIRST[1]),
        "fitted": (sinkage >= FITTED[0]) & (sinkage <= FITTED[1]),
        "closure": float(energy["relative_closure"].max()),
        "work_error": float(abs(own / rows["work"][-1] - 1.0)),
    }  # fmt: skip


def fraction(x: np.ndarray, radius: np.ndarray) -> float:
    """Solid fraction of the middle of the bed."""
    core = (x[:, 2] > 0.25 * LEVEL) & (x[:, 2] < 0.75 * LEVEL)
    return float(4.0 / 3.0 * np.pi * (radius[core] ** 3).sum() / (LONG * WIDTH * 0.5 * LEVEL))


def draw(case: Case, found: dict[str, dict]) -> None:
    """Pressure over sinkage, with the law and bearing capacity."""
    fig, rows = case.figure(nrows=2, ncols=2, figsize=(9.5, 8.0), sharex=True, sharey="row")
    z = np.linspace(0.0, FITTED[1], 60)
    for axes, (bed, one) in zip(rows, found.items(), strict=True):
        law, angles = one["law"], one["angles"]
        for ax, width in zip(axes, PLATES, strict=True):
            own = [t for t in one["tests"] if t["width"] == width]
            for test in own:
                ax.plot(1e3 * test["sinkage"], 1e-3 * test["pressure"], lw=0.8,
                        label=f"bed {test['seed']}")  # fmt: skip
            if bed == "loose":
                ax.plot(1e3 * z, 1e-3 * law.pressure(z, width), "k--", lw=1.5,
                        label=f"Bekker, n = {law.exponent:.2f}")  # fmt: skip
            low = z[z <= FIRST[1]]
            ax.plot(1e3 * low, 1e-3 * one["first"].pressure(low, width), "k-", lw=1.5,
                    label=f"first sinkage, n = {one['first'].exponent:.2f}")  # fmt: skip
            both = [1e-3 * capacity(own[0], phi, z) for phi in angles]
            text = f"bearing capacity, {angles[1]:.1f} to {angles[0]:.1f} deg"
            ax.fill_between(1e3 * z, *both, color="0.85", label=text)
            ax.set(title=f"{bed}, {1e3 * width:.0f} mm wide", xlim=(0.0, 17.0))
            ax.legend(fontsize=8)
        most = 1.1e-3 * max(t["pressure"].max() for t in one["tests"])
        axes[0].set(ylabel="pressure [kPa]", ylim=(0.0, most))
    for ax in rows[1]:
        ax.set(xlabel="sinkage [mm]")
    case.save(fig)
