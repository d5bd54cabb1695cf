"""Write decks and mesh of the micromorphic surround from what the pack itself gives.

Usage: micro.py OUT STRENGTH END. OUT holds surround.h5, probe_probe.json and
probe_micromorphic_all.csv (stages prepare, probe), STRENGTH is the strength.json of element tests
of the same grains, END the end of the run [s]. The mesh is coarser than surround.h5: a plastic
micromorphic point costs some hundred times what one of linear elasticity does.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import prepare

from talus.mesh import write_mesh

RATIO = 10.0  # stiffness of the grains over that of their contacts
TAUS = 11
LAYER = 0.020  # height of an element, about [m]


def micromorphic(bulk: float, shear: float, kappa: float) -> dict[str, float]:
    """Moduli [Pa] of contacts and grains in series that are bulk and shear where chi is free."""
    share = (1.0 + RATIO) / RATIO
    g, k = share * shear, share * bulk
    lame = k - 2.0 / 3.0 * g
    return {
        "lambda": (4.0 + RATIO) * lame,
        "mu": (4.0 + RATIO) * g,
        "eta": -lame,
        "tau": -(2.0 + RATIO) * lame,
        "kappa": 0.5 * kappa - g,
        "nu": -0.5 * kappa - g,
        "sigma": -(2.0 + RATIO) * g,
    }


def write_surround(out: Path) -> None:
    """Write the surround with one element across free grains, one across ghosts, one beyond."""
    with h5py.File(out / "surround.h5") as file:
        top = float(file["nodes/x"][:, 2].max())
    prepare.LAYER = LAYER
    prepare.LINES = np.array([prepare.INNER, prepare.FREE_EDGE, prepare.GHOST_EDGE, prepare.OUTER])
    write_mesh(out / "micro" / "surround.h5", prepare.surround(top, prepare.levels(top, deep=True)))


def main() -> int:
    """Fill the decks."""
    out = Path(sys.argv[1])
    probe = json.loads((out / "probe_probe.json").read_text())["probed"]
    strength = json.loads(Path(sys.argv[2]).read_text())["peak"]
    with (out / "probe_micromorphic_all.csv").open() as file:
        names = [name.split(" ")[0] for name in file.readline().strip().split(",")]
        affine = dict(zip(names, np.loadtxt(file, delimiter=",", ndmin=2)[-1], strict=True))
    kappa = affine["kappa"] - affine["nu"]
    values = micromorphic(probe["bulk_Pa"], probe["shear_Pa"], kappa)
    values = {name: f"{value:.6g}" for name, value in values.items()}
    values["taus"] = ", ".join(f"{affine[f'tau_{k + 1}']:.5g}" for k in range(TAUS))
    values |= {
        "micro_inertia": f"{affine['micro_inertia']:.6g}",
        "ratio": f"{RATIO:g}",
        "friction": f"{strength['friction_deg']:.4g}",
        "dilation": f"{strength['dilation_deg']:.4g}",
        "end": sys.argv[3],
    }
    for name in ("micro.nml", "micro_solid.nml"):
        text = (out / name).read_text()
        for key, value in values.items():
            text = text.replace(f"@{key}@", value)
        (out / "micro" / name).write_text(text)
    write_surround(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
