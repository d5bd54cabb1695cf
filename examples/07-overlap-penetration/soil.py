"""Constants of the surround from an element test of the bed itself.

Usage: soil.py sample OUT | shear OUT | fit OUT. `sample` cuts a box from OUT/pressed.h5 and writes
the decks that bring it to rest under the stress of probe_probe.json; `shear` lets the next deck go
on from there; `fit` reads the test, the stress and the height of the bed, and writes soil.json,
soil.png and decks in chord/ and plastic/. Beside the chord to half the strength soil.json has the
secant to the strain that the tool makes beside the free zone at the end of its stroke.
"""

import json
import sys
from pathlib import Path

import numpy as np
from prepare import RADIUS, SIDES, STROKE, displaced

from talus.look import COLOURS, new_figure, save_figure
from talus.mesh import read_mesh
from talus.packing import FREE, read_packing, write_packing_file
from talus.secant import secant_at, strain_beside
from talus.specimens import read_specimen
from talus.verification import read_history

HALF, LOW, HIGH = 0.0275, -0.015, 0.045  # half-width of the sample, its ends in the bed [m]
ROOM = 0.0025  # from the centres of its outer grains to the walls [m]
SPEED, SHORTER = 0.1, 0.06  # of the wall [m/s], strain at the end of the test
SMALL = 0.02  # strain to which the law is fitted: more than ghosts undergo


def fill(deck: Path, folder: Path, values: dict[str, float]) -> None:
    """Write a deck into a folder with its numbers."""
    text = deck.read_text()
    for key, value in values.items():
        text = text.replace(f"@{key}@", f"{value:.6g}")
    (folder / deck.name).write_text(text)


def cut(out: Path) -> None:
    """The sample and the deck that brings it to rest."""
    bed = read_packing(out / "pressed.h5")
    lower, upper = np.array([-HALF, -HALF, LOW]), np.array([HALF, HALF, HIGH])
    part = bed.take((bed.kind == FREE) & np.all((bed.x > lower) & (bed.x < upper), axis=1))
    part.x += ROOM - lower
    part.v[:], part.omega[:], part.surcharge[:] = 0.0, 0.0, 0.0
    part.groups = {}
    write_packing_file(out / "sample_pack.h5", part)
    fill(out / "sample.nml", out, stresses(out))
    print(f"sample_pack.h5: {part.count} grains")


def stresses(out: Path) -> dict[str, float]:
    """Stress to hold [Pa] and places of the walls [m]."""
    stress = -np.array(json.loads((out / "probe_probe.json").read_text())["stress_Pa"][:3])
    return {"level": stress[:2].mean(), "upright": stress[2],
            "wide": 2.0 * (HALF + ROOM), "high": HIGH - LOW + 2.0 * ROOM}  # fmt: skip


def go_on(out: Path) -> None:
    """The deck of the test: so much longer than the sample took."""
    began = json.loads((out / "sample_summary.json").read_text())["time_s"]
    end = began + SHORTER * 2.0 * (HALF + ROOM) / SPEED
    fill(out / "shear.nml", out, stresses(out) | {"end": end})


def test_of(out: Path) -> dict[str, np.ndarray]:
    """Strains (n, 3), compression positive; mean stress, length of the deviator [Pa]."""
    walls, pack = (read_history(out / f"shear_{name}.csv") for name in ("walls", "measure_all"))
    ends = np.array([[walls[c][walls["wall"] == 2 * k + side] for side in (1, 2)]
                     for k, c in enumerate("xyz")])  # fmt: skip
    length = ends[:, 1] - ends[:, 0]
    times = walls["time"][walls["wall"] == 1]
    strain = np.array([np.interp(pack["time"], times, -np.log(row / row[0])) for row in length]).T
    stress = np.array([[pack[f"stress_{a}{b}"] for b in "xyz"] for a in "xyz"])
    stress = -0.5 * np.moveaxis(stress + np.swapaxes(stress, 0, 1), -1, 0)
    mean = np.trace(stress, axis1=1, axis2=2) / 3.0
    deviator = np.linalg.norm(stress - mean[:, None, None] * np.eye(3), axis=(1, 2))
    return {"strain": strain, "push": stress[:, 0, 0], "mean": mean, "deviator": deviator}


def fit(out: Path) -> dict[str, float]:
    """Young's modulus and Poisson's ratio of the chord to half the strength, cone, dilation."""
    test = test_of(out)
    strain, push, mean = test["strain"], test["push"], test["mean"]
    slope = float((test["deviator"] / mean).max())
    half = int(np.argmax(push - push[0] > 0.5 * (push.max() - push[0])))
    young = float((push[half] - push[0]) / strain[half, 0])
    poisson = float(-0.5 * strain[half, 1:].sum() / strain[half, 0])
    to = int(np.argmin(abs(strain[:, 0] - SMALL)))
    bulk = young / (3.0 * (1.0 - 2.0 * poisson))
    volume = float(strain[to].sum() - (mean[to] - mean[0]) / bulk)
    turned = float(np.linalg.norm(strain[to] - strain[to].mean()))
    return {
        "young_Pa": young, "poisson": poisson, "strain_at_half": float(strain[half, 0]),
        "friction_deg": angle(slope), "dilation_deg": angle(-volume / turned),
    }  # fmt: skip


def angle(slope: float) -> float:
    """Angle [deg] of a cone through triaxial compression with this slope |s|/p."""
    return float(np.degrees(np.arcsin(3.0 * slope / (2.0 * np.sqrt(6.0) + slope))))


def rest_of(out: Path) -> dict[str, float]:
    """The bed at rest: horizontal over vertical stress, height of the surface of the mesh [m]."""
    stress = stresses(out)
    top = float(read_mesh(out / "surround.h5").x[:, 2].max())
    return {"k0": stress["level"] / stress["upright"], "top": top}


def beside(out: Path) -> dict[str, float]:
    """Secant to the strain beside the free zone at the end of the stroke, and what it uses."""
    strain = strain_beside(float(displaced(STROKE)), SIDES, RADIUS)
    found = secant_at(read_specimen(out / "shear_walls.csv", "x"), strain)
    return {"strain_beside": strain, "young_beside_Pa": found.young_Pa,
            "poisson_beside": found.poisson, "of_strength_beside": found.of_strength}  # fmt: skip


def draw(out: Path, soil: dict[str, float]) -> None:
    """The test, and the chord that stands for it."""
    test = test_of(out)
    axial = 100.0 * test["strain"][:, 0]
    fig, (left, right) = new_figure(ncols=2, figsize=(9.4, 3.8))
    left.plot(axial, 1e-3 * test["push"], color=COLOURS[0], label="sample of the bed")
    end = np.array([0.0, 2.0 * soil["strain_at_half"]])
    chord = 1e-3 * (test["push"][0] + soil["young_Pa"] * end)
    left.plot(100.0 * end, chord, "--", color=COLOURS[1], label="chord to half the strength")
    left.set(xlabel="shortening [%]", ylabel="stress along x [kPa]")
    left.legend(fontsize=8)
    right.plot(axial, 100.0 * test["strain"].sum(axis=1), color=COLOURS[0])
    right.set(xlabel="shortening [%]", ylabel="loss of volume [%]")
    save_figure(fig, out / "soil.png")


def main() -> int:
    """One of the three steps."""
    step, out = sys.argv[1], Path(sys.argv[2])
    if step == "sample":
        cut(out)
    elif step == "shear":
        go_on(out)
    else:
        soil = fit(out) | rest_of(out) | beside(out)
        (out / "soil.json").write_text(json.dumps(soil, indent=2) + "\n")
        draw(out, soil)
        for name in ("chord", "plastic"):
            (out / name).mkdir(exist_ok=True)
            fill(out / f"{name}_solid.nml", out / name, soil)
        print(", ".join(f"{name} {value:.4g}" for name, value in soil.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
