"""Softening shear band of a micromorphic layer: width, shape and falling branch on three meshes."""

import numpy as np
from solid import save

from talus.compare import max_of
from talus.mesh import Mesh, structured
from talus.verification import Case, field_steps, read_history

MU, KAPPA, NU, SIGMA, TAU = 7.0, 10.0, 8.0, 1.0, 0.03
SOFTENING, HEIGHT, WEAK = -1.0, 2.0, 0.125
A, ROOT = 2 * np.sqrt(6) / 3, np.sqrt(2)  # cone without friction
MACRO, MICRO = KAPPA + NU - 2 * SIGMA, KAPPA + NU - SIGMA
MESHES = (16, 32, 64)


def rates(plastic: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u', the flow g and (s, d)'' as rows linear in (T, s, d), for changes past the peak."""
    a, b, c = MU + SIGMA, SIGMA + MACRO / 2, (KAPPA - NU) / 2
    left = np.array([
        [a + b + c, -ROOT * (a + 2 * b)],
        [ROOT * (MU + 2 * SIGMA + MICRO), -2 * (MU + 2 * SIGMA + 2 * MICRO) - A * A * SOFTENING],
    ])  # fmt: skip
    right = np.array([[1.0, -b, -c], [0.0, -ROOT * MICRO, 0.0]])
    slope, flow = right[0] / left[0, 0], np.zeros(3)
    if plastic:
        slope, flow = np.linalg.solve(left, right)
    strain = slope - ROOT * flow
    both = slope - 2 * ROOT * flow + np.array([0.0, 1.0, 0.0])
    turn = slope + np.array([0.0, 0.0, 1.0])
    return slope, flow, np.array([2 * SIGMA * strain + MACRO * both, (KAPPA - NU) * turn]) / TAU


class Band:
    """Closed form of a band of half-width w, for a unit change of the shear stress."""

    def __init__(self, w: float):
        """Match the waves inside to the decay outside, s, d and their slopes."""
        (self.slope, self.flow, inner), (self.outer_slope, _, outer) = rates(True), rates(False)
        self.w = w
        self.inner_mean = -np.linalg.solve(inner[:, 1:], inner[:, 0])
        self.outer_mean = -np.linalg.solve(outer[:, 1:], outer[:, 0])
        square, self.inner_mode = np.linalg.eig(inner[:, 1:])
        self.inner_root = np.sqrt(square.astype(complex))
        square, self.outer_mode = np.linalg.eig(outer[:, 1:])
        self.outer_root = np.sqrt(square)
        n = self.inner_root
        match = np.zeros((4, 4), complex)
        match[:2, :2], match[:2, 2:] = self.inner_mode * np.cosh(n * w), -self.outer_mode
        match[2:, :2] = self.inner_mode * n * np.sinh(n * w)
        match[2:, 2:] = self.outer_mode * self.outer_root
        jump = np.r_[self.outer_mean - self.inner_mean, 0.0, 0.0]
        self.size = np.linalg.solve(match, jump.astype(complex))

    def inside(self, z: np.ndarray) -> np.ndarray:
        """Return s and d at heights inside."""
        wave = np.cosh(self.inner_root[:, None] * z)
        return self.inner_mean[:, None] + (self.inner_mode @ (self.size[:2, None] * wave)).real

    def g(self, z: np.ndarray) -> np.ndarray:
        """Return the flow at heights, zero outside."""
        s, d = self.inside(np.minimum(abs(z), self.w))
        return np.where(abs(z) < self.w, self.flow[0] + self.flow[1] * s + self.flow[2] * d, 0.0)

    def rim(self) -> float:
        """Return the flow just inside the rim."""
        return float(self.g(np.array([self.w * (1 - 1e-12)]))[0])

    def motion(self) -> float:
        """Return the change of the motion of the top."""
        z = np.linspace(0.0, self.w, 4001)
        s, d = self.inside(z)
        total = np.trapezoid(self.slope[0] + self.slope[1] * s + self.slope[2] * d, z)
        z = np.linspace(0.0, HEIGHT / 2 - self.w, 4001)
        decay = np.exp(-self.outer_root[:, None] * z)
        s, d = self.outer_mean[:, None] + self.outer_mode @ (self.size[2:, None].real * decay)
        slope = self.outer_slope
        total += np.trapezoid(slope[0] + slope[1] * s + slope[2] * d, z)
        return 2 * float(total)


def exact_band() -> Band:
    """Return the band whose flow vanishes at the rim."""
    low, high = 0.25, 0.45
    for _ in range(60):
        middle = (low + high) / 2
        inside = Band(low).rim() * Band(middle).rim() > 0
        low, high = (middle, high) if inside else (low, middle)
    return Band(low)


def width(flow: np.ndarray, weight: float) -> float:
    """Return (sum of flow)^2 over sum of flow^2: the width of a uniform band with both."""
    return float(weight * flow.sum() ** 2 / (flow**2).sum())


def solve(case: Case, n: int) -> dict:
    """Run n elements; return the history, and flow by height and its growth in the last 0.4 s."""
    side = np.array([0.0, HEIGHT / 2 / n])
    x, hex8 = structured((side, side, np.linspace(0.0, HEIGHT / 2, n + 1)))
    weak = x[hex8].mean(axis=1)[:, 2] < WEAK
    groups = {"all": np.arange(n), "middle": np.flatnonzero(weak), "strong": np.flatnonzero(~weak)}
    mesh = Mesh(x, hex8, groups)
    for name, z in (("bottom", 0.0), ("top", HEIGHT / 2)):
        mesh.nodes[name] = np.flatnonzero(np.isclose(mesh.x[:, 2], z))
    save(mesh, case.folder / "layer.h5")
    name = f"band_{n}"
    text = (case.folder / "band.nml").read_text()
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    history = read_history(case.folder / f"{name}_reactions.csv")
    steps = field_steps(case.folder / f"{name}.h5")
    z = steps[-1].solid["points_x"][:, 2]
    flow = steps[-1].solid["state_points"][:, 12] / A
    growth = flow - steps[-3].solid["state_points"][:, 12] / A
    motion = 2 * np.interp(history["time"], (0, 0.2, 1), (0, 1.6e-4, 2.2e-4))
    stress = history["top x"] / (HEIGHT / 2 / n) ** 2
    found = {"z": z, "g": flow, "growth": growth, "U": motion, "T": stress}
    return found | {"width": 2 * width(growth, HEIGHT / 2 / growth.size)}


def warnings_of(case: Case, hardening: float) -> list[str]:
    """Return what a run of a uniform layer with a macro-cone says of ellipticity."""
    name = f"macro_{abs(hardening):.3f}".replace(".", "_")
    text = (case.folder / f"band_{MESHES[0]}.nml").read_text().replace("'micro'", "'macro'")
    text = text.replace("'Shear band'", "'Shear band', t_end = 0.36")
    text = text.replace("hardening = -1.0", f"hardening = {hardening:.17g}")
    text = text.replace("0.99e-3", "1.0e-3")
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    return told(case, name)


def told(case: Case, name: str) -> list[str]:
    """Return the lines of a log about ellipticity."""
    log = (case.folder / f"{name}.log").read_text()
    return [line for line in log.splitlines() if "loses ellipticity" in line]


def ellipticity(case: Case) -> None:
    """Judge when and where hardening is said to lose ellipticity."""
    for n in MESHES:
        count = len(told(case, f"band_{n}"))
        case.metric(f"{n} elements, micro-cone: warnings", count, 0, 0, "the gradient keeps it")
    one, other = MU + SIGMA + KAPPA, MU + SIGMA + NU  # of P_xz by F_xz and F_zx, chi held
    critical = ((one + other) ** 2 / (2 * one) - (one + other)) / A**2
    above = warnings_of(case, 0.97 * critical)
    case.metric("macro-cone, 3 % above the critical softening: warnings", len(above), 0, 0)
    below = warnings_of(case, 1.03 * critical)
    case.metric("macro-cone, 3 % below it: warnings", len(below), 1, 0, "once")
    line = below[0] if below else ""
    case.metric("it names the first element", float("point 1 of element 1," in line), 1.0, 0.0)
    normal = line.split("direction ")[-1].split(";")[0].split(",") if line else ["0"]
    largest = max_of(abs(float(value)) for value in normal)
    case.metric("its direction, largest component", largest, 1.0, 1e-3, "along z or x")


def run(case: Case) -> None:
    """Judge width, shape and falling branch; plot them."""
    band = exact_band()
    grid = np.linspace(-HEIGHT / 2, HEIGHT / 2, 8001)
    wanted = width(band.g(grid), grid[1] - grid[0])
    runs = [solve(case, n) for n in MESHES]
    ellipticity(case)
    for n, found, limit in zip(MESHES, runs, (0.06, 0.02, 0.01), strict=True):
        case.metric(f"{n} elements: width / closed form", found["width"] / wanted, 1.0, limit)
    fine = runs[-1]
    slope = float((fine["T"][-1] - fine["T"][-6]) / (fine["U"][-1] - fine["U"][-6]))
    case.metric("64 elements: falling slope / closed form", slope * band.motion(), 1.0, 0.03)
    shape = band.g(fine["z"]) / band.g(np.zeros(1))
    off = abs(fine["growth"] / fine["growth"].max() - shape).max()
    case.below("64 elements: shape of the flow, error / largest", float(off), 0.03)
    spread = float(runs[1]["T"][-1] / fine["T"][-1] - 1)
    case.below("stress at the end, 32 against 64 elements", abs(spread), 0.02)
    fig, ax = case.figure()
    half = grid[grid >= 0]
    ax.plot(half, band.g(half) / band.g(np.zeros(1)), "k-", lw=1, label="closed form")
    for n, found, mark in zip(MESHES, runs, "so.", strict=True):
        ax.plot(found["z"], found["growth"] / fine["growth"].max(), mark, mfc="none", ms=5,
                label=f"{n} elements")  # fmt: skip
    ax.set(
        xlabel="distance from the middle [m]", ylabel="growth of flow / largest [-]", xlim=(0, 0.6)
    )
    ax.legend()
    case.save(fig)
    fig, ax = case.figure()
    for n, found, mark in zip(MESHES, runs, "so.", strict=True):
        ax.plot(1e3 * found["U"], 1e3 * found["T"], mark, mfc="none", ms=5, label=f"{n} elements")
    last = np.array([fine["U"][-1] - 0.6e-4, fine["U"][-1]])
    ax.plot(1e3 * last, 1e3 * (fine["T"][-1] + (last - last[-1]) / band.motion()), "k-", lw=1,
            label="slope of the closed form")  # fmt: skip
    ax.set(xlabel="motion of the faces [mm]", ylabel="shear stress [mPa]")
    ax.legend()
    case.save(fig, "branch.png")
