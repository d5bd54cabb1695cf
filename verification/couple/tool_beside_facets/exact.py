"""A penetrometer goes into a saturated bed of spheres beside elements."""

from pathlib import Path

import numpy as np
from coupled import write_box, write_deck

from talus.packing import make_packing, write_h5
from talus.verification import Case, read_history

D, HEIGHT, GAMMA = 1.0e-3, 0.0315, 0.0155
RADIUS, TIP = 2.5e-3, 7.5e-3  # of the penetrometer, and place of its tip at the start [m]
AREA = np.pi * RADIUS**2
SPEED, EXCHANGE = 2.0e-3, 2.0**-17  # of the penetrometer [m/s]; times that are exact in binary [s]
SPAN, T_END = EXCHANGE / 4, 104 * EXCHANGE  # of an exchange of grains and liquid [s]
LIQUID = """&fluid    id = 'water', density = 1000.0, viscosity = 1.0e-3, bulk_modulus = 2.2e8 /
&pore     material = 'soil', fluid = 'water', porosity = 0.47640122, permeability = 1.0e-10 /
&pore_pressure group = 'z1', value = 0.0 /"""
HELD = "&support group = 'all', fix = 'x', 'y', 'z' /"
LAID = "\n".join(
    f"&support group = '{side}', fix = '{side[0]}' /" for side in ("x0", "x1", "y0", "y1", "z1")
)
FILES = ("coupled_{}_pore.csv", "coupled_{}_audit.csv", "grains_{}_pore.csv", "grains_{}_tools.csv",
         "grains_{}_penetrometers.csv", "solid_{}_energy.csv")  # fmt: skip


def prepare(case: Case, name: str, end: float, threads: int = 1, sealed: bool = False) -> None:
    """Write the decks of a run."""
    write_deck(case, f"grains_{name}.nml", "grains.nml")
    write_deck(case, f"solid_{name}.nml", "solid.nml", liquid="" if sealed else LIQUID,
               support=HELD if sealed else LAID)  # fmt: skip
    write_deck(case, f"coupled_{name}.nml", "coupled.nml", name=name, t_end=repr(end),
               threads=threads, permeable=", permeable = .false." if sealed else "")  # fmt: skip


def judge_sealed(case: Case) -> None:
    """Judge pressure, force and what is swept below elements that let nothing through."""
    prepare(case, "sealed", T_END, sealed=True)
    case.run("talus-couple", "coupled_sealed.nml")
    rows = read_history(case.folder / "grains_sealed_pore.csv")
    tools = read_history(case.folder / "grains_sealed_tools.csv")
    over = AREA * SPEED * SPAN * rows["exchanges"][-1]
    off = float(abs(rows["swept"][-1] / over - 1.0))
    case.below("sealed: volume that is swept, error", off, 1e-6)
    case.below("sealed: liquid from nowhere / pores", float(rows["balance"].max()), 1e-12)
    pressure = 0.5 * (rows["least_pressure"][-1] + rows["most_pressure"][-1])
    case.below("sealed: force on the penetrometer / (p A), error",
               float(abs(tools["force_x"][-1] / (-pressure * AREA) - 1.0)), 0.01)  # fmt: skip
    tip = read_history(case.folder / "grains_sealed_penetrometers.csv")
    case.below("sealed: force on the cone / (p A), error",
               float(abs(tip["tip_liquid_x"][-1] / (-pressure * AREA) - 1.0)), 0.01)  # fmt: skip
    facets = read_history(case.folder / "coupled_sealed_pore.csv")
    case.metric("sealed: force on the facets / (p area)",
                float(facets["force_z"][-1] / (pressure * 0.012**2)), 1.0, 0.01)  # fmt: skip


def judge_open(case: Case) -> None:
    """Judge the books and the bits where liquid goes over."""
    prepare(case, "whole", T_END)
    case.run("talus-couple", "coupled_whole.nml")
    rows = read_history(case.folder / "coupled_whole_pore.csv")
    case.below("open: liquid from nowhere / that went over", float(rows["balance"][-1]), 1e-12)
    case.above("open: liquid that went into the solid / swept",
               float(-rows["solid_entered"][-1] / (AREA * SPEED * T_END)), 0.1)  # fmt: skip
    prepare(case, "parts", T_END / 2, threads=2)
    case.run("talus-couple", "coupled_parts.nml")
    prepare(case, "parts", T_END)
    case.run("talus-couple", "coupled_parts.nml", "--restart=auto")
    for name in FILES:
        one, other = (case.folder / name.format(run) for run in ("whole", "parts"))
        differs = float(one.read_bytes() != other.read_bytes())
        case.metric(f"{name.format('*')} after a restart differs", differs, 0.0, 0.0, "bytes")


def run(case: Case) -> None:
    """Judge both."""
    places = np.meshgrid(*(np.arange(k) for k in (12, 12, 16)), indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    away = np.hypot(x[:, 1] - 0.006, x[:, 2] - 0.0065)
    inside = (away < RADIUS + 0.55 * D) & (x[:, 0] < TIP + 0.55 * D)
    x = x[~inside]
    ghosts = np.flatnonzero(x[:, 2] > GAMMA - 0.1 * D) + 1
    pack = make_packing(x, np.full((len(x), 3), 0.5 * D), groups={"ghosts": ghosts})
    write_h5(Path(case.folder / "bed.h5"), pack)
    write_box(case.folder / "mesh.h5", [0.0, 0.0, GAMMA], [0.012, 0.012, HEIGHT], (3, 3, 4))
    judge_sealed(case)
    judge_open(case)
