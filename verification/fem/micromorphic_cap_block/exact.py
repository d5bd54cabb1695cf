"""Blocks of solids with closed surfaces: ledger, restart, threads, dynamics."""

import shutil

import numpy as np
from solid import save

from talus.compare import same_arrays
from talus.mesh import Mesh, boundary_faces, structured
from talus.verification import Case, field_steps, read_history

# surfaces of the block [Pa] and of the bar [MPa]
ELLIPSES = "".join(
    f"&cone level = '{level}', kind = 'ellipse', critical_slope = 1.2, preconsolidation = {cap}, "
    "tension = 5.0e3, exponent = 30.0 /\n" for level, cap in (("macro", 2.0e5), ("micro", 2.2e5))
) + ("&cone level = 'gradient', friction_deg = 10.0, dilation_deg = 5.0, cohesion = 1.0e2, "
     "hardening = 1.0e5, rounding = 0.2, pressure = 'macro', length = 0.01 /\n")  # fmt: skip
CRUSHED = (
    "&cone level = 'macro', kind = 'breakage', critical_slope = 1.2, breakage_energy = 2.5e2, "
    "breakage_angle_deg = 60.0, tension = 1.0e3, "
    "grain_size_max = 2.0e-3, grain_size_min = 2.0e-5 /\n"
)
SOFT = (
    "&cone level = 'micro', kind = 'ellipse', critical_slope = 1.2, preconsolidation = 0.2, "
    "tension = 0.1, exponent = 10.0 /\n"
)


def write_block(case: Case) -> None:
    """Write an eighth of a block with its faces and the nodes on them."""
    side = np.linspace(0.0, 0.5, 3)
    x, cells = structured((side, side, 2.0 * side))
    mesh = Mesh(x, cells, {"all": np.arange(len(cells))})
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    for k, c in enumerate("xyz"):
        for name, at in ((f"{c}0", 0.0), (f"{c}1", x[:, k].max())):
            mesh.facets[name] = np.array([q for q in faces if np.isclose(x[q][:, k], at).all()])
            mesh.nodes[f"n{name}"] = np.flatnonzero(np.isclose(x[:, k], at))
    mesh.facets["sides"] = np.vstack([mesh.facets[k] for k in ("x1", "y1")])
    save(mesh, case.folder / "block_mesh.h5")


def judge_block(case: Case, name: str, surfaces: str, fields: tuple[str, ...]) -> None:
    """Judge ledger, surfaces, restart and threads of a block between rough plates."""
    text = (case.folder / "block.nml").read_text().replace("SURFACES", surfaces)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    whole = field_steps(case.folder / f"{name}.h5")
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{name}_*.csv")}
    for field in fields:
        case.above(f"{name}: largest {field}", float(whole[-1].solid[field].max()), 0.1)
    energy = read_history(case.folder / f"{name}_energy.csv")
    scale = float(abs(energy["support"]).max())
    case.below(f"{name}: ledger, error / work", float(abs(energy["closure"]).max()) / scale, 1e-8)
    growth = float(np.diff(energy["plastic"]).min()) / scale
    case.above(f"{name}: least growth of the dissipation / work", growth, -1e-9)
    shutil.copy(case.folder / f"{name}.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{name}.nml", "--restart=half.chk.h5", "--threads=2")
    again = field_steps(case.folder / f"{name}.h5")
    same = len(kept) > 2 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    case.metric(f"{name}: restart on two threads repeats every bit", float(same), 1.0, 0)


def judge_thrown(case: Case) -> None:
    """Judge the ledgers of a bar of a micro-ellipse that is thrown."""
    text = (case.folder / "thrown.nml").read_text().replace("SURFACES", SOFT)
    kinds = {"newmark": "kind = 'newmark', dt = 2.0e-2", "explicit": "kind = 'explicit'"}
    for name, kind in kinds.items():
        (case.folder / f"{name}.nml").write_text(text.replace("ANALYSIS", kind))
        case.run("talus-fem", f"{name}.nml")
        energy = read_history(case.folder / f"{name}_energy.csv")
        start = float(energy["kinetic"][0])
        off = float(abs(energy["closure"]).max() / start)
        case.below(f"bar, {name}: ledger, error / energy at the start", off, 1e-8)
        lost = float(energy["plastic"][-1] / start)
        case.above(f"bar, {name}: dissipation / energy at the start", lost, 0.05)


def run(case: Case) -> None:
    """Judge blocks at rest and a bar that is thrown; plot the work of the blocks."""
    write_block(case)
    names = ("macro_yields", "micro_yields", "gradient_1_yields")
    judge_block(case, "ellipses", ELLIPSES, names)
    judge_block(case, "broken", CRUSHED, ("macro_yields", "breakage"))
    judge_thrown(case)
    fig, ax = case.figure()
    for name in ("ellipses", "broken"):
        found = read_history(case.folder / f"{name}_reactions.csv")
        load = -4e-3 * found["nz1 z"]
        ax.plot(found["time"], load, "o-", mfc="none", label=f"Talus, {name}")
    ax.set(xlabel="axial compression [%]", ylabel="axial stress [kPa]")
    ax.legend()
    case.save(fig)
