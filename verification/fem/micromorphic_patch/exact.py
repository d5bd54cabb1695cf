"""Uniform fields of micromorphic elements: patches, flow, column, stretched element, cylinder."""

import numpy as np
from solid import distorted_cube, outer_nodes, polar_nodes, save, shape_of

from talus.compare import max_of
from talus.mesh import Mesh, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

PAIRS = ("hex8/hex8", "hex20/hex8", "hex27/hex8", "tet10/tet4")
STRETCH = np.array([[-0.1, 0.15, 0.025], [0.075, 0.1, -0.1], [0.05, -0.05, -0.15]])
FLOW = 0.2 * (STRETCH - np.eye(3) * np.trace(STRETCH) / 3)
CHI = 0.1 * np.sin(np.arange(9.0) + 1.0)
SLOPE = 0.2 * np.sin(3.7 * np.arange(27.0) + 2.0).reshape(9, 3)
NAMES = [f"{i}{k}" for i in "123" for k in "123"]
# the gold file stretch_y of Tardigrade: stretch, sideways displacement, phi_xx, phi_yy, S_yy,
# cauchy_yy
GOLD = np.array([
    (1.01, -0.00310863048587, -0.00413588611663, 0.00814584708277, 517.563790166, 526.004653179),
    (1.03, -0.00944868561962, -0.012581038074, 0.0244912770233, 1568.14103588, 1646.14613755),
    (1.05, -0.0159551119604, -0.021261991931, 0.0409049428687, 2639.31783542, 2861.87837107),
    (1.07, -0.022631232144, -0.0301845930784, 0.0573830183064, 3731.09418881, 4179.29547322),
    (1.10, -0.0329713008918, -0.0440352518187, 0.0822132142132, 5407.38288233, 6360.64387846),
])  # fmt: skip


def motions(mesh: Mesh, micro: set, u: np.ndarray, phi: np.ndarray | None) -> str:
    """Deck lines that move the surface by u (n, 3) and phi (n, 9)."""
    lines = ["&curve    id = 'on', times = 0.0, 1.0, values = 0.0, 1.0 /"]
    for n in outer_nodes(mesh):
        mesh.nodes[f"n{n}"] = np.array([n])
        values = list(zip("xyz", u[n], strict=True))
        if phi is not None and n in micro:
            values += [(f"chi{c}", v) for c, v in zip(NAMES, phi[n], strict=True)]
        lines += [
            f"&motion group = 'n{n}', component = '{c}', curve = 'on', scale = {float(v)!r} /"
            for c, v in values
        ]
    return "\n".join(lines) + "\n"


def judge_patch(case: Case, element: str, form: str) -> None:
    """Judge a uniform F with a uniform gradient of chi."""
    mesh = distorted_cube(2, shape_of(element))
    micro = polar_nodes(mesh, element)
    u, phi = mesh.x @ STRETCH.T, CHI + mesh.x @ SLOPE.T
    name = f"patch_{element.replace('/', '_')}_{form}"
    text = (case.folder / "patch.nml").read_text().replace("ELEMENT", element)
    text = text.replace("MESH", f"m_{name}").replace("FORM", form)
    text += motions(mesh, set(micro), u, phi)
    (case.folder / f"{name}.nml").write_text(text)
    save(mesh, case.folder / f"m_{name}.h5")
    case.run("talus-fem", f"{name}.nml")
    found = field_steps(case.folder / f"{name}.h5")[-1].solid
    off = max_of(
        abs(found["u"] - u).max() / abs(u).max(),
        abs(found["phi"] - phi)[micro].max() / abs(phi).max(),
    )
    case.below(f"{element}, {form}: u and phi, error / largest", float(off), 1e-9)
    stress = found["stress_points"]
    spread = np.ptp(stress, axis=0).max() / abs(stress).max()
    case.below(f"{element}, {form}: spread of the stress / largest", float(spread), 1e-8)
    couple = abs(found["couple_stress_points"]).max()
    case.above(f"{element}, {form}: couple stress [N/m]", float(couple), 1e5)


def judge_flow(case: Case, element: str, form: str) -> None:
    """Judge a uniform F under plastic flow against the material point."""
    rows = "".join(
        f"&micro_control component = 'F{c}', curve = 'on', scale = {float(v)!r} /\n"
        for c, v in zip(NAMES, FLOW.ravel(), strict=True)
    )
    (case.folder / "flow_point.nml").write_text((case.folder / "point.nml").read_text() + rows)
    case.run("talus-fem", "flow_point.nml", "--point")
    point = read_history(case.folder / "flow_point_point.csv")
    mesh = distorted_cube(2, shape_of(element))
    name = f"flow_{element.replace('/', '_')}_{form}"
    text = (case.folder / "flow.nml").read_text().replace("ELEMENT", element)
    text = text.replace("MESH", f"m_{name}").replace("FORM", form)
    text += motions(mesh, set(), mesh.x @ FLOW.T, None)
    (case.folder / f"{name}.nml").write_text(text)
    save(mesh, case.folder / f"m_{name}.h5")
    case.run("talus-fem", f"{name}.nml")
    found = field_steps(case.folder / f"{name}.h5")[-1].solid
    for field, columns in (("stress", "cauchy"), ("micro_stress", "micro")):
        wanted = np.array([point[f"{columns} {c}"][-1] for c in NAMES])
        off = abs(found[f"{field}_points"] - wanted).max() / abs(wanted).max()
        case.below(f"flow, {element}, {form}: {field}, error / largest", float(off), 1e-8)
    wanted = np.array([point[f"chi {c}"][-1] for c in NAMES]) - np.eye(3).ravel()
    off = abs(found["phi"][polar_nodes(mesh, element)] - wanted).max() / abs(wanted).max()
    case.below(f"flow, {element}, {form}: phi, error / largest", float(off), 1e-8)
    share = (found["macro_yields"] + found["micro_yields"]).min()
    case.above(f"flow, {element}, {form}: least share of an element that yields", float(share), 1.0)
    energy = read_history(case.folder / f"{name}_energy.csv")
    off = abs(energy["closure"]).max() / abs(energy["support"]).max()
    case.below(f"flow, {element}, {form}: ledger, error / work", float(off), 1e-9)
    growth = float(np.diff(energy["plastic"]).min())
    case.above(f"flow, {element}, {form}: least growth of the dissipation [J]", growth, -1e-12)


def faces(mesh: Mesh) -> None:
    """Name the nodes on the six faces of the bounding box."""
    low, high = mesh.x.min(axis=0), mesh.x.max(axis=0)
    for k, c in enumerate("xyz"):
        mesh.nodes[f"{c}0"] = np.flatnonzero(np.isclose(mesh.x[:, k], low[k]))
        mesh.nodes[f"{c}1"] = np.flatnonzero(np.isclose(mesh.x[:, k], high[k]))


def judge_column(case: Case, element: str) -> None:
    """Compare with independent finite elements in one dimension."""
    side, up = np.array([0.0, 0.3]), np.linspace(0.0, 1.0, 4)
    x, hex8 = structured((side, side, up))
    mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), shape_of(element))
    faces(mesh)
    save(mesh, case.folder / "column.h5")
    name = f"column_{element.replace('/', '_')}"
    text = (case.folder / "column.nml").read_text().replace("ELEMENT", element)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    force = read_history(case.folder / f"{name}_reactions.csv")["z1 z"][-1] / 0.09
    case.metric(f"column, {element}: force / reference", float(force) / -2.67539240506, 1.0, 1e-8)
    phi = field_steps(case.folder / f"{name}.h5")[-1].solid["phi"]
    for component, wanted in ((0, 0.968433544304), (8, 1.20798171589)):
        off = float(abs(1.0 + phi[:, component] - wanted).max())
        case.below(f"column, {element}: chi_{NAMES[component]}, error", off, 1e-8)


def judge_stretch(case: Case) -> np.ndarray:
    """Compare with the gold file stretch_y of Tardigrade; return what was found in its columns."""
    side = np.array([0.0, 1.0])
    x, hex8 = structured((side, side, side))
    mesh = Mesh(x, hex8, {"all": np.array([0])})
    faces(mesh)
    save(mesh, case.folder / "element.h5")
    case.run("talus-fem", "stretch.nml")
    steps = field_steps(case.folder / "stretch.h5")[1:]
    rows = []
    for s in steps:
        u, phi, sigma = s.solid["u"], s.solid["phi"], s.solid["stress_points"]
        f = [1 + u[:, k].max() if k == 1 else 1 + u[:, k].min() for k in range(3)]
        stress = sigma[0, 4] * f[0] * f[2] / f[1]
        rows.append((f[1], u[:, 0].min(), phi[0, 0], phi[0, 4], stress, sigma[0, 4]))
    found = np.array(rows)
    chosen = [int(np.argmin(abs(found[:, 0] - g[0]))) for g in GOLD]
    off = abs(found[chosen] - GOLD) / abs(GOLD).max(axis=0)
    for k, name in enumerate(("u_y", "u_x", "phi_xx", "phi_yy", "S_yy", "cauchy_yy")):
        case.below(f"stretch: {name}, error / largest", float(off[:, k].max()), 1e-8)
    return found


def judge_cylinder(case: Case, n: int) -> None:
    """Compare with published values (Tardigrade_MOOSE_convergence.rst), n elements on a radius."""
    side = np.linspace(0.0, 1.0, n + 1)
    x, hex8 = structured((side, side, np.linspace(0.0, 5.0, n + 1)))
    a, b = x[:, 0].copy(), x[:, 1].copy()
    x[:, 0], x[:, 1] = 2.5 * a * np.sqrt(1 - b**2 / 2), 2.5 * b * np.sqrt(1 - a**2 / 2)
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    faces(mesh)
    save(mesh, case.folder / "cylinder_mesh.h5")
    case.run("talus-fem", "cylinder.nml")
    ends = [(2.5 * s * np.sqrt(0.5), 2.5 * np.sqrt(1 - s**2 / 2)) for s in side]
    rim = np.array([(q, p) for q, p in ends] + [(p, q) for q, p in ends[-2::-1]])
    cross = rim[:-1, 0] * rim[1:, 1] - rim[1:, 0] * rim[:-1, 1]
    area = float(abs(cross.sum())) / 2
    force = read_history(case.folder / "cylinder_reactions.csv")["z1 z"][-1]
    wanted = -48.3535288034 / 4 * area / (np.pi * 2.5**2 / 4)
    case.metric(f"cylinder, {n}: force / exact of the polygon", float(force / wanted), 1.0, 1e-6)
    u = field_steps(case.folder / "cylinder.h5")[-1].solid["u"]
    outer = np.isclose(np.hypot(x[:, 0], x[:, 1]), 2.5)
    off = abs(np.hypot(u[outer, 0], u[outer, 1]) - 0.0049700597013).max()
    case.below(f"cylinder, {n}: radial displacement, error [mm]", float(off), 1e-8)


def run(case: Case) -> None:
    """Judge all; plot the stretched element."""
    for element in PAIRS:
        judge_patch(case, element, "energy")
    for element in ("hex8/hex8", "hex20/hex8", "tet10/tet4"):
        judge_flow(case, element, "energy")
    judge_patch(case, "hex20/hex8", "balance")
    judge_flow(case, "hex8/hex8", "balance")
    for element in ("hex8/hex8", "hex20/hex8"):
        judge_column(case, element)
    found = judge_stretch(case)
    for n in (2, 4):
        judge_cylinder(case, n)
    fig, ax = case.figure()
    ax.plot(GOLD[:, 0], GOLD[:, 5], "k-", lw=1, label="reference")
    ax.plot(found[:, 0], found[:, 5], "o", mfc="none", label="Talus")
    ax.set(xlabel="stretch [-]", ylabel="Cauchy stress [units of the moduli]")
    ax.legend()
    case.save(fig)
