"""Layered solid: moduli at a point, beams of free layers, and a beam with all its layers meshed."""

import numpy as np
from solid import save

from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

E, NU, THICK, NORMAL, SHEAR = 0.7, 0.2, 0.1, 0.25, 0.2
STRETCH = np.array([1.0, 2.0, 3.0])
STRESS = np.array([1.114187, 1.662197, 0.09083])
MODULI = {  # reference: (state, component) of sigma or m
    "a0000": 0.730681, "a0011": 0.18267, "a2222": 0.024221, "a0022": 0.006055,
    "a0101": 0.291667, "a66": 0.018717, "a77": 0.310383, "b0101": 0.000534, "b0110": 0.000107,
}  # fmt: skip
KL = [f"{k}{j}" for k in (1, 2, 3) for j in (1, 2, 3)]
LAYER, COUNT, LENGTH, WIDTH = 0.05, 10, 5.0, 0.25
HEIGHT = LAYER * COUNT
YOUNG, POISSON = 1.0e9, 0.25
PLATE = YOUNG * LAYER**2 / (12 * (1 - POISSON**2))  # bending modulus of free layers [N]
G = YOUNG / (2 * (1 + POISSON))
LOAD = 1000.0  # Pa at the end


def state(material: str, h: np.ndarray, phi: np.ndarray, c: np.ndarray) -> str:
    """One &path row of a displacement gradient, rotation and its gradient."""

    def text(values: np.ndarray) -> str:
        return ", ".join(repr(float(v)) for v in np.ravel(values))

    return (
        f"&path material = '{material}', gradient = {text(h)}, rotation = {text(phi)}, "
        f"rotation_gradient = {text(c)} /\n"
    )


def frame(axis: np.ndarray) -> np.ndarray:
    """Some rotation that takes z to an axis."""
    z = axis / np.linalg.norm(axis)
    x = np.cross([0.3, 0.9, 0.1], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def judge_point(case: Case) -> None:
    """Reference moduli and stresses; series of layers and joints; layers turned."""
    zero, none = np.zeros((3, 3)), np.zeros(3)
    unit = lambda i, j: np.outer(np.eye(3)[i], np.eye(3)[j])  # noqa: E731
    shears = (unit(0, 1) + unit(1, 0)) / 2, unit(0, 2), unit(2, 0)
    rows = [state("published", np.diag(STRETCH), none, zero)]
    rows += [state("published", h, none, zero) for h in (unit(0, 0), unit(2, 2), *shears)]
    rows += [
        state("published", zero, none, unit(0, 1)),
        state("series", np.diag(STRETCH), none, zero),
    ]
    rng = np.random.default_rng(3)
    turn = frame(np.array([1.0, 2.0, -2.0]))
    h, phi, c = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=(3, 3))
    rows += [
        state("series", h, phi, c),
        state("slanted", turn @ h @ turn.T, turn @ phi, turn @ c @ turn.T),
    ]
    (case.folder / "point.nml").write_text((case.folder / "point.nml").read_text() + "".join(rows))
    case.run("talus-fem", "point.nml", "--point")
    found = read_history(case.folder / "point_point.csv")
    sigma = np.stack([found[f"sigma {kl}"] for kl in KL], axis=1).reshape(-1, 3, 3)
    couple = np.stack([found[f"m {kl}"] for kl in KL], axis=1).reshape(-1, 3, 3)
    error = np.abs(np.diag(sigma[0]) - STRESS).max()
    case.below("O08: stress under 1, 2, 3, error", float(error), 1e-6, "its last digit")
    values = {
        "a0000": sigma[1, 0, 0], "a0011": sigma[1, 1, 1], "a2222": sigma[2, 2, 2],
        "a0022": sigma[2, 0, 0], "a0101": sigma[3, 0, 1], "a66": sigma[4, 2, 0],
        "a77": sigma[5, 0, 2], "b0101": couple[6, 1, 0], "b0110": -couple[6, 0, 1],
    }  # fmt: skip
    for name, value in values.items():
        error = abs(float(value) - MODULI[name])
        case.below(f"O08: {name}, error", error, 1e-6, "the last digit of the reference")
    case.metric(
        "a66 across the layers both ways", float(sigma[5, 2, 0] / sigma[4, 2, 0]), 1.0, 1e-12
    )
    error = np.abs(series() - np.diag(sigma[7])).max()
    case.below("series of layers and joints, error", float(error), 1e-14)
    for name, tensor in (("sigma", sigma), ("m", couple)):
        wanted = turn @ tensor[8] @ turn.T
        error = np.abs(tensor[9] - wanted).max() / np.abs(wanted).max()
        case.below(f"slanted layers: {name}, error / largest", float(error), 1e-13)


def series() -> np.ndarray:
    """Stresses of a stack under the three stretches: equal in-plane strain, equal stress across."""
    m = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    lam = E * NU / ((1 + NU) * (1 - 2 * NU))
    x, y, z = STRETCH
    joint = NORMAL * THICK
    layer = (z * joint - lam * (x + y)) / (m + joint)  # stretch of a layer
    return np.array(
        [m * x + lam * (y + layer), m * y + lam * (x + layer), lam * (x + y) + m * layer]
    )


def beam(
    case: Case, cells: int, shear: float, load: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run the layered continuum; return positions, displacements, rotations."""
    mesh = box(
        np.array([0.0, 0.0, -HEIGHT / 2]), np.array([LENGTH, WIDTH, HEIGHT / 2]), (cells, 1, 2)
    )
    mesh = converted(mesh, "hex20")
    save(mesh, case.folder / "beam.h5")
    text = (case.folder / "beam.nml").read_text().replace("SHEAR", repr(shear))
    (case.folder / "run.nml").write_text(text.replace("LOAD", load))
    case.run("talus-fem", "run.nml")
    last = field_steps(case.folder / "run.h5")[-1].solid
    return mesh.x, last["u"], last["phi"]


def tip(x: np.ndarray, u: np.ndarray) -> float:
    """Mean deflection of the end [m]."""
    return float(u[x[:, 0] > LENGTH - 1e-9, 2].mean())


def stack(case: Case, joint: float, shear: float, cells: int) -> float:
    """Deflection of the end of the stack whose layers and joints are meshed."""
    edges = [0.0]
    for k in range(1, COUNT):
        edges += [k * LAYER - joint / 2, k * LAYER + joint / 2]
    z = np.array([*edges, HEIGHT]) - HEIGHT / 2
    mesh = box(np.array([0.0, 0.0, -0.5]), np.array([LENGTH, WIDTH, 0.5]), (cells, 1, len(z) - 1))
    row = np.rint((mesh.x[:, 2] + 0.5) * (len(z) - 1)).astype(int)
    mesh.x[:, 2] = z[row]
    soft = np.ptp(row[mesh.hex8] % 2, axis=1) * (row[mesh.hex8].min(axis=1) % 2) > 0
    mesh.volumes |= {"layer": np.flatnonzero(~soft), "joint": np.flatnonzero(soft)}
    mesh = converted(mesh, "hex20")
    save(mesh, case.folder / "stack.h5")
    text = (case.folder / "stack.nml").read_text().replace("YOUNG", repr(2 * shear * joint))
    (case.folder / "run_stack.nml").write_text(text)
    case.run("talus-fem", "run_stack.nml")
    return tip(mesh.x, field_steps(case.folder / "run_stack.h5")[-1].solid["u"])


def run(case: Case) -> None:
    """Judge the point, beams of free layers and the stack; plot the deflections."""
    judge_point(case)
    moment = 1.0e-3 * PLATE  # m12 [N/m] that bends the layers by 1e-3 1/m
    x, u, phi = beam(case, 10, 0.0, f"&couple group = 'x1', value = 0.0, {moment!r}, 0.0 /")
    wanted = -0.5e-3 * x[:, 0] ** 2
    error = np.abs(u[:, 2] - wanted).max() / np.abs(wanted).max()
    case.below("end couple: deflection, error / largest", float(error), 1e-7,
               "round-off: a hundred layers long, E/B = 4500")  # fmt: skip
    traction = f"&traction group = 'x1', value = 0.0, 0.0, {LOAD!r} /"
    exact = LOAD * (LENGTH / G + LENGTH**3 / (3 * PLATE))
    sizes = (5, 10, 20)
    errors = []
    for n in sizes:
        x, u, phi = beam(case, n, 0.0, traction)
        errors.append(abs(tip(x, u) / exact - 1.0))
    order = float(np.log2(errors[0] / errors[2]) / 2)
    case.above("end load: observed order of the deflection", order, 1.8)
    case.below("end load: error of the deflection, 20 elements", errors[-1], 0.005)
    shears = np.array([1.0e7, 1.0e8, 1.0e9, 1.0e10])  # k_s [Pa/m]; G/b is 8e9
    whole, meshed = [], []
    for shear in shears:
        x, u, phi = beam(case, 20, float(shear), traction)
        whole.append(tip(x, u))
        meshed.append(stack(case, 0.02 * LAYER, float(shear), 40))
    ratio = np.array(whole) / np.array(meshed)
    for shear, r in zip(shears, ratio, strict=True):
        case.metric(
            f"k_s b/G = {shear * LAYER / G:.1e}: continuum / meshed layers", float(r), 1.0, 0.05
        )
    fig, ax = case.figure()
    scaled = shears * LAYER / G
    ax.loglog(scaled, meshed, "o", mfc="none", mec="k", label="layers and joints meshed")
    ax.loglog(scaled, whole, "k-", label="layered micropolar solid")
    ax.axhline(exact, color="0.5", ls="--", lw=1, label="free layers")
    solid = LOAD * (
        LENGTH / G * 1.2 + LENGTH**3 * HEIGHT / (3 * YOUNG / (1 - POISSON**2) * HEIGHT**3 / 12)
    )
    ax.axhline(solid, color="0.5", ls=":", lw=1, label="no joints")
    ax.set(xlabel="$k_s b/G$ [-]", ylabel="deflection of the end [m]")
    ax.legend()
    case.save(fig)
