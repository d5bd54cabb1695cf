"""Specimens and decks of the saturated cone.

Usage: prepare.py cloud SEED; prepare.py settle NAME; prepare.py elements NAME; prepare.py pushes
NAME, in the folder of the run; NAME is dense_1, loose_1, ...
"""

import json
import sys
from pathlib import Path

import numpy as np

from talus.generate import cloud, uniform_sizes
from talus.packing import read_h5, write_h5
from talus.verification import read_history

RADIUS, SPREAD = 1.0e-3, 0.1  # of the grains [m], [-]
WIDTH, HEIGHT = 0.028, 0.032  # of the specimens, nearly [m]
LOOSE, PACKED = 0.28, 0.60  # solid fractions: of a cloud, of its specimen
MAKING = {"dense": 0.02, "loose": 1.0}  # friction between grains while they are pressed
CONE, SPEED = 6.0e-3, 0.18  # diameter [m], [m/s]
WAYS = {"dense": 6.0e-3, "loose": 9.0e-3}  # [m]
START, REST = 2.0e-4, 1.5e-3  # of the tip above the lid [m], until it moves in the mean [s]
SHORTENED = 0.2  # strain of the element test
VISCOSITY = 1.0e-3  # [Pa s]
FIELDS = Path(__file__).parent  # of the decks
SPEEDS = {"v0.01": 0.01, "v0.3": 0.3, "v3": 3.0, "v30": 30.0, "v1000": 1000.0}  # v d / c_v
KINDS = ["dry", "sealed", "cavitated", *SPEEDS]
DRAINS = "".join(f"&drain     side = '{side}', pressure = 0.0, layer = {RADIUS} /\n"
                 for side in ("x0", "x1", "y0", "y1"))  # fmt: skip
NEVER, BOILS = 1.0e9, 1.0e5  # tension at which the liquid parts, where it does not and where it does [Pa]
LIQUID = """
&fluid     id = 'water', density = 1000.0, viscosity = 1.0e-3, bulk_modulus = 2.2e8 /
&pore_grid fluid = 'water', lower = 0.0, 0.0, 0.0, upper = @east@, @north@, @top@, bricks = 4, 4, 4, surface = 'closed',
           exchange = 2, fluctuation = .false., cavitation = BOILS, permeability_factor = FACTOR /
"""


def fill(part: str, name: str, words: dict[str, str]) -> None:
    """Write a deck with its words filled in."""
    text = (FIELDS / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(f"@{word.lower()}@", value)
    Path(f"{name}.nml").write_text(text)


def make_clouds(seed: str) -> None:
    """Write a cloud of grains and the decks that press it, dense and loose."""
    box = np.array([WIDTH, WIDTH, HEIGHT]) * (PACKED / LOOSE) ** (1.0 / 3.0)
    count = int(LOOSE * box.prod() / (4.0 / 3.0 * np.pi * RADIUS**3))
    sizes = uniform_sizes(count, SPREAD, np.random.default_rng(int(seed)))
    write_h5(Path(f"cloud_{seed}.h5"), cloud(sizes, box, np.full(3, RADIUS), int(seed)))
    for kind, friction in MAKING.items():
        words = {"MAKING": f"{friction}", "CLOUD": f"cloud_{seed}.h5", "WIDTH": f"{box[0]}",
                 "HEIGHT": f"{box[2]}", "PACK": f"{kind}_{seed}_pressed.h5"}  # fmt: skip
        fill("press", f"{kind}_{seed}_press", words)


def edges(name: str, stage: str = "settle") -> np.ndarray:
    """Return the edges of a specimen at the end of a stage [m]."""
    walls = read_history(Path(f"{name}_{stage}_walls.csv"))
    last = walls["time"] == walls["time"].max()
    return np.array([walls[axis][last][k] for axis, k in (("x", 1), ("y", 3), ("z", 5))])


def walls_of(name: str, stage: str = "settle") -> dict[str, str]:
    """Return the words for the specimen and its walls."""
    east, north, top = edges(name, stage)
    return {"PACK": f"{name}.h5", "EAST": f"{east}", "NORTH": f"{north}", "TOP": f"{top}"}


def write_settle(name: str) -> None:
    """Write the deck that lets a specimen come to rest with the friction of the tests."""
    words = {"SETTLED": f"{name}.h5"} | walls_of(name, "press") | {"PACK": f"{name}_pressed.h5"}
    fill("settle", f"{name}_settle", words)


def write_elements(name: str) -> None:
    """Write the decks for stiffness and shear of a specimen, the latter at the rate of the cone."""
    fill("oedometer", f"{name}_oedometer", walls_of(name))
    rate = SPEED / CONE
    words = {"SINK": f"{rate * edges(name)[2]:.6g}", "T_END": f"{5.0e-4 + SHORTENED / rate:.6g}"}
    fill("shear", f"{name}_shear", words | walls_of(name))


def stiffness(name: str) -> float:
    """Return the constrained modulus at the start [Pa]."""
    walls = read_history(Path(f"{name}_oedometer_walls.csv"))
    lid = walls["wall"] == 6
    stress = walls["force_z"][lid] / edges(name)[:2].prod()
    top = walls["z"][lid]
    moves = walls["time"][lid] >= 4.0e-4
    strain, stress = 1.0 - top[moves] / top[0], stress[moves]
    return float(np.polyfit(strain, stress, 1)[0])


def pores(name: str) -> tuple[float, float]:
    """Return porosity and permeability by Kozeny and Carman [m2]."""
    pack = read_h5(Path(f"{name}.h5"))
    solid = float(4.0 / 3.0 * np.pi * pack.axes.prod(1).sum() / edges(name).prod())
    sauter = 2.0 * float((pack.axes[:, 0] ** 3).sum() / (pack.axes[:, 0] ** 2).sum())
    return 1.0 - solid, sauter**2 * (1.0 - solid) ** 3 / (180.0 * solid**2)


def liquid(kind: str, name: str) -> str:
    """Return the groups of the liquid."""
    modulus, (_, permeability) = stiffness(name), pores(name)
    wanted = SPEED * CONE * VISCOSITY / (modulus * SPEEDS.get(kind, SPEEDS["v1000"]))
    text = LIQUID.replace("FACTOR", f"{wanted / permeability:.6g}")
    text = text.replace("BOILS", f"{BOILS if kind == 'cavitated' else NEVER:.1e}")
    return text + (DRAINS if kind in SPEEDS else "")


def write_pushes(name: str) -> None:
    """Write the decks that push the cone into a specimen, and its constants."""
    east, north, top = edges(name)
    words = {
        "TIP": f"{0.5 * east}, {0.5 * north}, {top + START}",
        "AREA": f"{east * north - 0.25 * np.pi * CONE**2}",
        "T_END": f"{REST + (START + WAYS[name.split('_')[0]]) / SPEED}",
        "SPEED": f"{SPEED}",
        "OFTEN": f"{4.5e-5 / SPEED:.6g}",
    }
    for kind in KINDS:
        wet = "" if kind == "dry" else liquid(kind, name)
        drained = kind in ("dry", "v0.01")  # the lid is held against the stiffness of the grains
        groups = {"TITLE": f"{name}, {kind}", "LIQUID": wet, "GAIN": "0.3" if drained else "0.1",
                  "TOTAL": "" if drained else ", total = .true."}  # fmt: skip
        fill("push", f"{name}_{kind}", groups | walls_of(name) | words)
    porosity, permeability = pores(name)
    constants = {"porosity": porosity, "permeability_m2": permeability, "modulus_Pa": stiffness(name)}
    Path(f"{name}.json").write_text(json.dumps(constants, indent=1) + "\n")


if __name__ == "__main__":
    stages = {"cloud": make_clouds, "settle": write_settle, "elements": write_elements, "pushes": write_pushes}
    stages[sys.argv[1]](sys.argv[2])
