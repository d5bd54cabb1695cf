"""Input of CalculiX for the cubes of `make bench`, and what it prints."""

import math
import re
import shutil
from pathlib import Path

import h5py
import numpy as np

TYPES = {"hex8": "C3D8", "hex20": "C3D20"}  # fully integrated; node order is that of VTK
SOLVERS = {"direct": "SPOOLES", "iterative": "ITERATIVE CHOLESKY"}


def installed() -> str | None:
    """Return the command, if it is installed."""
    return shutil.which("ccx")


def write_model(path: Path, mesh: Path, constants: tuple[float, float, float]) -> None:
    """Write nodes, elements, support and material (E [Pa], nu, density [kg/m3]) of a cube."""
    with h5py.File(mesh) as file:
        kind = next(iter(file["cells"]))
        x, cells = file["nodes/x"][:], file[f"cells/{kind}"][:] + 1
        base = file["node_groups/z0"][:] + 1
    young, poisson, density = constants
    with path.open("w") as out:
        out.write("*NODE, NSET=ALL\n")
        out.writelines(f"{k + 1},{p[0]:.12g},{p[1]:.12g},{p[2]:.12g}\n" for k, p in enumerate(x))
        out.write(f"*ELEMENT, TYPE={TYPES[kind]}, ELSET=CUBE\n")
        for k, nodes in enumerate(cells):
            line = [str(k + 1), *map(str, nodes)]
            rows = [",".join(line[i : i + 15]) for i in range(0, len(line), 15)]
            out.write(",\n".join(rows) + "\n")
        out.write("*NSET, NSET=BASE\n")
        out.writelines(f"{k},\n" for k in base)
        corner = int(np.argmax(x.sum(axis=1))) + 1
        out.write(f"*NSET, NSET=CORNER\n{corner}\n*MATERIAL, NAME=M\n*ELASTIC\n{young},{poisson}\n")
        out.write(f"*DENSITY\n{density}\n*SOLID SECTION, ELSET=CUBE, MATERIAL=M\n")
        out.write("*BOUNDARY\nBASE,1,3\n")


def step(model: str, gravity: tuple[float, float, float], procedure: str) -> str:
    """Return a deck: the model and one step of a procedure under gravity [m/s2]."""
    size = math.sqrt(sum(g * g for g in gravity))
    way = ", ".join(f"{g / size:.15g}" for g in gravity)
    return (
        f"*INCLUDE, INPUT={model}\n*STEP, INC=1000000\n{procedure}\n*DLOAD\n"
        f"CUBE, GRAV, {size:.15g}, {way}\n"
        "*NODE PRINT, NSET=CORNER, FREQUENCY=1000000\nU\n*END STEP\n"
    )


def static(model: str, gravity: tuple[float, float, float], solver: str) -> str:
    """Return the deck of a static run, `direct` or `iterative`."""
    return step(model, gravity, f"*STATIC, SOLVER={SOLVERS[solver]}")


def explicit(model: str, gravity: tuple[float, float, float], dt: float, t_end: float) -> str:
    """Return the deck of central differences [s]; the code chooses the step itself."""
    return step(model, gravity, f"*DYNAMIC, EXPLICIT\n{dt:.9g}, {t_end:.9g}")


def corner(path: Path) -> list[float]:
    """Read the displacement of the corner [m] from the .dat file."""
    rows = re.findall(r"^\s*\d+((?:\s+[-+\d.E]+){3})\s*$", path.read_text(), flags=re.M)
    return [float(value) for value in rows[-1].split()]


def explicit_step(said: str) -> float:
    """Return the step [s] of an explicit run."""
    return float(re.findall(r"SELECTED time increment:\s*(\S+)", said)[-1])
