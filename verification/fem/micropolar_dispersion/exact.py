"""Branches of the dispersion relation: modes, an explicit and an implicit run."""

import numpy as np
from solid import save

from talus.compare import max_of
from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, read_history

LAMBDA, MU, KAPPA, GAMMA, RHO, J, L = 7.59e9, 1.89e9, 0.0149e9, 2.63e3, 2190.0, 0.196e-6, 0.01
CELLS = 24
EVERYWHERE = "&support  group = 'all', fix = {} /\n&support  group = 'ends', fix = '{}' /\n"
SHEAR = EVERYWHERE.format("'x', 'z', 'rx', 'ry'", "y")


def transverse(k: float, j: float = J) -> tuple[float, float]:
    """Acoustic and optical frequency [rad/s] at wave number k [1/m]."""
    a = (MU + KAPPA) / RHO * k * k
    b = 2 * KAPPA / (RHO * j) + GAMMA / (RHO * j) * k * k
    c = KAPPA**2 * k * k / (RHO**2 * j)
    root = np.sqrt((a - b) ** 2 / 4 + c)
    return float(np.sqrt((a + b) / 2 - root)), float(np.sqrt((a + b) / 2 + root))


def write(case: Case, name: str, supports: str, analysis: str, end: float = 0.0) -> None:
    """Write a deck."""
    text = (case.folder / "deck.nml").read_text().replace("SUPPORTS", supports)
    text = text.replace("ANALYSIS", analysis).replace("END", f", t_end = {end!r}" if end else "")
    (case.folder / f"{name}.nml").write_text(text)


def modes(case: Case, name: str, supports: str, count: int) -> np.ndarray:
    """Circular frequencies of the lowest modes."""
    write(case, name, supports, f"kind = 'modal', modes = {count}")
    case.run("talus-fem", f"{name}.nml")
    return read_history(case.folder / f"{name}_modes.csv")["omega"]


def judge_branch(
    case: Case, name: str, found: np.ndarray, wanted: list[tuple[float, float]]
) -> list:
    """Match each exact frequency with the nearest mode; return (k, frequency found)."""
    nearest = [(k, float(found[abs(found / w - 1).argmin()])) for k, w in wanted]
    errors = [(k, abs(f / w - 1)) for (k, w), (_, f) in zip(wanted, nearest, strict=True)]
    fine = [e for k, e in errors if k * L / CELLS <= 0.15]
    case.below(f"{name}: largest error for k h <= 0.15", max_of(fine), 1e-3)
    if "optical" in name:
        worst = max_of(e / (k * L / CELLS) ** 2 for k, e in errors)
        case.below(f"{name}: largest error / (k h)^2", worst, 0.05, "linear interpolation: 1/24")
    else:
        case.below(f"{name}: largest error", max_of(e for _, e in errors), 5e-3)
    return nearest


def fitted(t: np.ndarray, y: np.ndarray, omega: tuple[float, float]) -> np.ndarray:
    """Frequencies of c0 + sum a_i cos w_i t + b_i sin w_i t that fit best, by Gauss-Newton."""
    w = np.array(omega)
    for _ in range(40):
        base = [np.ones_like(t)]
        for v in w:
            base += [np.cos(v * t), np.sin(v * t)]
        a = np.linalg.lstsq(np.array(base).T, y, rcond=None)[0]
        slopes = [
            t * (-a[1 + 2 * i] * np.sin(v * t) + a[2 + 2 * i] * np.cos(v * t))
            for i, v in enumerate(w)
        ]
        full = np.array(base + slopes).T
        step = np.linalg.lstsq(full, y - np.array(base).T @ a, rcond=None)[0][-len(w) :]
        w = w + step
        if np.all(abs(step) < 1e-9 * w):
            break
    return w


def run_in_time(case: Case, name: str, analysis: str, mesh: object, wanted: tuple) -> None:
    """Let go of a load of the first mode's shape; fit both frequencies to the reaction."""
    lines = SHEAR
    for n in np.flatnonzero(np.isclose(mesh.x[:, 1], 0.0) & np.isclose(mesh.x[:, 2], 0.0)):
        force = float(np.sin(np.pi * mesh.x[n, 0] / L))
        if abs(force) > 1e-9:
            lines += f"&point_load node = {n + 1}, force = 0.0, {force!r}, 0.0 /\n"
    write(case, name, lines + "&history every_time = 1.0e-7 /\n", analysis, 1.5e-4)
    case.run("talus-fem", f"{name}.nml")
    history = read_history(case.folder / f"{name}_reactions.csv")
    found = fitted(history["time"][1:], history["ends y"][1:], wanted)
    for label, f, w in zip(("acoustic", "optical"), found, wanted, strict=True):
        case.metric(f"{name}: {label} frequency / exact", float(f / w), 1.0, 2e-3)
    energy = read_history(case.folder / f"{name}_energy.csv")
    scale = max_of(abs(energy["load"]).max(), abs(energy["strain"]).max())
    case.below(
        f"{name}: ledger, error / largest", float(abs(energy["closure"]).max() / scale), 1e-9
    )


def run(case: Case) -> None:
    """Judge every branch, and the transverse pair in time."""
    h = L / CELLS
    mesh = converted(box(np.zeros(3), np.array([L, h, h]), (CELLS, 1, 1)), "hex20")
    mesh.nodes["ends"] = np.flatnonzero(np.isclose(mesh.x[:, 0], 0) | np.isclose(mesh.x[:, 0], L))
    save(mesh, case.folder / "column.h5")
    k = [n * np.pi / L for n in (1, 2, 3, 5, 8)]
    press = np.sqrt((LAMBDA + 2 * MU + KAPPA) / RHO)
    cut, twist = 2 * KAPPA / (RHO * J), GAMMA / (RHO * J)
    found = modes(case, "shear", SHEAR, 34)
    case.metric("uniform rotation / exact", float(abs(found / np.sqrt(cut) - 1).min()), 0.0, 1e-6)
    branches = {
        "TA": judge_branch(case, "transverse acoustic", found, [(v, transverse(v)[0]) for v in k]),
        "TO": judge_branch(case, "transverse optical", found, [(v, transverse(v)[1]) for v in k]),
    }
    found = modes(case, "press", EVERYWHERE.format("'y', 'z', 'rx', 'ry', 'rz'", "x"), 12)
    branches["LA"] = judge_branch(case, "longitudinal acoustic", found, [(v, press * v) for v in k])
    found = modes(case, "twist", EVERYWHERE.format("'x', 'y', 'z', 'ry', 'rz'", "rx"), 12)
    exact = [(v, float(np.sqrt(cut + twist * v * v))) for v in k]
    branches["LO"] = judge_branch(case, "longitudinal optical", found, exact)
    run_in_time(case, "explicit", "kind = 'explicit'", mesh, transverse(k[0]))
    run_in_time(case, "implicit", "kind = 'newmark', dt = 1.0e-7", mesh, transverse(k[0]))
    run_in_time(case, "slow_rotation", "kind = 'explicit', rotation_mass = 4.0", mesh,
                transverse(k[0], 4 * J))  # fmt: skip
    fig, ax = case.figure()
    grid = np.linspace(1.0, 9 * np.pi / L, 300)
    both = np.array([transverse(v) for v in grid])
    for curve in (both[:, 0], both[:, 1], press * grid, np.sqrt(cut + twist * grid**2)):
        ax.plot(grid / 1e3, curve / 1e6, "k-", lw=1)
    for mark, (name, found) in zip("os^v", branches.items(), strict=True):
        numbers, values = np.array(found).T
        ax.plot(numbers / 1e3, values / 1e6, mark, ms=5, mfc="none", label=name)
    ax.set(xlabel="wave number [1/mm]", ylabel="circular frequency [Mrad/s]")
    ax.legend()
    case.save(fig)
