"""Decks, packings and mesh of a cone in a bed that wakes around it.

Usage, in the folder of the run: prepare.py tests; prepare.py beds once these have run.
"""

import json
import sys
from pathlib import Path

import numpy as np
from plans import EDGE, RADIUS, Zone, plan_here

from talus.column_stamp import read_column_stamp
from talus.mesh import box, write_mesh
from talus.packing import FIXED, Packing, read_packing, write_h5
from talus.verification import read_history

SHORTEN, SLOW = 0.02, 2.0e-3  # strain of the tests, inertial number
PLAN = plan_here()
#: Before the groups of a deck that is made of parts.
HEAD = "&run title = '{}', gravity = 0.0, 0.0, -9.81{} /\n"
ALONE = f", t_end = {PLAN.end}"


def text(name: str, **values: object) -> str:
    """Return the text of a deck of the example with its values."""
    found = (Path(__file__).parent / f"{name}.nml").read_text()
    for key, value in values.items():
        found = found.replace(f"@{key}@", value if isinstance(value, str) else f"{value:.9g}")
    return found


def prepare_tests() -> None:
    """Write the decks of the element tests: layers under the stresses that they have."""
    stamp = read_column_stamp(Path("column.h5"))
    for k in PLAN.tests:
        across, along = stamp.replayed[k, :2].mean(), stamp.replayed[k, 2]
        pressure = (2.0 * across + along) / 3.0
        rate = SLOW / (stamp.mean_diameter * np.sqrt(stamp.density / pressure))
        time = SHORTEN / rate
        deck = text("test", t_end=time, layer=k, shorten=-rate, yy=across, zz=along,
                    most=5.0 * rate, every=time / 400)  # fmt: skip
        Path(f"test_{k}.nml").write_text(deck)


def surround(zone: Zone) -> dict:
    """Return the constants of the surround by the rule of the manual (Choosing the surround).

    Secants to the strain around the zone in the middle of the way that is judged, the share of the
    strength that they use there, the strain at half the strength, friction, lateral over vertical
    stress at the start.
    """
    stamp, depth = read_column_stamp(Path("column.h5")), PLAN.middle
    away = 0.5 * (zone.free + zone.ghost)
    pushed = np.pi * RADIUS**2 * (depth - 2.0 / 3.0 * RADIUS * np.sqrt(3.0))
    strain = pushed / (2.0 * np.pi * away * (depth + zone.within) * away)
    found = {"strain": strain}
    for key in ("depth", "young", "poisson", "used", "half", "friction_deg", "k0"):
        found[key] = []
    for k in PLAN.tests:
        rows = read_history(Path(f"test_{k}_cell.csv"))
        e = {c: -np.log(rows[f"deform_{c}{c}"] / rows[f"deform_{c}{c}"][0]) for c in "xyz"}
        more = rows["stress_xx"][0] - rows["stress_xx"]
        at = np.argmax(e["x"] >= strain)
        found["depth"].append(stamp.replayed[k, 2]
                              / (stamp.density * stamp.gravity * stamp.solid_fraction))  # fmt: skip
        found["young"].append(more[at] / e["x"][at])
        found["poisson"].append(-0.5 * (e["y"][at] + e["z"][at]) / e["x"][at])
        found["used"].append(more[at] / more.max())
        found["half"].append(e["x"][np.argmax(more >= 0.5 * more.max())])
        found["friction_deg"].append(friction_of(rows))
        found["k0"].append(rows["stress_xx"][0] / rows["stress_zz"][0])
    return {key: np.asarray(value).tolist() for key, value in found.items()}


def friction_of(rows: dict) -> float:
    """Return the friction [deg] of the compressive cone through the largest |s|/p of a test."""
    stress = -np.array([rows[f"stress_{c}{c}"] for c in "xyz"])
    mean = stress.mean(axis=0)
    ratio = (np.linalg.norm(stress - mean, axis=0) / mean).max()
    return float(np.degrees(np.arcsin(3.0 * ratio / (2.0 * np.sqrt(6.0) + ratio))))


def prepare_mesh() -> None:
    """Write the mesh, a group a layer of elements."""
    wide, number = PLAN.copies * EDGE, PLAN.elements
    mesh = box(np.zeros(3), np.array([wide, wide, PLAN.height]), number)
    even = np.linspace(0.0, wide, number[0] + 1)
    mesh.x[:, :2] = np.interp(mesh.x[:, :2], even, PLAN.lines())
    layer = np.arange(mesh.count) // (number[0] * number[1])
    for k in range(number[2]):
        mesh.volumes[f"layer{k}"] = np.flatnonzero(layer == k)
    write_mesh(Path("bed_mesh.h5"), mesh)


def layers(soil: dict) -> str:
    """Return materials and sections: a modulus that grows with a power of the depth, one strength.

    With one test alone the power is a half. Flow keeps the volume: beside a zone that is held all
    round, dilation without end would make the sand stronger and stronger.
    """
    power = np.array([0.5, np.log(soil["young"][0]) - 0.5 * np.log(soil["depth"][0])])
    if len(PLAN.tests) > 1:
        power = np.polyfit(np.log(soil["depth"]), np.log(soil["young"]), 1)
    density = float(read_column_stamp(Path("column.h5")).solid_fraction) * 2650.0
    deck = ""
    for k in range(PLAN.elements[2]):
        depth = PLAN.height * (1.0 - (k + 0.5) / PLAN.elements[2])
        young = np.exp(np.polyval(power, np.log(depth)))
        deck += (f"&material id = 'soil{k}', law = 'drucker_prager', density = {density:.5g}, "
                 f"young = {young:.5g}, poisson = {np.mean(soil['poisson']):.4g}, cohesion = 10.0, "
                 f"friction_deg = {np.mean(soil['friction_deg']):.4g}, dilation_deg = 0.0 /\n"
                 f"&section group = 'layer{k}', material = 'soil{k}', element = 'hex8_bbar' /\n")  # fmt: skip
    deck += (f"&geostatic group = 'all', level = {PLAN.height:g}, "
             f"k0 = {np.mean(soil['k0']):.4g} /\n")  # fmt: skip
    return deck


def prepare_beds() -> None:
    """Write beds and decks of all runs, and what the surrounds are (soil.json)."""
    soil = {name: surround(zone) for name, zone in PLAN.zones.items()}
    Path("soil.json").write_text(json.dumps(soil, indent=1))
    prepare_mesh()
    bed = read_packing(Path("column.h5")).repeated((PLAN.copies, PLAN.copies, 1))
    write_h5(Path("bed.h5"), bed)
    for place, (x, y) in PLAN.places.items():
        tool = {"x": x, "y": y, "tip": PLAN.tip, "speed": PLAN.speed}
        write(f"whole_{place}", HEAD.format("Cone in the whole bed", ALONE), text("whole"),
              text("laws", packing="bed", **tool))  # fmt: skip
        for zone in PLAN.zones:
            prepare_opened(f"{zone}_{place}", bed, tool, zone, layers(soil[zone]))
        for zone in PLAN.boxes:
            prepare_box(f"box_{zone}_{place}", bed, tool, PLAN.zones[zone])


def prepare_opened(name: str, bed: Packing, tool: dict, zone: str, sections: str) -> None:
    """Write a bed that wakes around the cone; awake at first are more grains than it opens."""
    folder = Path(name)
    folder.mkdir(exist_ok=True)
    for file in ("column.h5", "bed_mesh.h5"):
        (folder / file).write_bytes(Path(file).read_bytes())
    beside = np.abs(bed.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    chosen = (beside < PLAN.zones[zone].ghost + 0.016) & (bed.x[:, 2] > PLAN.above)
    write_h5(folder / "awake.h5", without_cell(bed, chosen))
    write(folder / "grains", HEAD.format("Grains around the cone", ""), text("grains", copies=PLAN.copies),
          text("laws", packing="awake", **tool))  # fmt: skip
    write(folder / "solid", HEAD.format("Bed around the cone", ""), text("solid"), sections)
    write(folder / "coupled", text("coupled", t_end=PLAN.end, x=tool["x"], y=tool["y"], speed=PLAN.speed,
                                   middle=PLAN.tip + 0.0502, within=PLAN.zones[zone].within,
                                   every=PLAN.every))  # fmt: skip


def prepare_box(name: str, bed: Packing, tool: dict, zone: Zone) -> None:
    """Write the free grains that an opened bed has at its end amid grains that stand still."""
    beside = np.abs(bed.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    low = PLAN.tip - PLAN.stroke - zone.within
    inside = without_cell(bed, (beside < zone.ghost) & (bed.x[:, 2] > low - zone.ghost + zone.free))
    beside = np.abs(inside.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    inside.kind[(beside > zone.free) | (inside.x[:, 2] < low)] = FIXED
    write_h5(Path(f"{name}_pack.h5"), inside)
    write(name, HEAD.format("Cone in a rigid box", ALONE), text("box"),
          text("laws", packing=f"{name}_pack", **tool))  # fmt: skip


def without_cell(bed: Packing, chosen: np.ndarray) -> Packing:
    """Return these grains of the bed, no longer in a cell."""
    part = bed.take(np.flatnonzero(chosen))
    part.cell = part.corner = part.shift = None
    return part


def write(name: str | Path, *parts: str) -> None:
    """Write a deck."""
    Path(f"{name}.nml").write_text("".join(parts))


if __name__ == "__main__":
    {"tests": prepare_tests, "beds": prepare_beds}[sys.argv[1]]()
