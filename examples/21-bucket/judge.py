"""Compare blades and bucket with textbooks. Usage: judge.py PLACE ..., in the folder of the run."""

import csv
import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from forms import GRAVITY, Blade, Soil, gill_vanden_berg, mckyes  # noqa: E402
from tools import (  # noqa: E402
    BEGIN, BUCKET, DEPTHS, DIG, END, LIP_SPEED, MIDDLE, PLACES, PROFILE, RADIUS, RAKE, SPEED,
    WIDTH, capacity, inside, swept,
)  # fmt: skip

from talus.column_stamp import read_column_stamp  # noqa: E402
from talus.packing import read_packing  # noqa: E402
from talus.verification import field_steps, read_history  # noqa: E402

BAND = (0.010, 0.035)  # way of a blade over which forces are means [m]
STEEL = 0.3  # friction of a grain on the tool


def soil_of_test() -> tuple[Soil, Soil]:
    """Return the soil with the largest friction in plane strain, and with that at its end."""
    rows = read_history(Path("test_cell.csv"))
    most, least = rows["stress_xx"], rows["stress_zz"]
    angle = np.arcsin(np.abs(most - least) / np.abs(most + least))
    smooth = np.convolve(angle, np.ones(15) / 15.0, mode="valid")
    stamp = read_column_stamp(Path("column.h5"))
    density = stamp.density * stamp.solid_fraction
    late = float(angle[len(angle) * 3 // 5 :].mean())
    return tuple(Soil(density, phi, np.arctan(STEEL)) for phi in (float(smooth.max()), late))


def blade_run(name: str) -> dict[str, np.ndarray]:
    """Return way [m], draft and lift [N] of a blade: the force of the tool on the soil."""
    rows = read_history(Path(f"{name}_surfaces.csv"))
    return {"way": rows["x"] - rows["x"][0], "draft": -rows["force_x"], "lift": -rows["force_z"]}


def blades(places: list[str], soils: tuple[Soil, Soil]) -> tuple[list[str], dict]:
    """Return lines of the table, and what belongs to each depth."""
    lines, found = [], {}
    for depth in DEPTHS:
        runs = [blade_run(f"blade_{round(1e3 * depth)}_{p}") for p in places]
        blade = Blade(WIDTH, depth, RAKE, depth / np.sin(RAKE), SPEED)
        means = {}
        for key in ("draft", "lift"):
            means[key] = [
                float(r[key][(r["way"] > BAND[0]) & (r["way"] < BAND[1])].mean()) for r in runs
            ]
        way = 0.5 * sum(BAND)
        forms = {
            "wedge and crescents": mckyes(soils[0], blade),
            "with heap": mckyes(soils[0], blade, way),
            "with heap, last friction": mckyes(soils[1], blade, way),
            "wedge alone with heap": mckyes(soils[0], blade, way, sides=False),
        }
        lines.append(f"blade {1e3 * depth:.0f} mm: draft " + " ".join(f"{f:.3f}" for f in means["draft"])
                     + " lift " + " ".join(f"{f:.3f}" for f in means["lift"]) + " N")  # fmt: skip
        for name, value in forms.items():
            ratio = np.mean(means["draft"]) / value[0]
            lines.append(f"   McKyes, {name}: {value[0]:.3f} N, grains over it {ratio:.2f}")
        value = gill_vanden_berg(soils[0], blade)
        ratio = np.mean(means["draft"]) / value
        lines.append(f"   Gill and Vanden Berg: {value:.3f} N, grains over it {ratio:.2f}")
        found[depth] = {"runs": runs, "blade": blade, "means": means, "gill": value}
    drafts = [np.mean(found[d]["means"]["draft"]) for d in DEPTHS]
    power = np.polyfit(np.log(DEPTHS), np.log(drafts), 1)[0]
    own = [mckyes(soils[0], found[d]["blade"], 0.5 * sum(BAND))[0] for d in DEPTHS]
    lines.append(f"power of the depth: {power:.2f}, McKyes with heap "
                 f"{np.polyfit(np.log(DEPTHS), np.log(own), 1)[0]:.2f}")  # fmt: skip
    return lines, found


def bucket_run(place: str) -> dict:
    """Return angle [rad], moment and force along the lip's path, mass within and its weight there."""
    rows = read_history(Path(f"bucket_{place}_surfaces.csv"))
    rate = LIP_SPEED / RADIUS
    pivot = np.array([*MIDDLE, float(Path("top").read_text()) + RADIUS - DIG])
    pivot[0] -= 0.02
    pivot[:2] += PLACES[place]
    bed = read_packing(Path(f"bucket_{place}_bed.h5"))
    mass = dict(
        zip(bed.id.tolist(), 4.0 / 3.0 * np.pi * 2650.0 * bed.axes.prod(axis=1), strict=True)
    )
    held, weight = [], []
    for step in field_steps(Path(f"bucket_{place}.h5")):
        angle = BEGIN + rate * step.time
        grains = step.grains
        chosen = inside(grains["x"] - pivot, angle)
        own = np.array([mass[int(i)] for i in grains["id"][chosen]])
        held.append((angle, own.sum()))
        weight.append(GRAVITY * own @ (grains["x"][chosen, 0] - pivot[0]) / RADIUS)
    angle = BEGIN + rate * rows["time"]
    return {"angle": angle, "moment": rows["moment_y"], "force": rows["moment_y"] / RADIUS,
            "held": np.array(held), "weight": np.array(weight)}  # fmt: skip


def lip_form(soil: Soil, angle: np.ndarray) -> np.ndarray:
    """Return what McKyes gives for the force along the path while the lip goes down [N].

    A blade of the depth and the rake that the lip has at each angle, sides held by the bucket.
    """
    lip = PROFILE[1] - PROFILE[0]
    relief = np.arctan2(-lip[1], -lip[0])
    force = np.full(angle.shape, np.nan)
    for k, a in enumerate(angle):
        depth, rake = RADIUS * np.cos(a) - RADIUS + DIG, relief - a
        if depth > 0.0 and a < 0.0:
            draft, down = mckyes(soil, Blade(BUCKET, depth, rake, 0.0, LIP_SPEED))
            force[k] = draft * np.cos(a) - down * np.sin(a)
    return force


def bucket_lines(runs: list[dict], soil: Soil) -> list[str]:
    """Return what the bucket took up, and its forces."""
    full, cut = capacity() * soil.density, swept() * soil.density
    end = np.array([run["held"][-1, 1] for run in runs])
    lines = [f"bucket: holds {1e6 * capacity():.1f} cm3 struck, its lip cuts {1e6 * swept():.1f} cm3",
             "   fill over struck " + " ".join(f"{m / full:.2f}" for m in end)
             + ", of what was cut " + " ".join(f"{m / cut:.2f}" for m in end)]  # fmt: skip
    for name, run in zip(sys.argv[1:], runs, strict=True):
        form = lip_form(soil, run["angle"])
        work = np.trapezoid(run["moment"], run["angle"])
        smooth = np.convolve(run["force"], np.ones(15) / 15.0, mode="same")
        lines.append(f"   {name}: largest force {smooth.max():.3f} N at {np.degrees(run['angle'][smooth.argmax()]):.0f} "
                     f"degrees, McKyes at most {np.nanmax(form):.3f} N, work {1e3 * work:.2f} mJ, "
                     f"{work / run['held'][-1, 1]:.3f} J/kg, "
                     f"at the end {smooth[-20:-10].mean():.3f} N, weight within {run['weight'][-1]:.3f} N")  # fmt: skip
    return lines


def draw(found: dict, runs: list[dict], soils: tuple[Soil, Soil]) -> None:
    """Draw drafts over the way and the bucket's force and fill over its angle."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), constrained_layout=True)
    for colour, (depth, own) in zip(("C0", "C1", "C3"), found.items(), strict=True):
        for k, run in enumerate(own["runs"]):
            smooth = np.convolve(run["draft"], np.ones(5) / 5.0, mode="same")
            left.plot(1e3 * run["way"], smooth, colour, lw=0.7,
                      label=f"{1e3 * depth:.0f} mm deep" if k == 0 else None)  # fmt: skip
        ways = np.linspace(0.0, 0.04, 41)
        for soil, dashes in zip(soils, ("-", "--"), strict=True):
            left.plot(
                1e3 * ways,
                [mckyes(soil, own["blade"], w)[0] for w in ways],
                colour,
                lw=1.8,
                ls=dashes,
            )
        left.plot([38, 40], 2 * [own["gill"]], colour, lw=4)
    left.set(xlabel="way of the blade [mm]", ylabel="draft [N]", xlim=(0, 40), ylim=(0, None),
             title="thin: grains; thick: McKyes, with heap\n(dashed: friction at large strain); "
             "bars: Gill and Vanden Berg")  # fmt: skip
    left.legend()
    for name, run in zip(sys.argv[1:], runs, strict=True):
        smooth = np.convolve(run["force"], np.ones(9) / 9.0, mode="same")
        right.plot(np.degrees(run["angle"]), smooth, lw=1.0, label=f"place {name}")
    angle = runs[0]["angle"]
    right.plot(
        np.degrees(angle), lip_form(soils[0], angle), "k", lw=2, label="McKyes at lip and rake"
    )
    right.set(xlabel="angle of the arm from straight down [degrees]",
              ylabel="force along the lip's path [N]",
              xlim=np.degrees([BEGIN, END]), title="bucket on an arc (dash-dotted: weight of what is within)")  # fmt: skip
    beside = right.twinx()
    for run in runs:
        right.plot(np.degrees(run["held"][:, 0]), run["weight"], "k", lw=0.8, ls="-.")
        beside.plot(np.degrees(run["held"][:, 0]), run["held"][:, 1] / (capacity() * soils[0].density),
                    "0.6", ls=":")  # fmt: skip
    beside.set(ylabel="mass within over struck fill (dotted)", ylim=(0, None))
    right.legend(loc="upper left", fontsize=8)
    fig.savefig("force.png", dpi=120)


def main() -> None:
    """Write result.txt and force.png."""
    places = sys.argv[1:]
    soils = soil_of_test()
    lines = [f"friction in plane strain {np.degrees(soils[0].friction):.1f} degrees, at large strain "
             f"{np.degrees(soils[1].friction):.1f}, on the tool {np.degrees(soils[0].steel):.1f}; "
             f"weight {soils[0].density * GRAVITY / 1e3:.2f} kN/m3"]  # fmt: skip
    table, found = blades(places, soils)
    runs = [bucket_run(place) for place in places]
    lines += table + bucket_lines(runs, soils[0])
    with Path("cost.csv").open() as file:
        lines += [f"{row[0]}: {float(row[2]):.0f} s of processors" for row in csv.reader(file)]
    Path("result.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    Path("result.json").write_text(json.dumps(
        {"friction": soils[0].friction, "drafts": {d: found[d]["means"] for d in DEPTHS}}, indent=1))  # fmt: skip
    draw(found, runs, soils)


if __name__ == "__main__":
    main()
