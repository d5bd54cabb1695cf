"""The yielding surround with a free rim, the tool at some place: packing, mesh and decks of OUT/NAME.

Usage: rim.py OUT NAME X Y. OUT is a folder that run.sh has brought to its stage `soil`, the tool
stands at X, Y [mm]. Damping of the solid is 0.8 of the lowest circular frequency of an oedometer as
high as the bed. OUT/NAME gets the packings of the overlap and of all grains, the mesh and decks.
"""

import json
import sys
from pathlib import Path

import numpy as np
import prepare
import soil

from talus.mesh import write_mesh
from talus.packing import read_packing, write_packing_file

HEIGHT, DENSITY, PART = 0.08, 1606.0, 0.8  # of the bed [m], of the solid [kg/m3], of the frequency


def damping(young: float, poisson: float) -> float:
    """Rate of the damping of mass in an oedometer of moduli [Pa] and height HEIGHT [1/s]."""
    modulus = young * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    return PART * 0.5 * np.pi * np.sqrt(modulus / DENSITY) / HEIGHT


def write_decks(out: Path, folder: Path, top: float) -> None:
    """The decks of `plastic`, with nodes of the rim free and the solid damped."""
    constants = json.loads((out / "soil.json").read_text())
    text = (out / "plastic.nml").read_text()
    text = text.replace("projection = 'mls', mass = 'nearest', ", "rim_nodes = 'free', ")
    (folder / "plastic.nml").write_text(text)
    soil.fill(out / "plastic_solid.nml", folder, constants | {"top": top})
    deck = folder / "plastic_solid.nml"
    rate = damping(constants["young_Pa"], constants["poisson"])
    kind = "kind = 'explicit'"
    deck.write_text(deck.read_text().replace(kind, f"{kind}, rayleigh_mass = {rate:.4g}"))
    for name in ("grains.nml", "truth.nml"):
        (folder / name).write_text((out / name).read_text())


def main() -> int:
    """Write packings, mesh and decks."""
    out = Path(sys.argv[1])
    folder, at = out / sys.argv[2], 1e-3 * np.array([float(word) for word in sys.argv[3:5]])
    folder.mkdir(exist_ok=True)
    bed = read_packing(out / "pressed.h5")
    bed.x[:, :2] -= at
    top = prepare.top_of(bed)
    level = prepare.levels(top, False)
    packing = prepare.core(bed, level, prepare.NEAR_EDGE)
    write_packing_file(folder / "core_pack.h5", packing)
    write_packing_file(folder / "truth_pack.h5", prepare.whole(bed, at))
    write_mesh(folder / "surround.h5", prepare.surround(top, level))
    write_decks(out, folder, top)
    print(f"{folder.name}/core_pack.h5: {packing.count} grains, tool at {at} m")
    return 0


if __name__ == "__main__":
    sys.exit(main())
