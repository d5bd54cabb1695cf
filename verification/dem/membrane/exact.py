"""Membranes of triangles: a balloon, a strip that sags, a grain that slides, a hammock, a tear."""

from pathlib import Path

import h5py
import numpy as np

from talus.verification import Case, read_history, write_packing

BALL = 1.5e-3  # radius of the grains [m]
BALLOON, YOUNG, THICK, NU, PUSH = 0.02, 1.0e6, 1.0e-3, 0.3, 50.0
LEVELS = [1, 2, 3]
SPAN, LONG, LOAD = 0.02, 0.06, 2000.0  # strip: width, length [m], pressure [Pa]
STEPS = [8.0e-7, 4.0e-7, 2.0e-7]  # of the sliding grain [s]
FAR = 1.0  # [m], where a grain is that has no part
ROUNDING = 1e-11  # of sums of the ranks' parts, which go on in another order after a restart
DECK = """&run title = 'Membrane', t_end = {end}{more} /
&membrane id = 'skin', file = '{name}.stl', material = 'rubber', young = {young}, poisson = {nu},
  thickness = {thick}, density = 1000.0, pressure = {push}, inside = 0.0, 0.0, {inside},
  damping = {damping}, stretch_limit = {limit} /
&dynamics dt = {dt} /
"""
SHEET = {"more": "", "young": YOUNG, "nu": NU, "thick": THICK, "damping": 0.0, "limit": 3.0}


def run(case: Case) -> None:
    """Balloon and strip against closed forms; energy, threads, restart; a tear."""
    growth = [balloon(case, level) for level in LEVELS]
    exact = PUSH * BALLOON * (1.0 - NU) / (2.0 * YOUNG * THICK)
    error = np.abs(np.array(growth) / exact - 1.0)
    case.below("growth of the balloon / thin shell, error", float(error[-1]), 2e-2)
    case.metric("order of the growth", float(np.log2(error[-2] / error[-1])), 2.0, 0.5)
    profile = strip(case)
    losses = slide(case)
    hammock(case)
    tear(case)
    draw(case, growth, exact, profile, losses)


def go(case: Case, name: str, text: str, x: np.ndarray, *options: str, expect: int = 0) -> str:
    """Run a deck of the common head and its own text; return what it said."""
    write_packing(case.folder / f"{name}_pack.h5", x, np.full((len(x), 3), BALL))
    head = (case.folder / "deck.nml").read_text().replace("NAME", name)
    (case.folder / f"{name}.nml").write_text(head + text)
    done = case.run("talus-dem", f"{name}.nml", "--threads=1", *options, expect=expect)
    return done.stdout + done.stderr


def write_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles as binary STL."""
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corner"] = triangles
    path.write_bytes(b"skin".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def sphere(level: int) -> np.ndarray:
    """Triangles of an octahedron refined `level` times, corners on the sphere."""
    tips = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    sides = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    triangles = tips[sides]
    for _ in range(level):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (p + q for p, q in ((a, b), (b, c), (c, a)))
        ab, bc, ca = (p / np.linalg.norm(p, axis=1, keepdims=True) for p in (ab, bc, ca))
        triangles = np.concatenate(
            [np.stack(part, 1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return BALLOON * triangles


def sheet(sides: tuple[int, int], size: tuple[float, float], odd: float, bump: float) -> np.ndarray:
    """Triangles of a rectangle around the origin; odd: corners move by that part of an edge."""
    along = [s * np.linspace(-0.5, 0.5, n + 1) for n, s in zip(sides, size, strict=True)]
    node = np.stack(np.meshgrid(*along, indexing="ij"), -1)
    move = np.random.default_rng(0).uniform(-odd, odd, node.shape)
    move[[0, -1]] = move[:, [0, -1]] = 0.0
    high = bump * np.prod(np.cos(np.pi * node / np.array(size)), -1)
    node = np.concatenate([node + move * np.array(size) / np.array(sides), high[:, :, None]], 2)
    a, b, c, d = node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]
    return np.concatenate([np.stack([a, b, d], 2), np.stack([a, d, c], 2)]).reshape(-1, 3, 3)


def shapes(path: Path) -> tuple[list[np.ndarray], np.ndarray]:
    """Corners of the membrane in all steps, and its triangles."""
    with h5py.File(path) as file:
        steps = [file["steps"][name]["surfaces"] for name in sorted(file["steps"])]
        return [step["x"][...] for step in steps], steps[0]["triangles"][...]


def balloon(case: Case, level: int) -> float:
    """Blow up a balloon; return the growth of its radius."""
    name = f"balloon_{level}"
    write_stl(case.folder / f"{name}.stl", sphere(level))
    text = DECK.format(**SHEET | {"end": 0.04, "name": name, "push": -PUSH, "inside": 0.0,
                                  "damping": 400.0, "dt": 1.0e-4 / 2**level})  # fmt: skip
    go(case, name, text + "&output every_time = 0.04 /\n", np.full((1, 3), FAR))
    x, corner = shapes(case.folder / f"{name}.h5")
    volume = [abs(np.einsum("ij,ij->i", p[corner][:, 0], np.cross(p[corner][:, 1],
              p[corner][:, 2])).sum()) for p in (x[0], x[-1])]  # fmt: skip
    return float((volume[1] / volume[0]) ** (1.0 / 3.0) - 1.0)


def sag() -> tuple[float, float]:
    """Sag and radius of a long strip: an arc with T = p R, T = K l (l^2 - 1)/2, stretch l."""
    modulus = YOUNG * THICK / (1.0 - NU**2)
    low, high = 1e-6, 1.5
    for _ in range(200):
        half = 0.5 * (low + high)  # angle of the arc [rad]
        stretch, radius = half / np.sin(half), SPAN / (2.0 * np.sin(half))
        lacks = modulus * stretch * (stretch**2 - 1.0) / 2.0 < LOAD * radius
        low, high = (half, high) if lacks else (low, half)
    return float(radius * (1.0 - np.cos(half))), float(radius)


def strip(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Load a long strip that is held all around; return its profile half-way."""
    write_stl(case.folder / "strip.stl", sheet((16, 24), (SPAN, LONG), 0.0, 0.0))
    text = DECK.format(**SHEET | {"end": 0.04, "name": "strip", "push": LOAD, "inside": -1.0,
                                  "damping": 500.0, "dt": 1.0e-5})  # fmt: skip
    go(case, "strip", text + "&output every_time = 0.04 /\n", np.full((1, 3), FAR))
    x, _ = shapes(case.folder / "strip.h5")
    middle = np.abs(x[0][:, 1]) < 1e-6
    order = np.argsort(x[0][middle, 0])
    profile = x[-1][middle][order]
    depth, radius = sag()
    case.metric("sag of the strip / arc", float(-profile[:, 2].min() / depth), 1.0, 0.01)
    centre = radius - depth
    off = np.hypot(profile[:, 0], profile[:, 2] - centre) / radius - 1.0
    case.below("strip off its arc, over the radius", float(np.abs(off).max()), 2e-3)
    return profile[:, 0], profile[:, 2]


def slide(case: Case) -> dict[str, list[float]]:
    """Throw a grain onto a bent sheet of odd triangles: energy that nobody has paid for."""
    write_stl(case.folder / "slide.stl", sheet((12, 12), (0.012, 0.012), 0.2, 0.0))
    losses = {}
    for title, friction in (("smooth", 0.0), ("rough", 0.5)):
        losses[title] = []
        for k, step in enumerate(STEPS):
            name = f"slide_{title}_{k}"
            (case.folder / f"{name}.stl").write_bytes((case.folder / "slide.stl").read_bytes())
            write_packing(case.folder / f"{name}_pack.h5", np.array([[-2.5e-3, -1.2e-3, 1.53e-3]]),
                          np.full((1, 3), BALL), v=np.array([[0.3, 0.17, -0.2]]))  # fmt: skip
            text = DECK.format(**SHEET | {"end": 0.012, "name": name, "push": 500.0, "inside": 1.0,
                                          "young": 2.0e5, "thick": 3.0e-4, "dt": step})  # fmt: skip
            head = (case.folder / "deck.nml").read_text().replace("NAME", name)
            head = head.replace("friction = 0.2, damping_ratio = 0.3",
                                f"friction = {friction}, damping_ratio = 0.0")  # fmt: skip
            (case.folder / f"{name}.nml").write_text(head + text + "&history every_time = 1e-4 /\n")
            case.run("talus-dem", f"{name}.nml", "--threads=1")
            energy = read_history(case.folder / f"{name}_energy.csv")
            losses[title].append(float(energy["relative_closure"].max()))
            if k == 0:
                most = float(energy["contacts"].max())
                case.above(f"{title} grain, most contacts at once", most, 3.0)
        case.below(f"{title} grain, ledger", losses[title][0], 1e-4)
    order = np.log2(losses["smooth"][-2] / losses["smooth"][-1])
    case.metric("smooth grain, order of the ledger's error", float(order), 2.0, 0.3)
    return losses


def hammock(case: Case) -> None:
    """Let grains fall into a sheet under a pressure that rises: ledger, threads, restart."""
    write_stl(case.folder / "hammock.stl", sheet((14, 14), (0.02, 0.02), 0.2, -3.0e-3))
    side = 3.2e-3 * np.arange(-1, 2)
    x = np.stack(np.meshgrid(side, side, [1.0e-3, 4.2e-3, 7.4e-3], indexing="ij"), -1)
    x = x.reshape(-1, 3)
    x += np.random.default_rng(3).uniform(-0.1e-3, 0.1e-3, x.shape)
    text = DECK.format(**SHEET | {"end": 0.008, "name": "hammock", "push": 200.0, "inside": 1.0,
                                  "young": 5.0e5, "thick": 3.0e-4, "dt": 5.0e-7, "damping": 20.0,
                                  "limit": "3.0, curve = 'rise'",
                                  "more": ", gravity = 0.0, 0.0, -50.0"})  # fmt: skip
    text += "&curve id = 'rise', times = 0.0, 0.008, values = 0.5, 1.5 /\n"
    text += "&history every_time = 1e-4 /\n&checkpoint every_time = 0.003, keep = 9 /\n"
    go(case, "hammock", text, x)
    energy = read_history(case.folder / "hammock_energy.csv")
    case.below("grains in a hammock, ledger", float(energy["relative_closure"].max()), 1e-4)
    case.above("grains in a hammock, friction / all energy", float(
        energy["friction"][-1] / abs(energy["gravity"][-1])), 0.02)  # fmt: skip
    kept = {n: (case.folder / n).read_text() for n in ("hammock_energy.csv",
                                                       "hammock_surfaces.csv")}  # fmt: skip
    for title, option in (("restart", "--restart=hammock.chk.2.h5"), ("two threads", "")):
        threads = "--threads=1" if option else "--threads=2"
        case.run("talus-dem", "hammock.nml", threads, *([option] if option else []))
        case.same_histories(title, kept, ROUNDING)


def tear(case: Case) -> None:
    """Blow until the balloon tears: exit 2, N207."""
    write_stl(case.folder / "tear.stl", sphere(1))
    text = DECK.format(**SHEET | {"end": 0.05, "name": "tear", "push": -1000.0 * PUSH,
                                  "inside": 0.0, "dt": 1.0e-5, "limit": 1.2})  # fmt: skip
    said = go(case, "tear", text, np.full((1, 3), FAR), expect=2)
    case.metric("a balloon blown too far tears (N207)", float("N207" in said), 1.0, 0.0)


def draw(case: Case, growth: list[float], exact: float, profile: tuple, losses: dict) -> None:
    """Growth of the balloon, profile of the strip, errors of the ledger over the step."""
    fig, (left, middle, right) = case.figure(ncols=3, figsize=(11.5, 3.4))
    left.semilogx([8 * 4**level for level in LEVELS], 1e4 * np.array(growth), "o", label="balloon")
    left.axhline(1e4 * exact, color="black", lw=0.8, label="thin shell")
    left.set(xlabel="triangles [-]", ylabel="growth of the radius [1e-4]")
    left.legend(fontsize=8)
    depth, radius = sag()
    fine = np.linspace(-0.5, 0.5, 101) * SPAN
    arc = radius - depth - np.sqrt(radius**2 - fine**2)
    middle.plot(1e3 * fine, 1e3 * arc, "k-", lw=0.8, label="arc, T = p R")
    middle.plot(1e3 * profile[0], 1e3 * profile[1], "o", ms=4, label="strip")
    middle.set(xlabel="x [mm]", ylabel="z [mm]")
    middle.legend(fontsize=8)
    for mark, (title, values) in zip("os", losses.items(), strict=True):
        right.loglog(1e6 * np.array(STEPS), values, mark, label=f"{title} grain")
    right.loglog(1e6 * np.array(STEPS), losses["smooth"][0] * (np.array(STEPS) / STEPS[0]) ** 2,
                 "k-", lw=0.8, label="order 2")  # fmt: skip
    right.set(xlabel="step [us]", ylabel="relative closure of the ledger [-]")
    right.legend(fontsize=8)
    case.save(fig)
