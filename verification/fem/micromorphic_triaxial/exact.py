"""Micromorphic specimens: the material point, the strength, quadratic iterations, restart."""

import shutil

import numpy as np
from solid import distorted_cube, save, shape_of

from talus.compare import max_of, same_arrays
from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, HARDENING = 1.0e8, 0.25, 5.0e5
COHESION, CONFINED, FRICTION = 2.0e4, 1.0e5, np.deg2rad(35.0)
PASSIVE = (1 + np.sin(FRICTION)) / (1 - np.sin(FRICTION))
STRENGTH = CONFINED * PASSIVE + 2 * COHESION * np.sqrt(PASSIVE)


def with_moduli(text: str, stiff: float) -> str:
    """Fill in seven moduli that leave E and nu where chi is free and homogeneous."""
    shear, bulk = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
    m = {"ETA": 8e7, "TAU": 1e7, "KAPPA": 6e7, "NU": 4e7, "SIGMA": 2e7}
    s = m["KAPPA"] + m["NU"] - 2 * m["SIGMA"]
    b = m["KAPPA"] + m["NU"] + 3 * m["ETA"] - 3 * m["TAU"] - 2 * m["SIGMA"]
    m["MU"] = shear + 2 * m["SIGMA"] ** 2 / s
    m["LAMBDA"] = bulk + (3 * m["TAU"] + 2 * m["SIGMA"]) ** 2 / (3 * b) - 2 * m["MU"] / 3
    m["HARDENING"] = HARDENING
    for name, value in m.items():
        text = text.replace(f"= {name}", f"= {stiff * value!r}")
    return text


def write_block(case: Case, mesh: Mesh, name: str) -> Mesh:
    """Write a block with its faces, nodes on them, and its four sides as one group."""
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    low, high = mesh.x.min(axis=0), mesh.x.max(axis=0)
    for k, c in enumerate("xyz"):
        for side, at in ((0, low[k]), (1, high[k])):
            on = [q for q in faces if np.isclose(mesh.x[q][:, k], at).all()]
            mesh.facets[f"{c}{side}"] = np.array(on)
            mesh.nodes[f"n{c}{side}"] = np.flatnonzero(np.isclose(mesh.x[:, k], at))
    mesh.facets["sides"] = np.vstack([mesh.facets[k] for k in ("x1", "y1")])
    save(mesh, case.folder / f"{name}.h5")
    return mesh


def judge_smooth(case: Case, element: str) -> dict[str, np.ndarray]:
    """Judge a cube against the material point."""
    write_block(case, distorted_cube(2, shape_of(element)), "smooth_mesh")
    for name in ("smooth", "point"):
        text = with_moduli((case.folder / f"{name}.nml").read_text(), 1.0)
        text = text.replace("ELEMENT", element)
        (case.folder / f"run_{name}.nml").write_text(text)
    case.run("talus-fem", "run_point.nml", "--point")
    point = read_history(case.folder / "run_point_point.csv")
    case.run("talus-fem", "run_smooth.nml")
    steps = field_steps(case.folder / "run_smooth.h5")
    names = [f"{i}{k}" for i in "123" for k in "123"]
    worst = {"stress": 0.0, "phi": 0.0, "Z": 0.0}
    for row, step in enumerate(steps):
        wanted = np.array([point[f"cauchy {c}"][row] for c in names])
        off = abs(step.solid["stress_points"] - wanted).max() / 5e5
        worst["stress"] = max_of(worst["stress"], off)
        worst["Z"] = max_of(worst["Z"], abs(step.solid["z_macro"] - point["Z 1"][row]).max())
        wanted = np.array([point[f"chi {c}"][row] for c in names]) - np.eye(3).ravel()
        worst["phi"] = max_of(worst["phi"], abs(step.solid["phi"] - wanted).max())
    for name, scale in (("stress", 1.0), ("phi", 1e-2), ("Z", point["Z 1"][-1])):
        error = float(worst[name] / scale)
        case.below(f"{element}: {name} of all points, error / largest", error, 1e-8)
    energy = read_history(case.folder / "run_smooth_energy.csv")
    off = float(abs(energy["closure"]).max() / energy["load"].max())
    case.below(f"{element}: ledger, error / work", off, 1e-9)
    growth = float(np.diff(energy["plastic"]).min())
    case.above(f"{element}: least growth of the dissipation [J]", growth, -1e-9)
    top = [float(s.solid["u"][:, 2].min()) for s in steps]
    return {"time": np.array([s.time for s in steps]), "axial": -np.array(top), "point": point}


def strength(case: Case, stiff: float) -> float:
    """Return the largest axial stress of a perfectly plastic cube that starts under stress."""
    write_block(case, distorted_cube(2, "hex20"), "smooth_mesh")
    text = with_moduli((case.folder / "strength.nml").read_text(), stiff)
    text = text.replace("MOTION", repr(-0.01 / stiff))
    (case.folder / "run_strength.nml").write_text(text)
    case.run("talus-fem", "run_strength.nml")
    return float(-read_history(case.folder / "run_strength_reactions.csv")["nz1 z"].min())


def exponents(case: Case) -> list[tuple[float, np.ndarray]]:
    """Return time and residuals of every part of a step between rough plates."""
    table = read_history(case.folder / "rough_newton.csv")
    starts = np.flatnonzero(table["iteration"] == 1)
    ends = np.r_[starts[1:], len(table["iteration"])]
    return [(table["time"][a], table["residual"][a:b]) for a, b in zip(starts, ends, strict=True)]


def judge_rough(case: Case) -> list[tuple[float, np.ndarray]]:
    """Judge iterations, ledger and restart of a block between rough plates."""
    side, up = np.linspace(0.0, 0.5, 3), np.linspace(0.0, 1.0, 3)
    x, hex8 = structured((side, side, up))
    mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), "hex20")
    write_block(case, mesh, "rough_mesh")
    case.run("talus-fem", "rough.nml")
    parts = exponents(case)
    found = []
    for _, r in parts[3:]:
        last = r[r > 1e-13]
        if len(last) > 2:
            found.append(np.log(last[-1] / last[-2]) / np.log(last[-2] / last[-3]))
    case.above("rough: median exponent of the last iterations", float(np.median(found)), 1.7)
    case.below("rough: most iterations", float(max(len(r) for _, r in parts)), 12.0)
    whole = field_steps(case.folder / "rough.h5")
    last = whole[-1].solid
    for name in ("macro_yields", "micro_yields", "gradient_1_yields"):
        case.above(f"rough: largest share of an element, {name}", float(last[name].max()), 0.1)
    energy = read_history(case.folder / "rough_energy.csv")
    scale = float(abs(energy["support"]).max())
    case.below("rough: ledger, error / work", float(abs(energy["closure"]).max()) / scale, 1e-8)
    growth = float(np.diff(energy["plastic"]).min())
    case.above("rough: least growth of the dissipation [J]", growth, -1e-9)
    kept = {p: p.read_bytes() for p in case.folder.glob("rough_*.csv")}
    shutil.copy(case.folder / "rough.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", "rough.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / "rough.h5")
    same = len(kept) > 2 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    case.metric("rough: restart in plastic flow repeats every bit", float(same), 1.0, 0)
    return parts


def run(case: Case) -> None:
    """Judge all; plot the compression and the residuals."""
    for element in ("hex8/hex8", "tet10/tet4", "hex20/hex8"):
        smooth = judge_smooth(case, element)
    off = [strength(case, stiff) / STRENGTH - 1 for stiff in (10.0, 100.0)]
    case.below("strength, elastic strains of 3e-4: |error|", abs(off[0]), 2e-3)
    order = float(np.log10(abs(off[0] / off[1])))
    case.metric("strength: order of the error in the elastic strain", order, 1.0, 0.1)
    parts = judge_rough(case)
    fig, ax = case.figure()
    point = smooth["point"]
    q = (point["P 11"] - point["P 33"]) / 1e3
    ax.plot(-100 * (point["F 33"] - 1), q, "k-", lw=1, label="material point")
    load = np.interp(smooth["time"], (0, 0.1, 1), (0, 0, 400))
    ax.plot(100 * smooth["axial"], load, "o", mfc="none", label="Talus, 8 hex20/hex8")
    ax.set(xlabel="axial compression [%]", ylabel="deviatoric force q [kPa]")
    ax.legend()
    case.save(fig)
    fig, ax = case.figure()
    for time, r in parts[4:]:
        ax.semilogy(np.arange(1, len(r) + 1), r, "o-", ms=3, label=f"{time:g} s")
    ax.set(xlabel="iteration", ylabel="residual / loads and reactions [-]")
    ax.legend(fontsize="x-small")
    case.save(fig, "residuals.png")
