"""Blocks whose stress is linear in space, and one afloat: loads that vary linearly."""

import numpy as np
from solid import save, shape_of

from talus.mesh import Mesh, box
from talus.orders import converted
from talus.verification import Case, field_steps

YOUNG, POISSON, SIZE = 2.0e7, 0.3, np.array([2.0, 1.0, 1.5])
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
SHEAR = YOUNG / (2 * (1 + POISSON))
ELEMENTS = ("hex20", "hex27", "hex27_bbar", "tet10")
NORMALS = {f"{c}{side}": (2 * side - 1) * np.eye(3)[k] for k, c in enumerate("xyz")
           for side in (0, 1)}  # fmt: skip
ORIGIN = np.array([0.3, -0.2, 0.7])
ROUND_OFF = 1.0e-11  # relative; the solution is exact in the space of the elements


def block(kind: str) -> Mesh:
    """The block, with its corners of support as groups."""
    mesh = converted(box(np.zeros(3), SIZE, (3, 2, 2)), kind)
    for name, place in (("0", (0, 0, 0)), ("x", (SIZE[0], 0, 0)), ("y", (0, SIZE[1], 0))):
        mesh.nodes[f"corner_{name}"] = np.flatnonzero(np.isclose(mesh.x, place).all(axis=1))
    return mesh


def random_field() -> tuple[np.ndarray, np.ndarray]:
    """Linear part h (3, 3) and quadratic part q (3, 3, 3), u_i = h_ij x_j + q_ijk x_j x_k."""
    numbers = np.random.default_rng(5)
    h, q = 1e-3 * numbers.normal(size=(3, 3)), 1e-3 * numbers.normal(size=(3, 3, 3))
    return h, 0.5 * (q + q.transpose(0, 2, 1))


def hang(h: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Add the rotation to h that leaves the corners of support where they are."""
    corner_x, corner_y = SIZE * [1, 0, 0], SIZE * [0, 1, 0]
    at_x = h @ corner_x + q @ corner_x @ corner_x
    at_y = h @ corner_y + q @ corner_y @ corner_y
    spin = np.zeros((3, 3))
    spin[1, 0], spin[2, 0] = -at_x[1] / SIZE[0], -at_x[2] / SIZE[0]
    spin[2, 1] = -at_y[2] / SIZE[1]
    return h + spin - spin.T


def stress_of(gradient: np.ndarray) -> np.ndarray:
    """Stress of a displacement gradient, indices first."""
    strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
    trace = np.einsum("ii...->...", strain)
    return 2 * SHEAR * strain + LAME * np.einsum("ij,...->ij...", np.eye(3), trace)


def words(values: np.ndarray) -> str:
    """Numbers of a deck."""
    return ", ".join(repr(float(v)) for v in np.ravel(values))


def judge(case: Case, label: str, kind: str, h: np.ndarray, q: np.ndarray, loads: str) -> float:
    """Run a block and judge displacements and stresses of elements against the exact ones."""
    mesh = block(shape_of(kind))
    save(mesh, case.folder / "block.h5")
    slope = stress_of(2 * q)  # (i, j, k) of stress ij along x_k
    force = -np.einsum("ijj->i", slope)
    text = (case.folder / "block.nml").read_text()
    for word, value in (("ELEMENT", kind), ("FORCE", words(force)), ("LOADS", loads)):
        text = text.replace(word, value)
    (case.folder / f"{label}_{kind}.nml").write_text(text)
    case.run("talus-fem", f"{label}_{kind}.nml")
    found = field_steps(case.folder / f"{label}_{kind}.h5")[-1].solid
    exact = mesh.x @ h.T + np.einsum("ijk,nj,nk->ni", q, mesh.x, mesh.x)
    off = float(abs(found["u"] - exact).max() / abs(exact).max())
    case.below(f"{label}, {kind}: displacement, error / largest", off, ROUND_OFF)
    stress = stress_of(h)[..., None] + np.einsum("ijk,nk->ijn", slope, mesh.x)
    exact = np.array([stress[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))])
    off_stress = float(abs(found["stress_nodal"] - exact.T).max() / abs(exact).max())
    case.below(f"{label}, {kind}: nodal stress, error / largest", off_stress, ROUND_OFF)
    return off


def tractions(h: np.ndarray, q: np.ndarray) -> str:
    """Lines of the deck: tractions of the stress on the six faces."""
    slope, lines = stress_of(2 * q), []
    for face, n in NORMALS.items():
        gradient = np.einsum("ijk,j->ik", slope, n)
        value = stress_of(h) @ n + gradient @ ORIGIN
        lines.append(f"&traction group = '{face}', value = {words(value)}, "
                     f"gradient = {words(gradient)}, origin = {words(ORIGIN)} /")  # fmt: skip
    return "\n".join(lines)


def water() -> tuple[np.ndarray, np.ndarray, str]:
    """Fields and loads of pressure p = 5e4 - 2e4 z all round: strains -p (1 - 2 nu)/E."""
    level, slope = 5.0e4, -2.0e4
    squeeze = (1 - 2 * POISSON) / YOUNG
    h, q = -level * squeeze * np.eye(3), np.zeros((3, 3, 3))
    q[0, 0, 2] = q[0, 2, 0] = q[1, 1, 2] = q[1, 2, 1] = -0.5 * slope * squeeze
    q[2] = 0.5 * slope * squeeze * np.diag([1.0, 1.0, -1.0])
    value = float(level + slope * ORIGIN[2])
    loads = "\n".join(
        f"&pressure group = '{face}', value = {value!r}, gradient = 0.0, 0.0, {slope!r}, "
        f"origin = {words(ORIGIN)} /" for face in NORMALS
    )  # fmt: skip
    return hang(h, q), q, loads


def judge_afloat(case: Case) -> None:
    """Judge where water, springs and weight balance at half and at full pressure."""
    save(box(np.zeros(3), SIZE, (2, 2, 2)), case.folder / "float.h5")
    case.run("talus-fem", "afloat.nml")
    weight = 600.0 * 9.81 * SIZE[2]  # per area
    for step in field_steps(case.folder / "afloat.h5")[1:]:
        share = step.time
        # share (2000 - 9810 (w - 0.1)) - 5000 w = weight
        wanted = (share * (2.0e3 + 981.0) - weight) / (share * 9810.0 + 5.0e3)
        found = float(step.solid["u"][:, 2].mean())
        case.metric(f"afloat, time {share}: rise / exact", found / wanted, 1.0, 1e-6)


def run(case: Case) -> None:
    """Judge blocks of all quadratic kinds and the block afloat; plot the errors."""
    h, q = random_field()
    h = hang(h, q)
    wet_h, wet_q, wet = water()
    off = {
        "tractions": [judge(case, "tractions", k, h, q, tractions(h, q)) for k in ELEMENTS],
        "pressure": [judge(case, "pressure", k, wet_h, wet_q, wet) for k in ELEMENTS],
    }
    judge_afloat(case)
    fig, ax = case.figure()
    for (label, values), mark in zip(off.items(), "os", strict=True):
        ax.semilogy(ELEMENTS, values, mark, label=label)
    ax.axhline(ROUND_OFF, color="k", lw=1, label="limit")
    ax.set(xlabel="elements", ylabel="error of the displacement / largest [-]", ylim=(1e-16, 1e-9))
    ax.legend()
    case.save(fig)
