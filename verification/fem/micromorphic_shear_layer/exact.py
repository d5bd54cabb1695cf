"""Shear of a micromorphic layer: size effect, fields across it, orders."""

import numpy as np
from solid import polar_nodes, save, shape_of

from talus.mesh import Mesh, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

MU, KAPPA, NU, SIGMA, TAU = 7.0, 10.0, 8.0, 5.0, 8.0
WHOLE = MU + SIGMA + KAPPA
C = 0.5 * np.array([KAPPA + NU, KAPPA - NU])
G = np.array([KAPPA + NU, KAPPA - NU]) / (TAU * WHOLE)
K = np.diag([KAPPA + NU - 2 * SIGMA, KAPPA - NU]) / TAU - np.outer(G, C)
ROOT, MODES = np.linalg.eig(K)
REST = np.linalg.solve(MODES, -np.linalg.solve(K, G))  # y of a thick layer, T = 1, in modes
STRAIN = 1.0e-5


def modulus(h: float) -> float:
    """Apparent shear modulus of a layer of thickness h."""
    wave = 0.5 * h * np.sqrt(ROOT)
    mean = MODES @ (REST * (1 - np.tanh(wave) / wave))
    return WHOLE / (1 - C @ mean)


def exact(z: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u, phi_xz and phi_zx at heights z for a motion of STRAIN h."""
    stress = modulus(h) * STRAIN
    n = np.sqrt(ROOT)[:, None]
    part = REST[:, None] * (1 - np.cosh(n * z) / np.cosh(n * h / 2))
    total = REST[:, None] * (z - np.sinh(n * z) / n / np.cosh(n * h / 2))
    s, d = stress * (MODES @ part)
    u = stress * (z - C @ (MODES @ total)) / WHOLE
    return u, 0.5 * (s - d), 0.5 * (s + d)


def solve(case: Case, element: str, h: float, n: int) -> dict:
    """Run n elements across a layer; return fields, their errors and the apparent modulus."""
    side = np.array([0.0, h / n])
    x, hex8 = structured((side, side, np.linspace(-h / 2, h / 2, n + 1)))
    mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), shape_of(element))
    for name, z in (("bottom", -h / 2), ("top", h / 2)):
        mesh.nodes[name] = np.flatnonzero(np.isclose(mesh.x[:, 2], z))
    mesh.nodes["faces"] = np.union1d(mesh.nodes["bottom"], mesh.nodes["top"])
    save(mesh, case.folder / "layer.h5")
    name = f"{element.replace('/', '_')}_{h:g}_{n}".replace(".", "_")
    text = (case.folder / "deck.nml").read_text().replace("MESH", "layer")
    text = text.replace("ELEMENT", element).replace("MOTION", repr(STRAIN * h))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    found = field_steps(case.folder / f"{name}.h5")[-1].solid
    force = read_history(case.folder / f"{name}_reactions.csv")["top x"][-1]
    z = mesh.x[:, 2]
    u, xz, zx = exact(z, h)
    micro = polar_nodes(mesh, element)
    u, both = u - u.min(), np.column_stack((xz, zx))
    return {
        "modulus": float(force / (h / n) ** 2 / STRAIN),
        "u": float(abs(found["u"][:, 0] - u).max() / abs(u).max()),
        "phi": float(abs(found["phi"][:, (2, 6)] - both)[micro].max() / abs(both).max()),
        "z": z[micro],
        "zx": found["phi"][micro, 6],
    }


def run(case: Case) -> None:
    """Judge size effect, fields and orders; plot the size effect and a profile."""
    sizes, found = (0.5, 1.0, 2.0, 4.0, 8.0), []
    for h in sizes:
        result = solve(case, "hex20/hex8", h, 40)
        found.append(result["modulus"])
        case.metric(f"h = {h:g}: apparent modulus / exact", found[-1] / modulus(h), 1.0, 1e-3)
    case.above("size effect: modulus at h = 0.5 / at h = 8", found[0] / found[-1], 1.2)
    case.below("h = 8: u, error / largest", result["u"], 2e-3)
    case.below("h = 8: phi, error / largest", result["phi"], 2e-3)
    profile = result
    for element in ("hex8/hex8", "hex20/hex8", "hex27/hex8"):
        errors = [solve(case, element, 2.0, n)["phi"] for n in (5, 10, 20)]
        order = float(np.log2(errors[0] / errors[2]) / 2)
        case.metric(f"{element}: order of phi", order, 2.0, 0.2)
    fig, ax = case.figure()
    line = np.geomspace(0.3, 12.0, 100)
    ax.plot(line, [modulus(h) for h in line], "k-", lw=1, label="exact")
    ax.plot(sizes, found, "o", mfc="none", label="Talus, 40 elements")
    ax.set(xlabel="thickness h [m]", ylabel="apparent shear modulus [Pa]", xscale="log")
    ax.legend()
    case.save(fig)
    fig, ax = case.figure()
    grid = np.linspace(-4.0, 4.0, 401)
    ax.plot(exact(grid, 8.0)[2] * 1e5, grid, "k-", lw=1, label="exact")
    order = np.argsort(profile["z"])[::4]
    ax.plot(profile["zx"][order] * 1e5, profile["z"][order], "o", ms=4, mfc="none", label="Talus")
    ax.set(xlabel="micro-deformation chi_zx [1e-5]", ylabel="z [m]")
    ax.legend()
    case.save(fig, "profile.png")
