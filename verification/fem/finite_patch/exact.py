"""Homogeneous finite strains: a point, patches of all elements, a cube under pressure."""

import numpy as np
from solid import distorted_cube, outer_nodes, prescribe, save, shape_of

from talus.mesh import Mesh, boundary_faces
from talus.verification import Case, field_steps, read_history

ELEMENTS = ("hex8_bbar", "hex8_full", "hex20", "hex27", "tet4", "tet10", "wedge6")
YOUNG, POISSON = 165.0, 0.39
LAMBDA = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
MU = YOUNG / (2 * (1 + POISSON))
LAWS = {
    "kirchhoff": f"law = 'st_venant_kirchhoff', young = {YOUNG}, poisson = {POISSON}",
    "neo-hookean": f"law = 'neo_hookean', young = {YOUNG}, poisson = {POISSON}",
}
# finite_strain_solution.txt of Tardigrade-examples: lateral stretch, S33, Cauchy stress, at 0.99
LATERAL, SECOND, CAUCHY = 1.00387299994, -1.64175, -1.61281543938
PRESSURE = 40.0
SIX = ([0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0])


def cauchy(law: str, f: np.ndarray) -> np.ndarray:
    """Return Cauchy's stress of a deformation gradient [Pa]."""
    c, j, one = f.T @ f, np.linalg.det(f), np.eye(3)
    if law == "kirchhoff":
        e = 0.5 * (c - one)
        s = LAMBDA * np.trace(e) * one + 2 * MU * e
    else:
        inverse = np.linalg.inv(c)
        s = MU * (one - inverse) + LAMBDA * np.log(j) * inverse
    return f @ s @ f.T / j


def turn(angle: float) -> np.ndarray:
    """Return the rotation by an angle about (2, -1, 2)/3."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    spin = np.cross(np.eye(3), -axis)
    return np.eye(3) + np.sin(angle) * spin + (1 - np.cos(angle)) * spin @ spin


def solve(case: Case, name: str, mesh: Mesh, element: str, law: str, lines: str,
          dt: float) -> dict[str, np.ndarray]:  # fmt: skip
    """Run a patch; return the fields of its last step."""
    save(mesh, case.folder / f"{name}_mesh.h5")
    text = (case.folder / "deck.nml").read_text().replace("MESH", f"{name}_mesh")
    text = text.replace("ELEMENT", element).replace("LAW", LAWS[law]).replace("DT", repr(dt))
    (case.folder / f"{name}.nml").write_text(text + lines)
    case.run("talus-fem", f"{name}.nml")
    return field_steps(case.folder / f"{name}.h5")[-1].solid


def judge_turn(case: Case, element: str, law: str) -> float:
    """Stretch, shear and turn the boundary of a distorted cube; judge all points."""
    mesh = distorted_cube(3 if element.startswith("hex8") else 2, shape_of(element))
    stretch = np.array([[1.2, 0.15, 0.0], [0.0, 0.9, -0.1], [0.05, 0.0, 1.1]])
    f = turn(2 * np.pi / 3) @ stretch
    u = mesh.x @ (f - np.eye(3)).T
    lines = prescribe(mesh, outer_nodes(mesh), u, None, np.array([], int))
    # boundary on the way along rotations, not along straight lines, which would crush the cube
    found = solve(case, f"{law}_{element}", mesh, element, law, bent(mesh, lines, stretch), 0.125)
    exact = cauchy(law, f)[SIX]
    off = abs(found["stress_points"] - exact).max() / abs(exact).max()
    case.below(f"{element}, {law}: stress at all points, error / largest", float(off), 1e-9)
    off = abs(found["u"] - u).max() / abs(u).max()
    case.below(f"{element}, {law}: displacement inside, error / largest", float(off), 1e-9)
    return float(off)


def bent(mesh: Mesh, lines: str, stretch: np.ndarray) -> str:
    """Return the deck lines with a curve a node and component along the rotation."""
    times = np.linspace(0.0, 1.0, 9)
    path = [
        turn(2 * np.pi / 3 * t) @ (np.eye(3) + t * (stretch - np.eye(3))) - np.eye(3) for t in times
    ]
    text = ""
    for line in lines.splitlines()[1:]:
        name = line.split("'")[1]
        axis = "xyz".index(line.split("'")[3])
        x = mesh.x[int(name[1:])]
        values = ", ".join(repr(float(g[axis] @ x)) for g in path)
        text += f"&curve id = '{name}{axis}', times = {', '.join(map(repr, times.tolist()))}, "
        text += f"values = {values} /\n"
        text += f"&motion group = '{name}', component = '{'xyz'[axis]}', curve = '{name}{axis}' /\n"
    return text


def supports(mesh: Mesh) -> str:
    """Add the six faces to the mesh; return supports of three of them."""
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    for k, c in enumerate("xyz"):
        for side in (0, 1):
            on = [q for q in faces if np.isclose(mesh.x[q][:, k], side).all()]
            mesh.facets[f"{c}{side}"] = np.array(on)
    return "".join(f"&support group = '{c}0', fix = '{c}' /\n" for c in "xyz")


def judge_uniaxial(case: Case, element: str) -> None:
    """Press a distorted cube by its top; judge stress and lateral stretch."""
    mesh = distorted_cube(2, shape_of(element))
    lines = supports(mesh) + "&curve id = 'on', times = 0.0, 1.0, values = 0.0, -0.01 /\n"
    lines += "&motion group = 'z1', component = 'z', curve = 'on' /\n"
    found = solve(case, f"uniaxial_{element}", mesh, element, "kirchhoff", lines, 1.0)
    off = abs(found["stress_points"][:, 2] / CAUCHY - 1).max()
    case.below(f"{element}: uniaxial Cauchy stress, error", float(off), 1e-8)
    side = np.isclose(mesh.x[:, 0], 1.0)
    off = abs(1 + found["u"][side, 0] - LATERAL).max()
    case.below(f"{element}: lateral stretch, error", float(off), 1e-8)


def judge_pressure(case: Case, element: str) -> np.ndarray:
    """Press a neo-Hookean cube from all sides; return the residuals of the last step."""
    mesh = distorted_cube(2, shape_of(element))
    lines = supports(mesh) + "&curve id = 'on', times = 0.0, 1.0, values = 0.0, 1.0 /\n"
    for side in ("x1", "y1", "z1"):
        lines += (
            f"&pressure group = '{side}', value = {PRESSURE}, curve = 'on', follower = .true. /\n"
        )
    name = f"pressure_{element}"
    found = solve(case, name, mesh, element, "neo-hookean", lines, 1.0)
    low, high = 0.5, 1.0
    for _ in range(60):
        size = 0.5 * (low + high)
        stress = (MU * (size**2 - 1) + 3 * LAMBDA * np.log(size)) / size**3
        low, high = (size, high) if stress < -PRESSURE else (low, size)
    off = abs(found["u"] - (size - 1) * mesh.x).max()
    case.below(f"{element}: size under pressure, error", float(off), 1e-9)
    off = abs(found["stress_points"][:, :3] / -PRESSURE - 1).max()
    case.below(f"{element}: stress under pressure, error", float(off), 1e-9)
    table = read_history(case.folder / f"{name}_newton.csv")
    r = table["residual"][np.isclose(table["time"], 1.0)]
    return r[r > 1e-11]  # round-off follows


def run(case: Case) -> None:
    """Judge the point and all patches; plot the errors."""
    case.run("talus-fem", "point.nml", "--point")
    point = read_history(case.folder / "point_point.csv")
    case.metric("point: S33", float(point["stress zz"][-1]), SECOND, 1e-8)
    lateral = float(np.sqrt(1 + 2 * point["strain xx"][-1]))
    case.metric("point: lateral stretch", lateral, LATERAL, 1e-8)
    case.metric("point: Cauchy stress", SECOND * 0.99 / lateral**2, CAUCHY, 1e-8)
    stored = 0.5 * float(point["stress zz"][-1] * point["strain zz"][-1])
    case.metric("point: stored energy", float(point["stored_energy"][-1]), stored, 1e-12)
    errors = {}
    for element in ELEMENTS:
        errors[element] = [judge_turn(case, element, law) for law in LAWS]
        judge_uniaxial(case, element)
    fig, ax = case.figure()
    for element, mark in (("hex8_bbar", "o"), ("hex20", "s"), ("tet10", "^")):
        r = judge_pressure(case, element)
        ax.semilogy(np.arange(1, len(r) + 1), r, mark + "-", mfc="none", label=element)
        order = np.log(r[-1] / r[-2]) / np.log(r[-2] / r[-3])
        case.above(f"{element}: order of the last iterations under pressure", float(order), 1.7)
    ax.set(xlabel="iteration", ylabel="residual / loads [-]")
    ax.legend()
    case.save(fig)
