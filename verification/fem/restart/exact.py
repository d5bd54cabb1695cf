"""Whole runs against runs that go on from a checkpoint half-way."""

import shutil

import numpy as np
from solid import MATERIAL, distorted_cube, save, shape_of

from talus.compare import max_of, same_arrays
from talus.mesh import boundary_faces
from talus.verification import Case, field_steps, read_history

CLASSICAL = "density = 2000.0, young = 2.0e7, poisson = 0.3"
POLAR = MATERIAL.format(1.0e7, 0.7e7, 0.5e7, 1.0e4, 0.5e4, 2.0e4).replace(
    "density = 1.0,", "density = 2000.0, micro_inertia = 1.0e-3,"
)
PLASTIC = (
    "law = 'drucker_prager', density = 2000.0, young = 2.0e7, poisson = 0.3, cohesion = 1.2e4, "
    "friction_deg = 25.0, dilation_deg = 5.0, hardening = 1.0e5"
)
STRESS = "&initial_stress group = 'all', value = -1.0e4, -1.0e4, -1.0e4, 0.0, 0.0, 0.0 /\n"
RAYLEIGH = ", rayleigh_mass = 5.0, rayleigh_stiffness = 1.0e-5"
STEP = "dt = 1.0e-3"
RUNS = {  # element, analysis
    "static, factors": ("hex8_bbar", f"kind = 'static', solver = 'direct', {STEP}"),
    "static, iterations": ("hex8_bbar", f"kind = 'static', solver = 'iterative', {STEP}"),
    "static, multigrid": ("hex8_bbar", f"kind = 'static', solver = 'multigrid', {STEP}"),
    "multigrid, plastic": ("hex8_bbar", f"kind = 'static', solver = 'multigrid', {STEP}"),
    "static, plastic": ("hex8_bbar", f"kind = 'static', {STEP}"),
    "relaxation": ("hex8_bbar", f"kind = 'relaxation', tolerance = 1.0e-11, {STEP}"),
    "newmark": ("hex8_incompatible", f"kind = 'newmark', {STEP}"),
    "newmark, micropolar": ("hex20/hex8", f"kind = 'newmark', {STEP}"),
    "hht, damped": ("hex8_bbar", f"kind = 'hht', alpha = -0.1, {STEP}{RAYLEIGH}"),
    "explicit, full": ("hex8_full", "kind = 'explicit'"),
    "explicit, one point": ("hex8_one_point", "kind = 'explicit'"),
    "explicit, damped": ("hex8_bbar", f"kind = 'explicit'{RAYLEIGH}"),
    "explicit, micropolar": ("hex20/hex8", "kind = 'explicit'"),
    "hht, plastic": ("hex8_bbar", f"kind = 'hht', alpha = -0.1, tolerance = 1.0e-11, {STEP}"),
    "explicit, plastic": ("hex8_bbar", "kind = 'explicit'"),
}


def write_meshes(case: Case) -> None:
    """A distorted cube of each kind with its groups."""
    for kind in ("hex8", "hex20"):
        mesh = distorted_cube(3 if kind == "hex8" else 2, kind)
        x = mesh.x
        mesh.nodes["base"] = np.flatnonzero(x[:, 2] < 1e-9)
        mesh.nodes["edge"] = np.flatnonzero((x[:, 2] > 1 - 1e-9) & (x[:, 0] > 1 - 1e-9))
        faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
        mesh.facets["side"] = np.array([q for q in faces if (x[q][:, 1] > 1 - 1e-9).all()])
        save(mesh, case.folder / f"{kind}.h5")


def stem_of(name: str) -> str:
    """Return the name of the files of a run."""
    return name.replace(", ", "_").replace(" ", "_")


def ledger_error(case: Case, name: str) -> float:
    """Return the largest closure of the ledger over its largest entry."""
    energy = read_history(case.folder / f"{stem_of(name)}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    return float(abs(energy["closure"]).max() / largest)


def repeats(case: Case, name: str, element: str, analysis: str) -> tuple[bool, np.ndarray]:
    """Run whole, then from the checkpoint half-way; return whether all is the same, and u."""
    stem = stem_of(name)
    text = (case.folder / "deck.nml").read_text().replace("ANALYSIS", analysis)
    text = text.replace("ELEMENT", element).replace("MESH", f"{shape_of(element)}.h5")
    material = POLAR if "/" in element else CLASSICAL
    if "plastic" in name:
        material, text = PLASTIC, text + STRESS
    text = text.replace("MATERIAL", material)
    if "damped" in name:
        text += "&absorbing group = 'side' /\n"
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    whole = field_steps(case.folder / f"{stem}.h5")
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{stem}_*.csv")}
    first = case.folder / f"{stem}.chk.1.h5"
    shutil.copy(first, case.folder / "half.chk.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / f"{stem}.h5")
    same = len(kept) > 0 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    u = np.array([np.abs(s.solid["u"]).max() for s in whole])
    return same, np.column_stack([[s.time for s in whole], u])


def run(case: Case) -> None:
    """Judge every analysis; plot what moved."""
    write_meshes(case)
    fig, ax = case.figure()
    for name, (element, analysis) in RUNS.items():
        same, moved = repeats(case, name, element, analysis)
        case.metric(f"{name}: restart repeats every bit", float(same), 1.0, 0)
        case.below(f"{name}: ledger, error / largest", ledger_error(case, name), 1e-9)
        case.above(f"{name}: largest displacement [m]", float(moved[:, 1].max()), 1e-5)
        ax.plot(moved[:, 0] * 1e3, moved[:, 1] * 1e3, "o-", ms=3, label=name)
    ax.set(xlabel="time [ms]", ylabel="largest displacement [mm]")
    ax.legend(fontsize="x-small")
    case.save(fig)
