"""Stress ratio of glass beads in steady shear over the inertial number, beside the measured law."""

import numpy as np

from talus.compare import max_of
from talus.generate import cloud
from talus.packing import read_packing, write_h5
from talus.verification import Case, field_steps, read_history

COUNT, D, SPREAD, DENSITY, PRESSURE = 700, 1.0e-3, 0.2, 2500.0, 1.0e3  # D [m], [kg/m3], [Pa]
NUMBERS = (0.003, 0.01, 0.03, 0.1, 0.2, 0.3)  # inertial numbers
SHEAR, SLOWEST, STEADY = 4.0, 2.5, 1.0  # shear of a run, of the first; from where it is steady
LEAST, MOST, SCALE = np.tan(np.radians(20.9)), np.tan(np.radians(32.76)), 0.279


def run(case: Case) -> None:
    """Compress a cloud, shear it at several rates, compare the means."""
    sizes = 0.5 * D * np.random.default_rng(2).uniform(1.0 - SPREAD, 1.0 + SPREAD, COUNT)
    side = (COUNT * np.pi / 6.0 * D**3 / 0.3) ** (1.0 / 3.0)
    loose = cloud(sizes, np.full(3, side), np.ones(3), seed=2, periodic=True)
    write_h5(case.folder / "cloud.h5", loose)
    case.run("talus-dem", "press.nml", "--threads=1")
    pack = read_packing(case.folder / "pressed.h5")
    pack.v[:], pack.omega[:] = 0.0, 0.0
    write_h5(case.folder / "pressed.h5", pack)
    found = [shear(case, number) for number in NUMBERS]
    for item in found:
        case.metric(f"shear stress / pressure, I = {item['number']:g}", item["ratio"],
                    float(measured(item["number"])), 0.04, "Jop et al. 2006")  # fmt: skip
    rise = found[-1]["ratio"] - found[0]["ratio"]
    case.metric("rise of the ratio from the first to the last", rise,
                float(measured(NUMBERS[-1]) - measured(NUMBERS[0])), 0.03,
                "Jop et al. 2006")  # fmt: skip
    case.below("pressure off its target, mean, largest", max_of(i["off"] for i in found), 0.02)
    case.below("momentum relative to the flow", max_of(i["drift"] for i in found), 1e-9)
    case.below("closure of the ledger, relative", max_of(i["closure"] for i in found), 1e-3)
    draw(case, found)


def measured(number: np.ndarray | float) -> np.ndarray | float:
    """Friction law of glass beads (Jop, Forterre and Pouliquen 2006)."""
    return LEAST + (MOST - LEAST) / (SCALE / number + 1.0)


def shear(case: Case, number: float) -> dict:
    """Shear the pack at the rate of an inertial number; return means of the steady part."""
    rate = number * np.sqrt(PRESSURE / DENSITY) / D
    end = (SLOWEST if number == NUMBERS[0] else SHEAR) / rate
    name = f"shear_{number:g}"
    words = {"RATE": f"{rate:.9g}", "T_END": f"{end:.9g}", "ROW": f"{end / 400.0:.9g}"}
    text = (case.folder / "shear.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_cell.csv")
    strain = rate * rows["time"]
    stress, pressure = 0.5 * (rows["stress_xz"] + rows["stress_zx"]), -rows["stress_zz"]
    late = strain > STEADY
    energy = read_history(case.folder / f"{name}_energy.csv")
    last = field_steps(case.folder / f"{name}.h5")[-1].grains
    radius = last["axes"][:, 0]
    momentum = (radius[:, None] ** 3 * last["v"]).sum(axis=0)
    return {
        "number": number, "strain": strain, "stress": stress / PRESSURE,
        "ratio": float(stress[late].mean() / pressure[late].mean()),
        "off": float(abs(pressure[late].mean() / PRESSURE - 1.0)),
        "solid": float(4.0 / 3.0 * np.pi * (radius**3).sum() / rows["volume"][late].mean()),
        "drift": float(np.linalg.norm(momentum) /
                       (radius**3 * np.linalg.norm(last["v"], axis=1)).sum()),
        "closure": float(energy["relative_closure"][-1]),
    }  # fmt: skip


def draw(case: Case, found: list[dict]) -> None:
    """Draw the stress ratio over the shear, over the inertial number, and the solid fraction."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(13.0, 4.0))
    for item in found:
        ax.plot(item["strain"], item["stress"], lw=0.8, label=f"I = {item['number']:g}")
    ax.set(xlabel="shear [-]", ylabel="shear stress / pressure [-]")
    ax.legend(fontsize=7)
    number = np.geomspace(1e-3, 1.0, 100)
    ax2.semilogx(number, measured(number), "k", lw=1.0, label="glass beads, Jop et al. 2006")
    ax2.semilogx([i["number"] for i in found], [i["ratio"] for i in found], "o", label="Talus")
    ax2.set(xlabel="inertial number I [-]", ylabel="shear stress / pressure [-]")
    ax2.legend(fontsize=8)
    ax3.semilogx([i["number"] for i in found], [i["solid"] for i in found], "o")
    ax3.set(xlabel="inertial number I [-]", ylabel="solid fraction [-]")
    case.save(fig)
