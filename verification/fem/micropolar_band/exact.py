"""A shear band in a softening layer: width, fall of the load, what the mesh does to both."""

import numpy as np

from talus.mesh import Mesh, structured, write_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

LENGTH, SIDE = 0.1, 0.005
SHEAR, KAPPA, POISSON, COHESION = 4.0e7, 4.0e7, 0.25, 1.0e5
TANGENT = -SHEAR / 100.0  # of the symmetric shear stress over the shear strain, softening
BENDING = 66.0  # gamma of the couple stress [N]
SLOPE = 2.0 * np.sqrt(6.0) / 3.0  # A of a cone without friction
HARDENING = 2.0 / SLOPE**2 / (1.0 / TANGENT - 1.0 / SHEAR)
CELLS = (32, 64, 128)
END = {"exact": 2.0e-3, "polar": 2.0e-3, "plain": 0.4e-3}  # of the upper face [m]
MILLI = 1e3


def elastic_wave() -> float:
    """Wave number of the micro-rotation where the layer unloads [1/m]."""
    return np.sqrt(2 * KAPPA * SHEAR / (BENDING * (SHEAR + KAPPA / 2)))


def plastic_wave() -> float:
    """Wave number of the micro-rotation in the band [1/m]."""
    return np.sqrt(-2 * KAPPA * TANGENT / (BENDING * (KAPPA / 2 + TANGENT)))


def outside(half: float) -> tuple[float, float]:
    """Factors P, Q of phi = 1/(2 G) + P cosh + Q sinh (k (z - half)) beyond the band, d tau = 1."""
    place = elastic_wave() * (LENGTH / 2 - half)
    p = -1 / KAPPA - 1 / (2 * SHEAR)
    return p, -(1 / (2 * SHEAR) + p * np.cosh(place)) / np.sinh(place)


def mismatch(half: float) -> float:
    """Jump of the curvature at the end of a band; zero where the band ends."""
    k = plastic_wave()
    inside = (-1 / KAPPA - 1 / (2 * TANGENT)) / np.cos(k * half)
    return -inside * k * np.sin(k * half) - elastic_wave() * outside(half)[1]


def band() -> float:
    """Half of the width of the band, by bisection between a quarter and a half of its wave [m]."""
    low, high = 1.0001 * np.pi / 2 / plastic_wave(), 0.9999 * np.pi / plastic_wave()
    for _ in range(200):
        middle = 0.5 * (low + high)
        if mismatch(low) * mismatch(middle) <= 0:
            high = middle
        else:
            low = middle
    return low


def rates(y: np.ndarray, half: float) -> tuple[np.ndarray, float]:
    """Plastic shear strain at y and displacement of the faces [m], for one pascal less load."""
    k, e = plastic_wave(), elastic_wave()
    wave = (-1 / KAPPA - 1 / (2 * TANGENT)) / np.cos(k * half)
    p, q = outside(half)
    far = LENGTH / 2 - half
    slope = (1 + KAPPA * (1 / (2 * TANGENT) + wave * np.cos(k * y))) / (TANGENT + KAPPA / 2)
    inner = (half * (1 + KAPPA / (2 * TANGENT)) + KAPPA * wave * np.sin(k * half) / k) / (
        TANGENT + KAPPA / 2
    )
    outer = (
        far * (1 + KAPPA / (2 * SHEAR))
        + KAPPA * (p * np.sinh(e * far) + q * (np.cosh(e * far) - 1)) / e
    ) / (SHEAR + KAPPA / 2)
    # of the slope u' the part TANGENT/SHEAR is elastic
    shear = np.where(abs(y) < half, slope * (1 - TANGENT / SHEAR), 0.0)
    return -shear, -2 * (inner + outer)


def spread(y: np.ndarray, shear: np.ndarray) -> float:
    """Width over which a shear strain is spread, (sum)^2 / sum of squares, of equal cells [m]."""
    return float(np.sum(shear) ** 2 / np.sum(shear**2) * (y[1] - y[0]))


def solve(case: Case, kind: str, n: int) -> dict:
    """Run n elements across the layer; return load, displacement, shear of the cells."""
    line = np.array([0.0, SIDE])
    x, hex8 = structured((line, np.linspace(-LENGTH / 2, LENGTH / 2, n + 1), line))
    centre = x[hex8].mean(1)[:, 1]
    zone = 2 * LENGTH / n if kind == "plain" else LENGTH / 8
    weak = abs(centre) < zone / 2
    groups = {"sound": np.flatnonzero(~weak), "middle": np.flatnonzero(weak)}
    mesh = converted(Mesh(x, hex8, groups | {"all": np.arange(len(hex8))}), "hex20")
    mesh.nodes["bottom"] = np.flatnonzero(np.isclose(mesh.x[:, 1], -LENGTH / 2))
    mesh.nodes["top"] = np.flatnonzero(np.isclose(mesh.x[:, 1], LENGTH / 2))
    write_mesh(case.folder / f"{kind}_{n}_mesh.h5", mesh)
    long, turn = np.sqrt(BENDING / SHEAR / 2), np.sqrt(KAPPA / (2 * SHEAR + KAPPA))
    polar = f"""shear = {SHEAR}, poisson = {POISSON}, l_b = {float(long / np.sqrt(2))!r},
          l_t = {float(long)!r}, coupling = {float(turn)!r},
          polar_ratio = 1.0, plastic_length = {100.0 if kind == "exact" else 4.0e-3},"""
    plain = f"young = {2 * SHEAR * (1 + POISSON)}, poisson = {POISSON},"
    words = {
        "MESH": f"{kind}_{n}_mesh",
        "LAW": "drucker_prager" if kind == "plain" else "micropolar_drucker_prager",
        "CONSTANTS": plain if kind == "plain" else polar,
        "END": repr(END[kind]),
        "HARDENING": repr(float(HARDENING)),
        "ELEMENT": "hex20" if kind == "plain" else "hex20/hex8",
        "HOLD": "" if kind == "plain" else ", 'rx', 'ry'",
        "FACE": "" if kind == "plain" else ", 'rz'",
        "&support  group = 'top'TOP /\n": ""
        if kind == "plain"
        else "&support  group = 'top', fix = 'rz' /\n",
    }
    text = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{kind}_{n}.nml").write_text(text)
    case.run("talus-fem", f"{kind}_{n}.nml")
    history = read_history(case.folder / f"{kind}_{n}_reactions.csv")
    energy = read_history(case.folder / f"{kind}_{n}_energy.csv")
    shear = [s.solid["plastic_strain"][:, 3] for s in field_steps(case.folder / f"{kind}_{n}.h5")]
    return {
        "u": END[kind] * history["time"],
        "tau": history["top x"] / SIDE**2,
        "y": centre,
        "shear": np.array(shear),
        "ledger": float(abs(energy["closure"]).max() / energy["plastic"].max()),
        "growth": float(np.diff(energy["plastic"]).min()),
    }


def judge_exact(case: Case, half: float) -> None:
    """Judge width, profile and fall of the load where couple stresses do not yield."""
    n = CELLS[-1]
    found = solve(case, "exact", n)
    fine = np.linspace(-LENGTH / 2, LENGTH / 2, 20 * n + 1)
    shear, moved = rates(0.5 * (fine[1:] + fine[:-1]), half)
    lost = found["tau"][-11] - found["tau"][-1]
    rate = (found["shear"][-1] - found["shear"][-11]) / lost
    wanted = shear.reshape(n, -1).mean(1)
    off = float(abs(rate - wanted).max() / wanted.max())
    fall = lost / (found["u"][-1] - found["u"][-11]) * moved
    case.metric("exact, 128 elements: fall of the load / closed form", float(fall), 1.0, 0.005)
    case.metric("exact, 128 elements: width / closed form",
                spread(found["y"], rate) / spread(found["y"], wanted), 1.0, 0.005)  # fmt: skip
    case.below("exact, 128 elements: profile, error / largest", off, 0.01)


def judge_meshes(case: Case, kind: str, ax: object) -> None:
    """Judge the bands of three meshes, and plot them."""
    widths, ends = [], []
    for n, mark in zip(CELLS, "so^", strict=True):
        found = solve(case, kind, n)
        widths.append(spread(found["y"], found["shear"][-1] - found["shear"][-6]))
        ends.append(float(found["tau"][-1]))
        case.below(f"{kind}, {n}: ledger, error / largest", found["ledger"], 1e-7)
        case.above(f"{kind}, {n}: least growth of the dissipation [J]", found["growth"], 0.0)
        ax.plot(100 * found["shear"][-1], MILLI * found["y"], mark + "-", ms=3, mfc="none",
                label=f"{n} elements")  # fmt: skip
    if kind == "plain":
        case.metric("plain: width, 32 / 128 elements", widths[0] / widths[2], 4.0, 0.05)
        return
    case.metric("polar: width, 32 / 128 elements", widths[0] / widths[2], 1.0, 0.08)
    case.metric("polar: width, 64 / 128 elements", widths[1] / widths[2], 1.0, 0.02)
    case.metric("polar: load at the end, 32 / 128 elements", ends[0] / ends[2], 1.0, 0.02)
    case.metric("polar: load at the end, 64 / 128 elements", ends[1] / ends[2], 1.0, 0.005)


def run(case: Case) -> None:
    """Judge the exact band, then three meshes with and without couple stresses; plot the bands."""
    judge_exact(case, band())
    fig, axes = case.figure(ncols=2, sharey=True)
    judge_meshes(case, "polar", axes[0])
    judge_meshes(case, "plain", axes[1])
    for ax, title in zip(axes, ("micropolar", "classical"), strict=True):
        ax.set(xlabel="plastic shear strain [%]", title=title)
        ax.legend()
    axes[0].set(ylabel="y [mm]")
    case.save(fig)
