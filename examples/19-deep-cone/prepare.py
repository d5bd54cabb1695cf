"""Decks, packings and mesh of a cone in a bed that wakes around it.

Usage, in the folder of the run: prepare.py tests; prepare.py beds once these have run.
"""

import json
import sys
from pathlib import Path

import numpy as np

from talus.column_stamp import read_column_stamp
from talus.mesh import box, write_mesh
from talus.packing import FIXED, Packing, read_packing, write_h5
from talus.verification import read_history

COPIES, EDGE, HEIGHT = 6, 0.036, 0.13  # columns along x and y, their width, height of the bed [m]
ELEMENTS = (20, 20, 12)
PLACES = {"a": (0.108, 0.108), "b": (0.1188, 0.1296)}  # of the cone: corners of elements [m]
RADIUS, SPEED, STROKE, TIP = 6.0e-3, 0.1, 0.06, 0.1305  # [m], [m/s]; TIP: at the start
#: Of a zone: free_within of its deck, half-widths of its free grains and of its ghosts [m].
ZONES = {"narrow": (0.030, 0.0324, 0.0432), "wide": (0.032, 0.0432, 0.054)}
BOX = "wide"  # the zone whose free grains the rigid box has
TESTS, SHORTEN, SLOW = (1, 2, 3), 0.02, 2.0e-3  # borders, strain, inertial number
END = 0.6099  # of the runs: 3210 exchanges [s]
#: Before the groups of a deck that is made of parts.
HEAD = "&run title = '{}', gravity = 0.0, 0.0, -9.81{} /\n"
ALONE = f", t_end = {END}"


def text(name: str, **values: object) -> str:
    """Return the text of a deck of the example with its values."""
    found = (Path(__file__).parent / f"{name}.nml").read_text()
    for key, value in values.items():
        found = found.replace(f"@{key}@", value if isinstance(value, str) else f"{value:.9g}")
    return found


def prepare_tests() -> None:
    """Write the decks of the element tests: layers under the stresses that they have."""
    stamp = read_column_stamp(Path("column.h5"))
    for k in TESTS:
        across, along = stamp.replayed[k, :2].mean(), stamp.replayed[k, 2]
        pressure = (2.0 * across + along) / 3.0
        rate = SLOW / (stamp.mean_diameter * np.sqrt(stamp.density / pressure))
        time = SHORTEN / rate
        deck = text("test", t_end=time, layer=k, shorten=-rate, yy=across, zz=along,
                    most=5.0 * rate, every=time / 400)  # fmt: skip
        Path(f"test_{k}.nml").write_text(deck)


def surround(zone: str) -> dict:
    """Return the constants of the surround by the rule of the manual (Choosing the surround).

    Secants to the strain around the zone in the middle of the way that is judged, 20 to 60 mm, the
    share of the strength that they use there, and the strain at half the strength.
    """
    stamp, depth = read_column_stamp(Path("column.h5")), 0.04
    within, free, ghost = ZONES[zone]
    away = 0.5 * (free + ghost)
    pushed = np.pi * RADIUS**2 * (depth - 2.0 / 3.0 * RADIUS * np.sqrt(3.0))
    strain = pushed / (2.0 * np.pi * away * (depth + within) * away)
    found = {"strain": strain, "depth": [], "young": [], "poisson": [], "used": [], "half": []}
    for k in TESTS:
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
    return {key: np.asarray(value).tolist() for key, value in found.items()}


def prepare_mesh() -> None:
    """Write the mesh, a group a layer of elements."""
    mesh = box(np.zeros(3), np.array([COPIES * EDGE, COPIES * EDGE, HEIGHT]), ELEMENTS)
    layer = np.arange(mesh.count) // (ELEMENTS[0] * ELEMENTS[1])
    for k in range(ELEMENTS[2]):
        mesh.volumes[f"layer{k}"] = np.flatnonzero(layer == k)
    write_mesh(Path("bed_mesh.h5"), mesh)


def layers(soil: dict) -> str:
    """Return materials and sections: a modulus that grows with a power of the depth."""
    power = np.polyfit(np.log(soil["depth"]), np.log(soil["young"]), 1)
    density = float(read_column_stamp(Path("column.h5")).solid_fraction) * 2650.0
    deck = ""
    for k in range(ELEMENTS[2]):
        young = np.exp(np.polyval(power, np.log(HEIGHT * (1.0 - (k + 0.5) / ELEMENTS[2]))))
        deck += (f"&material id = 'soil{k}', law = 'linear_elastic', density = {density:.5g}, "
                 f"young = {young:.5g}, poisson = {np.mean(soil['poisson']):.4g} /\n"
                 f"&section group = 'layer{k}', material = 'soil{k}', element = 'hex8_bbar' /\n")  # fmt: skip
    return deck


def prepare_beds() -> None:
    """Write beds and decks of all runs, and what the surrounds are (soil.json)."""
    soil = {zone: surround(zone) for zone in ZONES}
    Path("soil.json").write_text(json.dumps(soil, indent=1))
    prepare_mesh()
    bed = read_packing(Path("column.h5")).repeated((COPIES, COPIES, 1))
    write_h5(Path("bed.h5"), bed)
    for place, (x, y) in PLACES.items():
        tool = {"x": x, "y": y, "tip": TIP}
        write(f"whole_{place}", HEAD.format("Cone in the whole bed", ALONE), text("whole"),
              text("laws", packing="bed", **tool))  # fmt: skip
        for zone in ZONES:
            prepare_opened(f"{zone}_{place}", bed, tool, zone, layers(soil[zone]))
        prepare_box(f"box_{place}", bed, tool)


def prepare_opened(name: str, bed: Packing, tool: dict, zone: str, sections: str) -> None:
    """Write a bed that wakes around the cone; awake at first are more grains than it opens."""
    folder = Path(name)
    folder.mkdir(exist_ok=True)
    for file in ("column.h5", "bed_mesh.h5"):
        (folder / file).write_bytes(Path(file).read_bytes())
    beside = np.abs(bed.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    chosen = (beside < ZONES[zone][2] + 0.016) & (bed.x[:, 2] > 0.04)
    write_h5(folder / "awake.h5", without_cell(bed, chosen))
    write(folder / "grains", HEAD.format("Grains around the cone", ""), text("grains"),
          text("laws", packing="awake", **tool))  # fmt: skip
    write(folder / "solid", HEAD.format("Bed around the cone", ""), text("solid"), sections)
    write(folder / "coupled", text("coupled", t_end=END, x=tool["x"], y=tool["y"],
                                   middle=TIP + 0.0502, within=ZONES[zone][0]))  # fmt: skip


def prepare_box(name: str, bed: Packing, tool: dict) -> None:
    """Write the free grains that an opened bed has at its end amid grains that stand still."""
    within, free, ghost = ZONES[BOX]
    beside = np.abs(bed.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    low = TIP - STROKE - within
    inside = without_cell(bed, (beside < ghost) & (bed.x[:, 2] > low - ghost + free))
    beside = np.abs(inside.x[:, :2] - [tool["x"], tool["y"]]).max(axis=1)
    inside.kind[(beside > free) | (inside.x[:, 2] < low)] = FIXED
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
