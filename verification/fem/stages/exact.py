"""A ring in stages: excavation, lining, plastic zone, restart."""

import shutil

import numpy as np
from solid import save, shape_of

from talus.compare import max_of, same_arrays
from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

YOUNG, POISSON, PRESSURE = 1.0e9, 0.3, 1.0e6
RADII = (0.5, 0.75, 1.0, 4.0)
COHESION = 0.4e6
ELASTIC = f"law = 'linear_elastic', density = 1.0, young = {YOUNG}, poisson = {POISSON}"
POLAR = (
    f"law = 'micropolar', density = 1.0, young = {YOUNG}, poisson = {POISSON}, l_t = 1.0e-4, "
    "l_b = 1.0e-4, coupling = 0.3, polar_ratio = 1.0"
)
PLASTIC = (
    f"law = 'drucker_prager', density = 1.0, young = {YOUNG}, poisson = 0.45, "
    f"cohesion = {COHESION}, friction_deg = 0.0, cone = 'plane_strain'"
)
TWO = (
    "&stage group = 'inner', time = 1.0, duration = 1.0 /\n"
    "&stage group = 'middle', time = 2.0, duration = 1.0 /\n"
)
ONE = TWO.replace("time = 2.0", "time = 1.0")
OVERLAPPED = TWO.replace("time = 2.0", "time = 1.6")  # before the first release is over
LINING = (
    "&stage group = 'inner', action = 'place', time = 10.0, duration = 1.0 /\n"
    "&stage group = 'middle', action = 'place', time = 1.0, duration = 0.5 /\n"
)


def write_ring(case: Case, kind: str, fine: int) -> Mesh:
    """Write a quarter ring, one element thick."""
    parts = [
        np.linspace(RADII[0], RADII[2], 4 * fine + 1),
        np.geomspace(RADII[2], RADII[3], 10 * fine + 1)[1:],
    ]
    radius = np.concatenate(parts)
    line = np.arange(len(radius), dtype=float)
    s, hex8 = structured((line, np.linspace(0.0, 1.0, 6 * fine + 1), np.array([0.0, 1.0])))
    middle = np.interp(s[hex8].mean(1)[:, 0], line, radius)
    edges = {"inner": (0.0, RADII[1]), "middle": (RADII[1], RADII[2]), "rock": (RADII[2], 9.0)}
    groups = {k: np.flatnonzero((middle > a) & (middle < b)) for k, (a, b) in edges.items()}
    mesh = Mesh(s, hex8, groups | {"all": np.arange(len(hex8))})
    for name, at in (("in", 0.0), ("out", line[-1])):
        faces = [q for _, q in boundary_faces(hex8).values() if np.isclose(s[q][:, 0], at).all()]
        mesh.facets[name] = np.array(faces)
    mesh = converted(mesh, kind)
    s = mesh.x
    mesh.nodes["y0"] = np.flatnonzero(np.isclose(s[:, 1], 0.0))
    mesh.nodes["x0"] = np.flatnonzero(np.isclose(s[:, 1], 1.0))
    mesh.nodes["flat"] = np.arange(len(s))
    angle, r = 0.5 * np.pi * s[:, 1], np.interp(s[:, 0], line, radius)
    mesh.x = np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.1 * s[:, 2]])
    save(mesh, case.folder / f"{kind}.h5")
    return mesh


def solve(case: Case, stem: str, law: str, stages: str, **words: str) -> dict[str, np.ndarray]:
    """Run a way of building; return radii, displacements of the steps, stress of the points."""
    element = "hex20/hex8" if law == POLAR else "hex20"
    if law == PLASTIC:
        element = "hex8_bbar"
    kind = shape_of(element)
    mesh = write_ring(case, kind, 3 if kind == "hex8" else 1)
    text = (case.folder / "deck.nml").read_text()
    words = {
        "CURVE": "",
        "STRESSED": "all",
        "VALUE": "-1.0e6, -1.0e6, -1.0e6",
        "dt = 0.25": "dt = 0.25",
    } | words
    for word, value in (
        {"LAW": law, "ELEMENT": element, "STAGES": stages, "KIND": kind} | words
    ).items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    return look(case, stem, mesh.x)


def look(case: Case, stem: str, x: np.ndarray) -> dict[str, np.ndarray]:
    """Read the last fields and the ledger."""
    r = np.hypot(x[:, 0], x[:, 1])
    steps = field_steps(case.folder / f"{stem}.h5")
    energy = read_history(case.folder / f"{stem}_energy.csv")
    points, stress = (steps[-1].solid[k] for k in ("points_x", "stress_points"))
    at = np.hypot(points[:, 0], points[:, 1])
    c, s = points[:, 0] / at, points[:, 1] / at
    if stress.shape[1] == 9:
        stress = stress[:, [0, 4, 8, 1, 5, 2]]
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    return {
        "r": r,
        "u": np.array([(t.solid["u"][:, :2] * x[:, :2]).sum(1) / r for t in steps]),
        "at": at,
        "radial": stress[:, 0] * c**2 + stress[:, 1] * s**2 + 2 * stress[:, 3] * s * c,
        "active": steps[-1].solid["active"],
        "ledger": float(abs(energy["closure"]).max() / largest),
    }


def wall(r: np.ndarray, a: float, young: float, poisson: float, p: float) -> np.ndarray:
    """Radial displacement under a pressure on the wall [m]."""
    b = RADII[3]
    return (1 + poisson) / young * p * a**2 / (b**2 - a**2) * ((1 - 2 * poisson) * r + b**2 / r)


def outside(r: np.ndarray, a: float, p: float) -> np.ndarray:
    """Radial displacement under a pressure on the outside [m]."""
    b = RADII[3]
    part = (1 + POISSON) / YOUNG * p * b**2 / (b**2 - a**2)
    return -part * ((1 - 2 * POISSON) * r + a**2 / r)


def judge_excavation(case: Case) -> dict[str, np.ndarray]:
    """Judge Lame's ring, and that the way to it does not matter."""
    ways = {
        "two stages": solve(case, "two", ELASTIC, TWO),
        "at once": solve(case, "one", ELASTIC, ONE),
        "overlapped, four steps": solve(
            case, "lap", ELASTIC, OVERLAPPED, **{"dt = 0.25": "dt = 1.0"}
        ),
        "micropolar": solve(case, "polar", POLAR, TWO),
    }
    first = ways["two stages"]
    stays = first["r"] > RADII[2] - 1e-9
    wanted = wall(first["r"], RADII[2], YOUNG, POISSON, -PRESSURE)
    for name, found in ways.items():
        off = abs(found["u"][-1] - wanted)[stays].max() / abs(wanted[stays]).max()
        case.below(f"{name}: displacement, error / largest", float(off), 1e-3)
        case.below(f"{name}: ledger, error / largest", found["ledger"], 1e-9)
        if name != "micropolar":
            off = abs(found["u"][-1] - first["u"][-1])[stays].max() / abs(wanted[stays]).max()
            case.below(f"{name}: displacement, off that of two stages", float(off), 1e-9)
    case.metric("two stages: elements left", float(first["active"].sum()), 60.0, 0.0)
    return first


def judge_lining(case: Case) -> None:
    """Judge what comes without stress, and what it carries."""
    found = solve(case, "lining", ELASTIC, LINING, STRESSED="rock", CURVE=", curve = 'more'",
                  **{"VALUE": "0.0, 0.0, 0.0"})  # fmt: skip
    stays = found["r"] > RADII[2] - 1e-9
    before = found["u"][2] - found["u"][0]
    after = found["u"][-1] - found["u"][2]
    largest = abs(after[stays]).max()
    wanted = outside(found["r"], RADII[1], 0.5 * PRESSURE)
    off = abs(after - wanted)[found["r"] > RADII[1] - 1e-9].max() / largest
    case.below("lining: displacement after it came, error / largest", float(off), 1e-3)
    case.below("lining: what its coming moves / largest", float(abs(before)[stays].max() / largest),
               1e-9)  # fmt: skip
    case.below("lining: ledger, error / largest", found["ledger"], 1e-9)
    lined = (found["at"] > RADII[1]) & (found["at"] < RADII[2])
    a, b = RADII[1], RADII[3]
    exact = -0.5 * PRESSURE * b**2 / (b**2 - a**2) * (1 - a**2 / found["at"][lined] ** 2)
    off = abs(found["radial"][lined] - exact).max() / (0.5 * PRESSURE)
    case.below("lining: radial stress in it, error / pressure", float(off), 1e-2)


def judge_plastic(case: Case) -> dict[str, np.ndarray]:
    """Judge the plastic zone."""
    found = solve(case, "plastic", PLASTIC, TWO)
    low, high = RADII[2], RADII[3]
    for _ in range(100):
        zone = 0.5 * (low + high)
        load = 2 * COHESION * np.log(zone) + COHESION * (1 - zone**2 / RADII[3] ** 2)
        low, high = (zone, high) if load < PRESSURE else (low, zone)
    inside = (found["at"] > RADII[2]) & (found["at"] < zone)
    off = abs(found["radial"] + 2 * COHESION * np.log(found["at"]))[inside].max() / PRESSURE
    case.below("plastic: radial stress in the zone, error / pressure", float(off), 0.02)
    case.above("plastic: points in the zone", float(inside.sum()), 100.0)
    case.below("plastic: ledger, error / largest", found["ledger"], 1e-9)
    return found | {"zone": np.array([zone])}


def judge_restart(case: Case, stem: str) -> None:
    """Judge that a run from a checkpoint in the midst of a release repeats every bit."""
    whole = field_steps(case.folder / f"{stem}.h5")
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{stem}_*.csv")}
    shutil.copy(case.folder / f"{stem}.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.chk.h5")
    again = field_steps(case.folder / f"{stem}.h5")
    same = len(whole) == len(again) and all(p.read_bytes() == d for p, d in kept.items())
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    case.metric(f"{stem}: restart repeats every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge all; plot the radial stress."""
    elastic = judge_excavation(case)
    judge_lining(case)
    plastic = judge_plastic(case)
    judge_restart(case, "plastic")
    fig, ax = case.figure()
    line = np.geomspace(RADII[2], RADII[3], 200)
    b = RADII[3]
    lame = -PRESSURE * (b**2 - b**2 / line**2) / (b**2 - 1)
    ax.plot(line, lame / 1e6, "k-", lw=1, label="Lamé")
    zone = np.geomspace(RADII[2], float(plastic["zone"][0]), 50)
    ax.plot(zone, -2 * COHESION * np.log(zone) / 1e6, "k--", lw=1, label="Hill, plastic zone")
    for found, mark, label in ((elastic, "o", "elastic"), (plastic, "s", "plastic")):
        stays = found["at"] > RADII[2]
        ax.plot(found["at"][stays][::9], found["radial"][stays][::9] / 1e6, mark, ms=4, mfc="none",
                label=label)  # fmt: skip
    ax.set(xlabel="radius [m]", ylabel="radial stress [MPa]")
    ax.legend()
    case.save(fig)
