"""Double forces on a face, and a face on which chi is tied to F, against their closed forms."""

import numpy as np
from solid import polar_nodes, save, shape_of

from talus.mesh import Mesh, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

KAPPA, NU, SIGMA, TAU = 10.0, 8.0, 5.0, 8.0
ROOT = np.sqrt(np.array([KAPPA + NU - 2 * SIGMA, KAPPA - NU]) / TAU)  # of s and d [1/m]
REST = np.array([-(KAPPA + NU) / (KAPPA + NU - 2 * SIGMA), -1.0])  # s and d over u', far from faces
LENGTH, SHEAR = 2.0, 1.0e-5
DOUBLE = np.array([3.0e-5, -1.0e-5])  # on chi_13, chi_31 [N/m]


def exact(z: np.ndarray, load: np.ndarray | float) -> np.ndarray:
    """Return s and d (2, n): double forces on both, or the stiffness of the tie."""
    c, s = np.cosh(ROOT * LENGTH), np.sinh(ROOT * LENGTH)
    if isinstance(load, np.ndarray):
        slope = np.array([load[1] + load[0], load[1] - load[0]]) / TAU
        return np.sinh(ROOT[:, None] * z) * (slope / ROOT / c)[:, None]
    # y = R (1 - cosh) + B sinh, R = REST u', tau y' = -k (y - y_F): F has u' in 13, nothing in 31
    rest, wanted = REST * SHEAR, np.array([1.0, -1.0]) * SHEAR
    b = load * (wanted - rest * (1 - c)) + TAU * ROOT * rest * s
    b /= TAU * ROOT * c + load * s
    n = ROOT[:, None] * z
    return rest[:, None] * (1 - np.cosh(n)) + b[:, None] * np.sinh(n)


def solve(case: Case, element: str, n: int, load: np.ndarray | float) -> dict:
    """Run a column of n elements; return the error of phi, its profile, the ledger."""
    tied = not isinstance(load, np.ndarray)
    side = np.array([0.0, LENGTH / n])
    x, hex8 = structured((side, side, np.linspace(0.0, LENGTH, n + 1)))
    facets = {"top": hex8[-1:, 4:]}
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))}, facets)
    mesh = converted(mesh, shape_of(element))
    height = np.rint(2 * n * mesh.x[:, 2] / LENGTH).astype(int)
    for level in np.unique(height):
        mesh.nodes[f"level{level}"] = np.flatnonzero(height == level)
    mesh.nodes["bottom"] = mesh.nodes["level0"]
    save(mesh, case.folder / "column.h5")
    lines = [
        f"&motion group = 'level{level}', component = 'x', curve = 'ramp',"
        f" scale = {SHEAR * level * LENGTH / (2 * n):.17g} /"
        for level in np.unique(height)
    ]
    face = f"&micro_tie group = 'top', stiffness = {load} /"
    if not tied:
        lines = ["&support group = 'all', fix = 'x' /"]
        value = np.zeros(9)
        value[[2, 6]] = load
        face = f"&double_force group = 'top', value = {', '.join(f'{v:.17g}' for v in value)},"
        face += " curve = 'ramp' /"
    name = f"{'tie' if tied else 'double'}_{element.replace('/', '_')}_{n}"
    name += f"_{load:g}".replace(".", "_").replace("+", "") if tied else ""
    text = (case.folder / "deck.nml").read_text().replace("MESH", "column")
    text = text.replace("ELEMENT", element).replace("LEVELS", "\n".join(lines))
    (case.folder / f"{name}.nml").write_text(text.replace("FACE", face))
    case.run("talus-fem", f"{name}.nml")
    found = field_steps(case.folder / f"{name}.h5")[-1].solid["phi"]
    z = mesh.x[:, 2]
    s, d = exact(z, load)
    both = np.column_stack((0.5 * (s - d), 0.5 * (s + d)))
    micro = polar_nodes(mesh, element)
    energy = read_history(case.folder / f"{name}_energy.csv")
    return {
        "phi": float(abs(found[:, (2, 6)] - both)[micro].max() / abs(both).max()),
        "z": z[micro],
        "both": found[micro][:, (2, 6)],
        "top": found[micro[z[micro] > LENGTH * (1 - 1e-9)]][:, (2, 6)].mean(0),
        "energy": {key: column[-1] for key, column in energy.items()},
    }


def run(case: Case) -> None:
    """Judge profiles, orders, the work of double forces, and ties from loose to stiff."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.4, 3.8))
    grid = np.linspace(0.0, LENGTH, 201)
    for label, load, ax in (("double forces", DOUBLE, left), ("tie", 20.0, right)):
        errors = []
        for n in (5, 10, 20):
            result = solve(case, "hex20/hex8", n, load)
            errors.append(result["phi"])
        case.below(f"{label}: phi, error / largest, 20 elements", errors[-1], 1e-3)
        order = float(np.log2(errors[0] / errors[2]) / 2)
        case.metric(f"{label}: order of phi", order, 2.0, 0.2)
        other = solve(case, "hex8/hex8", 20, load)["phi"]
        case.below(f"{label}, hex8/hex8: phi, error / largest", other, 1e-3)
        s, d = exact(grid, load)
        order = np.argsort(result["z"])[::4]
        for column, line, name in ((0, 0.5 * (s - d), "chi_13"), (1, 0.5 * (s + d), "chi_31")):
            ax.plot(line * 1e5, grid, "-", lw=1, label=f"{name}, exact")
            points = result["both"][order, column] * 1e5
            ax.plot(points, result["z"][order], "o", ms=4, mfc="none", label=f"{name}, Talus")
        ax.set(xlabel=f"micro-deformation, {label} [1e-5]", ylabel="z [m]")
        ax.legend()
        if label == "double forces":
            area = (LENGTH / 20) ** 2
            work = 0.5 * area * float(DOUBLE @ result["top"])
            case.metric("double forces: strain energy / work", result["energy"]["strain"] / work,
                        1.0, 1e-4, "linear to strains of 1e-5")  # fmt: skip
    for stiffness in (0.0, 2.0, 2.0e2, 2.0e4):
        result = solve(case, "hex20/hex8", 20, stiffness)
        s, d = exact(np.array([LENGTH]), stiffness)
        wanted = np.array([0.5 * (s - d)[0], 0.5 * (s + d)[0]])
        gap = float(abs(result["top"] - wanted).max() / SHEAR)
        case.below(f"tie of {stiffness:g} N/m: chi at the face, error / u'", gap, 2e-3)
    off = float(abs(result["top"] - np.array([SHEAR, 0.0])).max() / SHEAR)
    case.below("stiffest tie: chi - F at the face / u'", off, 2e-3, "TAU/k of it is left")
    case.save(fig)
