"""Forces of ellipsoids on planes, triangles and each other against Hertz's exact theory."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

AXES = np.array([3.0e-3, 2.0e-3, 1.2e-3])
E_STAR = 1.0e9 / (2 * (1 - 0.25**2))
DEPTH = 1.0e-6
WALL = "&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'soft' /\n"
FLOOR = """&surface id = 'floor', material = 'soft',
         rectangle = -0.011, -0.012, 0.0, 0.011, -0.012, 0.0, 0.011, 0.013, 0.0 /\n"""


def integrals(axis: float) -> tuple[float, float, float]:
    """Complete elliptic integrals K, E and (K - E)/m, m = 1 - axis^2, by the trapezoidal rule."""
    m, count = 1 - axis**2, 4000
    s = np.sin(0.25 * np.pi * (2 * np.arange(1, count + 1) - 1) / count) ** 2
    root = np.sqrt(1 - m * s)
    return tuple(0.5 * np.pi * float(f.mean()) for f in (1 / root, root, s / root))


def hertz(steep: float, flat: float) -> float:
    """Force [N] at DEPTH of a contact with these principal relative curvatures [1/m]."""
    low, high = 1e-6, 1.0
    for _ in range(200):
        axis = 0.5 * (low + high)
        k, e, d = integrals(axis)
        if (k - d) / (axis**2 * d) > steep / flat:
            low = axis
        else:
            high = axis
    # delta = 3 F K/(2 pi a E*), a^3 (b/a)^2 = 3 F E/(pi E* (k1 + k2))
    k, e, d = integrals(axis)
    return 2 * np.pi * E_STAR / 3 * np.sqrt(2 * e / ((steep + flat) * k**3)) / axis * DEPTH**1.5


def frame(quat: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion w, x, y, z, body to space."""
    w, x, y, z = quat
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def surface(quat: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the point with outward normal n and the radii of curvature (3, 3) there [m]."""
    turn = frame(quat)
    a = turn @ np.diag(AXES**2) @ turn.T
    h = np.sqrt(n @ a @ n)
    u = a @ n / h
    return u, (a - np.outer(u, u)) / h


def curvatures(*radii: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Principal relative curvatures, ascending [1/m]."""
    other = np.linalg.svd(n[None, :])[2][1:]
    return np.linalg.eigvalsh(sum(np.linalg.inv(other @ k @ other.T) for k in radii))


def force(case: Case, name: str, area: str, x: list, quat: list, under: str) -> float:
    """Return the force on the last grain at the start [N]."""
    deck = (case.folder / "deck.nml").read_text() + under
    values = {"AREA": area, "END": "1.0e-9", "STEP": "1.0e-9"}
    for word, value in values.items():
        deck = deck.replace(word, value)
    (case.folder / f"{name}.nml").write_text(deck)
    n = len(x)
    write_packing(
        case.folder / "pack.h5", np.array(x), np.tile(AXES, (n, 1)), quat=np.array(quat),
        kind=np.array([1, 0][-n:]),
    )  # fmt: skip
    case.run("talus-dem", f"{name}.nml")
    return float(np.linalg.norm(field_steps(case.folder / f"{name}.h5")[0].grains["force"][-1]))


def poses(case: Case, ax: object) -> None:
    """Judge forces of turned ellipsoids."""
    rng = np.random.default_rng(7)
    up = np.array([0.0, 0.0, 1.0])
    worst = {"plane": 0.0, "triangles": 0.0, "pair": 0.0}
    slim, ratios = [], []
    for k in range(5):
        q = rng.normal(size=(2, 4))
        q /= np.linalg.norm(q, axis=1)[:, None]
        u, radii = surface(q[1], -up)
        place = [0.0, 0.0, -u[2] - DEPTH]
        flat, steep = curvatures(radii, n=up)
        wanted = hertz(steep, flat)
        for name, under in (("plane", WALL), ("triangles", FLOOR)):
            found = force(case, f"{name}_{k}", "ellipse", [place], [q[1]], under)
            worst[name] = max_of(worst[name], abs(found / wanted - 1))
        slim.append(steep / flat)
        ratios.append(wanted / force(case, f"circle_{k}", "circle", [place], [q[1]], WALL))
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        u, first = surface(q[0], n)
        v, second = surface(q[1], -n)
        flat, steep = curvatures(first, second, n=n)
        places = [np.zeros(3), u - v - DEPTH * n]
        found = force(case, f"pair_{k}", "ellipse", places, list(q), "")
        worst["pair"] = max_of(worst["pair"], abs(found / hertz(steep, flat) - 1))
    for name, off in worst.items():
        case.below(f"{name}: largest error of the force", off, 1e-8)
    fine = np.linspace(1.0, 1.05 * max(slim), 60)
    circle = 4 / 3 * E_STAR * DEPTH**1.5
    exact = [hertz(2 * r / (1 + r), 2 / (1 + r)) / circle for r in fine]
    ax.plot(fine, exact, "-", label="exact")
    ax.plot(slim, ratios, "o", label="Talus, ellipsoids on a plane")
    ax.set(xlabel="ratio of principal curvatures", ylabel="force / that of the circle")
    ax.legend()


def circles(case: Case) -> None:
    """Judge crossed ellipsoids, whose area is a circle."""
    half = np.sqrt(0.5)
    quat = [[1.0, 0.0, 0.0, 0.0], [half, 0.0, 0.0, half]]
    places = [np.zeros(3), np.array([0.0, 0.0, 2 * AXES[2] - DEPTH])]
    found = [force(case, f"crossed_{a}", a, places, quat, "") for a in ("circle", "ellipse")]
    case.metric("crossed: force / that of the circle", found[1] / found[0], 1.0, 1e-14)


def impact(case: Case, ax: object) -> None:
    """Judge the ledger of an ellipsoid that hits the plane askew."""
    quat = np.array([[0.8, 0.5, 0.3, np.sqrt(1 - 0.98)]])
    u, _ = surface(quat[0], np.array([0.0, 0.0, -1.0]))
    turned = {}
    for area in ("ellipse", "circle"):
        deck = (case.folder / "deck.nml").read_text() + WALL
        values = {"AREA": area, "END": "1.5e-4", "STEP": "1.0e-8"}
        for word, value in values.items():
            deck = deck.replace(word, value)
        (case.folder / f"impact_{area}.nml").write_text(
            deck.replace("history   every_time = 1.5e-4", "history   every_time = 1.0e-6")
        )
        write_packing(
            case.folder / "pack.h5", np.array([[0.0, 0.0, -u[2] + 1e-9]]), AXES[None, :],
            quat=quat, v=np.array([[0.0, 0.0, -1.0]]),
        )  # fmt: skip
        case.run("talus-dem", f"impact_{area}.nml")
        rows = read_history(case.folder / f"impact_{area}_energy.csv")
        turned[area] = rows
        first = rows["kinetic"][0]
        case.below(f"impact, {area}: closure / first energy",
                   np.abs(rows["closure_error"]).max() / first, 1e-6)  # fmt: skip
        case.above(f"impact, {area}: curvature work / first energy",
                   np.abs(rows["curvature"]).max() / first, 1e-4)  # fmt: skip
        ax.plot(rows["time"] * 1e6, rows["elastic"] / first, "-", label=area)
    ax.set(xlabel="time [us]", ylabel="elastic / first energy")
    ax.legend()


def run(case: Case) -> None:
    """Judge forces, circles and an impact; plot force ratios and energies."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    poses(case, axes[0])
    circles(case)
    impact(case, axes[1])
    case.save(fig)
