"""Pressure-dependent micropolar elasticity: stored energy, circuits, a layer in shear."""

import numpy as np

from talus.mesh import boundary_faces, structured
from talus.verification import Case, field_steps, read_history, write_hex_mesh

YOUNG, POISSON, L_T, L_B, N, PSI = 1.0e8, 0.25, 2.0e-3, 1.5e-3, 0.6, 0.8
REFERENCE, LEAST, START = 1.0e5, 2.0e3, 2.0e4
SHEAR = YOUNG / (2 * (1 + POISSON))
BULK = YOUNG / (3 * (1 - 2 * POISSON))
KL = [f"{face}{along}" for face in "123" for along in "123"]
PATH = {"11": -6e-4, "12": 5e-4, "21": -2e-4, "33": 3e-4, "k13": 0.2, "k31": -0.1, "k22": 0.15}
# the layer: lambda = mu = kappa, gamma at the reference pressure, height, shift of its faces
MU, GAMMA, H, U = 1.0e8, 2.0e6, 1.0, 1.0e-6
WIDTH = np.sqrt(GAMMA * 2 * MU / (MU * 3 * MU))


def moduli() -> tuple[float, ...]:
    """Moduli from strain to stress: deviator, skew part, three parts of the curvature."""
    kappa = 2 * SHEAR * N**2 / (1 - N**2)
    gamma = 4 * SHEAR * L_B**2
    beta = 2 * SHEAR * L_T**2 - gamma
    alpha = (beta + gamma) * (1 / PSI - 1)
    return 2 * SHEAR, kappa, beta + gamma, gamma - beta, 3 * alpha + beta + gamma


def energy(strain: np.ndarray, n: float) -> complex:
    """Stored energy of the strain (18) since the state without stress, above the least pressure."""
    g, c = strain[:9].reshape(3, 3), strain[9:].reshape(3, 3)
    volume = np.trace(g)
    one = np.eye(3)

    def squares(a: np.ndarray) -> tuple[complex, complex]:
        s, w = (a + a.T) / 2 - np.trace(a) / 3 * one, (a - a.T) / 2
        return (s * s).sum(), (w * w).sum()

    e = moduli()
    sums = [*squares(g), *squares(c), np.trace(c) ** 2 / 3]
    # x is the compression of an isotropic state of the same energy
    x2 = volume**2 + sum(m * s for m, s in zip(e, sums, strict=True)) / ((1 - n) * BULK)
    r = (1 - n) * BULK / REFERENCE
    return REFERENCE / (r * (2 - n)) * (1 - n) * (r**2 * x2) ** ((2 - n) / (2 * (1 - n)))


def stress(strain: np.ndarray, n: float) -> np.ndarray:
    """Derivative of the stored energy by a complex step."""
    step = 1e-25
    found = np.zeros(18)
    for j in range(18):
        moved = strain.astype(complex)
        moved[j] += 1j * step
        found[j] = energy(moved, n).imag / step
    return found


def origin(n: float) -> np.ndarray:
    """Strain of the pressure START since the state without stress."""
    compression = REFERENCE / ((1 - n) * BULK) * (START / REFERENCE) ** (1 - n)
    return np.concatenate([-compression / 3 * np.eye(3).ravel(), np.zeros(9)])


def follow(case: Case, stem: str, n: float, steps: int, rows: list[str], curves: str,
           end: float = 1.0) -> dict[str, np.ndarray]:  # fmt: skip
    """Run a path of a point; return its table."""
    text = (case.folder / "point.nml").read_text()
    for word, value in (
        ("WHAT", stem),
        ("EXPONENT", str(n)),
        ("STEPS", str(steps)),
        ("TEND", str(end)),
        ("-START", str(-START)),
        ("CURVES", curves),
        ("CONTROLS", "\n".join(f"&control {r} /" for r in rows)),
    ):
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def columns(found: dict[str, np.ndarray], one: str, other: str) -> np.ndarray:
    """The 18 columns of a strain or a stress, a row each step."""
    return np.array([found[f"{one} {k}"] for k in KL] + [found[f"{other} {k}"] for k in KL]).T


def judge_path(case: Case, n: float, steps: int) -> dict[str, np.ndarray]:
    """Judge stress, couple stress and stored energy along a path of all kinds of strain."""
    ramp = "&curve id = 'ramp', times = 0.0, 1.0, values = 0.0, 1.0 /"
    rows = [f"component = '{k}', curve = 'ramp', scale = {v}" for k, v in PATH.items()]
    found = follow(case, f"path_{n}_{steps}".replace(".", "_"), n, steps, rows, ramp)
    strain = columns(found, "gamma", "kappa") + origin(n)
    wanted = np.array([stress(row, n) for row in strain])
    got = columns(found, "sigma", "m")
    for name, part in (("stress", slice(0, 9)), ("couple stress", slice(9, 18))):
        off = abs(got[:, part] - wanted[:, part]).max() / abs(wanted[:, part]).max()
        case.below(f"n = {n}, {steps} steps: {name}, error / largest", float(off), 1e-11)
    stored = np.array([energy(row, n).real for row in strain])
    off = abs(found["stored_energy"] - (stored - stored[0])).max() / stored.max()
    case.below(f"n = {n}, {steps} steps: stored energy, error / largest", float(off), 1e-11)
    return found


def judge_compression(case: Case, n: float) -> dict[str, np.ndarray]:
    """Judge p^(1-n), which grows in proportion to the compression."""
    ramp = "&curve id = 'ramp', times = 0.0, 1.0, values = 0.0, 1.0 /"
    rows = [f"component = '{k}', curve = 'ramp', scale = -8.0e-4" for k in ("11", "22", "33")]
    found = follow(case, f"compression_{n}".replace(".", "_"), n, 20, rows, ramp)
    off = abs(-found["sigma 22"] / compressed(-3 * found["gamma 11"], n) - 1).max()
    case.below(f"n = {n}: p of isotropic compression, error / p", float(off), 1e-12)
    factor = (-found["sigma 22"] / REFERENCE) ** n
    off = abs(found["stiffness_factor"] / factor - 1).max()
    case.below(f"n = {n}: factor on the moduli / (p/p0)^n - 1", float(off), 1e-12)
    return found


def compressed(v: np.ndarray, n: float) -> np.ndarray:
    """Pressure after an isotropic compression from START [Pa]."""
    grown = (START / REFERENCE) ** (1 - n) + (1 - n) * BULK * v / REFERENCE
    return REFERENCE * grown ** (1 / (1 - n))


def judge_circuit(case: Case) -> None:
    """Judge what a circle in compression, shear and curvature leaves of stress and energy."""
    t = np.linspace(0.0, 1.0, 81)
    curves = "\n".join(
        f"&curve id = '{name}', times = {', '.join(map(repr, t.tolist()))}, "
        f"values = {', '.join(map(repr, f.tolist()))} /"
        for name, f in (("cos", 1 - np.cos(2 * np.pi * t)), ("sin", np.sin(2 * np.pi * t)))
    )
    rows = [
        "component = '11', curve = 'cos', scale = -3.0e-4",
        "component = '12', curve = 'sin', scale = 4.0e-4",
        "component = 'k13', curve = 'sin', scale = 0.1",
    ]
    found = follow(case, "circuit", 0.5, 80, rows, curves)
    got = columns(found, "sigma", "m")[:, :9]
    off = abs(got[-1] - got[0]).max() / abs(got).max()
    case.below("circuit: change of the stress / largest", float(off), 1e-11)
    off = abs(found["stored_energy"][-1]) / found["stored_energy"].max()
    case.below("circuit: change of the stored energy / largest", float(off), 1e-11)


def judge_layer(case: Case, pressure: float) -> dict[str, np.ndarray]:
    """Judge a layer in shear under a pressure; return micro-rotations over the height."""
    factor = (pressure / REFERENCE) ** 0.5
    part = 1.0 - 0.5 * WIDTH / H * np.tanh(H / (2 * WIDTH))
    tau = factor * 1.5 * MU * U / H / part
    name = f"layer_{pressure:.0f}"
    text = (case.folder / "layer.nml").read_text().replace("PRESSURE", str(pressure))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    fields = field_steps(case.folder / f"{name}.h5")[-1].solid
    force = read_history(case.folder / f"{name}_reactions.csv")["top x"][-1] / 0.01
    label = f"layer under {pressure / 1e3:.0f} kPa"
    case.metric(f"{label}: shear stress / exact", float(force / tau), 1.0, 1e-3)
    y = fields["y"] = line_of(fields["u"].shape[0])
    wanted = turned(y, tau / factor)
    off = abs(fields["phi"][:, 2] - wanted).max() / abs(wanted).max()
    case.below(f"{label}: micro-rotation, error / largest", float(off), 1e-3)
    off = abs(fields["stiffness_factor"] / factor - 1).max()
    case.below(f"{label}: factor on the moduli / (p/p0)^n - 1", float(off), 1e-5)
    return fields | {"force": np.array([force])}


def turned(y: np.ndarray, tau: float) -> np.ndarray:
    """Micro-rotation about z at a shear stress that is divided by the factor on the moduli."""
    return -tau / (3 * MU) * (1.0 - np.cosh(y / WIDTH) / np.cosh(H / (2 * WIDTH)))


def make_layer(case: Case) -> None:
    """Write the mesh, 88 elements across the layer, and its sides, which the pressure loads."""
    line = np.array([0.0, 0.1])
    x, hex8 = structured((line, np.linspace(-0.5, 0.5, 89), line))
    nodes = {
        "bottom": np.flatnonzero(np.isclose(x[:, 1], -0.5)),
        "top": np.flatnonzero(np.isclose(x[:, 1], 0.5)),
        "faces": np.flatnonzero(np.isclose(abs(x[:, 1]), 0.5)),
    }
    sides = [q for _, q in boundary_faces(hex8).values() if np.ptp(x[q][:, 0]) == 0.0]
    write_hex_mesh(case.folder / "layer.h5", x, hex8, {"sides": np.array(sides)}, nodes)


def line_of(count: int) -> np.ndarray:
    """Heights of the nodes of the layer."""
    line = np.array([0.0, 0.1])
    x, _ = structured((line, np.linspace(-0.5, 0.5, 89), line))
    assert len(x) == count
    return x[:, 1]


def run(case: Case) -> None:
    """Judge points and layers; plot compression and micro-rotation."""
    fig, (left, right) = case.figure(ncols=2)
    for n, mark in ((0.3, "o"), (0.5, "s"), (0.8, "^")):
        judge_path(case, n, 3)
        judge_path(case, n, 30)
        found = judge_compression(case, n)
        v = -3 * found["gamma 11"]
        left.plot(100 * v, compressed(v, n) / 1e3, "k-", lw=1)
        left.plot(100 * v, -found["sigma 22"] / 1e3, mark, mfc="none", label=f"Talus, n = {n}")
    judge_circuit(case)
    make_layer(case)
    low, high = judge_layer(case, 2.5e4), judge_layer(case, 1.0e5)
    ratio = float(high["force"][0] / low["force"][0])
    case.metric("shear stress of four times the pressure / twice", ratio / 2, 1.0, 1e-5)
    y = np.linspace(-0.5, 0.5, 401)
    tau = 1.5 * MU * U / H / (1.0 - 0.5 * WIDTH / H * np.tanh(H / (2 * WIDTH)))
    right.plot(1e6 * turned(y, tau), y, "k-", lw=1, label="exact, both pressures")
    for fields, mark, text in ((low, "s", "25 kPa"), (high, "+", "100 kPa")):
        right.plot(1e6 * fields["phi"][::8, 2], fields["y"][::8], mark, mfc="none", label=text)
    left.set(xlabel="compression [%]", ylabel="mean stress p [kPa]")
    right.set(xlabel="micro-rotation [µrad]", ylabel="y [m]")
    left.legend()
    right.legend()
    case.save(fig)
