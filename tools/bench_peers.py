"""Input of LAMMPS and LIGGGHTS for the beds of `make bench`, and what they print.

The same E, nu, friction, step, walls and gravity as in Talus' deck. Damping: LIGGGHTS has Talus'
law (2 ratio sqrt(m* k)); LAMMPS' gran/hertz/history damps with gamma m* a v, so that gamma is
chosen to agree at the overlap OVERLAP, about the mean of the beds.
"""

import math
import re
import shutil
from pathlib import Path

import bench_beds as beds

OVERLAP = 0.003  # of the radius
SKIN = 0.1e-3  # m; the fastest of 0.05, 0.1 and 0.3 mm for both peers
HEADROOM = 2.0e-3  # m, of the box of data files around the walls

COMMON = """units si
atom_style {style}
{map}boundary f f f
newton off
{vel}
processors * * 1
read_data {data}
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes
{law}
timestep {dt}
fix gravity all gravity {gravity} vector 0 0 -1
{walls}
fix move all nve/sphere
compute touch all contact/atom
compute touches all reduce sum c_touch
compute spin all erotate/sphere
thermo_style custom step atoms ke c_spin c_touches
thermo_modify {modify}
thermo {steps}
"""


def installed() -> dict[str, str]:
    """Return the peers' names and commands, as far as they are installed."""
    found = {"lammps": shutil.which("lmp"), "liggghts": shutil.which("liggghts")}
    return {name: path for name, path in found.items() if path}


def constants() -> dict[str, float]:
    """Return the constants of gran/hertz/history [Pa, 1/(m s)] and the restitution for LIGGGHTS."""
    shear = beds.YOUNG / (2.0 * (1.0 + beds.POISSON))
    normal = 4.0 * shear / (3.0 * (1.0 - beds.POISSON))
    tangential = 4.0 * shear / (2.0 - beds.POISSON)
    radius = 0.5 * beds.SPHERE  # of two equal spheres
    mass = 0.5 * beds.DENSITY * 4.0 / 3.0 * math.pi * beds.SPHERE**3
    contact = math.sqrt(radius * OVERLAP * beds.SPHERE)  # contact radius
    # 2 ratio sqrt(m* k) = gamma m* a with k_n = 3/2 Kn a and k_t = Kt a
    ratio = 2.0 * beds.DAMPING_RATIO
    # LIGGGHTS damps with 2 sqrt(5/6) beta sqrt(m* k), beta = -ln e / sqrt(ln^2 e + pi^2)
    beta = beds.DAMPING_RATIO * math.sqrt(6.0 / 5.0)
    return {
        "kn": normal,
        "kt": tangential,
        "gn": ratio * math.sqrt(1.5 * normal / (mass * contact)),
        "gt": ratio * math.sqrt(tangential / (mass * contact)),
        "restitution": math.exp(-math.pi * beta / math.sqrt(1.0 - beta**2)),
    }


def lammps(bed: beds.Bed, data: str, runs: list[int]) -> str:
    """Return the input of LAMMPS: the runs one after the other."""
    c = constants()
    law = f"{c['kn']:.10g} {c['kt']:.10g} {c['gn']:.10g} {c['gt']:.10g} {beds.FRICTION} 1"
    wall = f"all wall/gran hertz/history {law}"
    x1, y1 = bed.box
    walls = [f"fix floor {wall} zplane 0.0 NULL", f"fix sides {wall} xplane 0.0 {x1:.9g}"]
    walls += [f"fix ends {wall} yplane 0.0 {y1:.9g}"]
    return COMMON.format(
        style="sphere", map="", vel="comm_modify vel yes", data=data, skin=SKIN, dt=beds.DT,
        law=f"pair_style gran/hertz/history {law}\npair_coeff * *", gravity=beds.GRAVITY,
        walls="\n".join(walls), modify="norm no", steps=runs[-1],
    ) + "".join(f"run {n}\n" for n in runs)  # fmt: skip


def liggghts(bed: beds.Bed, data: str, runs: list[int]) -> str:
    """Return the input of LIGGGHTS: the runs one after the other."""
    x1, y1 = bed.box
    model = "model hertz tangential history"
    table = {"coefficientRestitution": constants()["restitution"]}
    table["coefficientFriction"] = beds.FRICTION
    law = [
        f"fix m1 all property/global youngsModulus peratomtype{3 * f' {beds.YOUNG}'}",
        f"fix m2 all property/global poissonsRatio peratomtype{3 * f' {beds.POISSON}'}",
    ]
    for name, value in table.items():
        law += [f"fix {name} all property/global {name} peratomtypepair 3{9 * f' {value:.10g}'}"]
    planes = {"z0": 0.0, "x0": 0.0, "x1": x1, "y0": 0.0, "y1": y1}
    walls = [
        f"fix {name} all wall/gran {model} primitive type 1 {name[0]}plane {at:.9g}"
        for name, at in planes.items()
    ]
    return COMMON.format(
        style="granular", map="atom_modify map array\n", vel="communicate single vel yes",
        data=data, skin=SKIN, dt=beds.DT, gravity=beds.GRAVITY,
        law="\n".join([*law, f"pair_style gran {model}", "pair_coeff * *"]),
        walls="\n".join(walls), modify="norm no lost ignore", steps=runs[-1],
    ) + "".join(f"run {n}\n" for n in runs)  # fmt: skip


INPUTS = {"lammps": lammps, "liggghts": liggghts}


def command(path: str, file: str, cores: int) -> list[str]:
    """Return the command line of a run pinned to the first cores."""
    own = [path, "-in", file, "-log", "none"]
    if cores == 1:
        return ["taskset", "-c", "0", *own]
    return ["mpirun", "-np", str(cores), "--bind-to", "core", *own]


def loops(said: str) -> list[float]:
    """Return the seconds of each run's loop."""
    return [float(found) for found in re.findall(r"^Loop time of (\S+)", said, flags=re.M)]


def states(said: str) -> list[tuple[int, float, float]]:
    """Return step, kinetic energy [J] and contacts between grains of every thermo row."""
    rows = re.findall(r"^\s*(\d+)\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s*$", said, flags=re.M)
    return [
        (int(s), float(ke) + float(spin), 0.5 * float(touches)) for s, ke, spin, touches in rows
    ]


def export(folder: Path, bed: beds.Bed) -> str:
    """Write the bed's data file, unless it is newer than the bed; return its name."""
    from talus.cli import main as talus

    data, packing = folder / f"{bed.name}.data", folder / f"{bed.name}.h5"
    if not data.exists() or data.stat().st_mtime < packing.stat().st_mtime:
        edges = (*bed.box, 2.0 * max(bed.box))
        box = [str(edge) for high in edges for edge in (-HEADROOM, high + HEADROOM)]
        words = ["convert", str(packing), "--to", "lammps", "-o", str(data)]
        if talus([*words, "--density", str(beds.DENSITY), "--box", *box]):
            raise SystemExit(f"bench: {packing} could not be converted")
    return data.name
