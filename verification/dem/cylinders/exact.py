"""Grains on and in cylinders: overlaps, forces, rolling, a wheel, a bore under a servo."""

from pathlib import Path

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

G, YOUNG, NU, K = 9.81, 1.0e9, 0.25, 1.0e6
BORE, HALF, GRAIN = 10.0e-3, 6.0e-3, 2.0e-3
ELLIPSOID = np.array([2.5e-3, 2.0e-3, 1.2e-3])
LINEAR = f"law = 'linear', normal_stiffness = {K}, tangential_stiffness = {K}, friction = 0.0"
HERTZ = "law = 'hertz_mindlin', friction = FRICTION, damping_ratio = 0.1"
SIDES = [24, 48, 96, 192]
ROUNDING = 1.0e-7  # between histories on ranks, over the largest value of their unit


def run(case: Case) -> None:
    """Five parts, each with its own exact solution."""
    for inside in (False, True):
        overlaps(case, inside)
    hertz(case)
    prisms = converge(case)
    swing = pendulum(case)
    wheel(case)
    press = servo(case)
    draw(case, prisms, swing, press)


def go(
    case: Case,
    name: str,
    text: str,
    x: np.ndarray,
    axes: np.ndarray,
    law: str = LINEAR,
    quat: np.ndarray | None = None,
) -> None:
    """Run a deck of the common head and its own text."""
    write_packing(case.folder / f"{name}_pack.h5", x, np.broadcast_to(axes, x.shape), quat)
    head = (case.folder / "deck.nml").read_text().replace("NAME", name).replace("LAW", law)
    (case.folder / f"{name}.nml").write_text(head + text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")


def rotation(q: np.ndarray) -> np.ndarray:
    """Return the rotation of a unit quaternion (w, x, y, z)."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def depth(x: np.ndarray, turn: np.ndarray, inside: bool) -> float:
    """Overlap of an ellipsoid with a cylinder about z, by a search over the unit sphere [m].

    Inside: the deepest point of its surface. Outside: the least way apart over all directions.
    """
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 161), np.linspace(0.0, 2.0 * np.pi, 161))
    wide = np.sqrt(1.0 - u**2)
    unit = np.stack([wide * np.cos(v), wide * np.sin(v), u], -1)
    size = 0.1
    for _ in range(10):
        if inside:
            p = x + (unit * ELLIPSOID) @ turn.T
            deep = np.hypot(p[..., 0], p[..., 1]) - BORE
        else:
            across = np.hypot(unit[..., 0], unit[..., 1])
            support = np.linalg.norm((unit @ turn) * ELLIPSOID, axis=-1)
            deep = unit @ x - BORE * across - HALF * np.abs(unit[..., 2]) - support
        best = unit[np.unravel_index(deep.argmax(), deep.shape)]
        first = np.cross(best, np.eye(3)[np.abs(best).argmin()])
        first /= np.linalg.norm(first)
        a, b = np.meshgrid(*2 * [np.linspace(-size, size, 81)])
        unit = best + a[..., None] * first + b[..., None] * np.cross(best, first)
        unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
        size *= 0.1
    return float(deep.max() if inside else -deep.max())


def overlaps(case: Case, inside: bool) -> None:
    """Compare overlaps of turned ellipsoids with those of a search on their surfaces."""
    rng = np.random.default_rng(7)
    name, many = ("in", 40) if inside else ("on", 40)
    quat = rng.normal(size=(many, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    x = np.empty((many, 3))
    for k in range(many):
        turn = rotation(quat[k])
        x[k] = approach(rng, turn, inside, end=not inside and k >= many // 2)
    order = "inside" if inside else "outside"
    length = f"length = {2 * HALF}," if not inside else ""
    own = 0.1 * np.arange(many)[:, None] * np.array([1.0, 0.0, 0.0])  # each has its cylinder
    cylinders = "".join(
        f"&cylinder id = 'c{k}', side = '{order}', centre = {own[k, 0]}, 0.0, 0.0, "
        f"radius = {BORE}, {length} material = 'tool' /\n"
        for k in range(many)
    )
    go(case, name, f"""&run title = 'Ellipsoids', t_end = 1.0e-9 /
{cylinders}&dynamics dt = 1.0e-10 /
&limits initial_overlap = 1.0, overlap = 1.0 /


&output every_time = 1.0, fields = 'contacts' /
""", x + own, ELLIPSOID, LINEAR, quat)  # fmt: skip
    step = field_steps(case.folder / f"{name}.h5")[0]
    found = np.zeros(many)
    ids = step.contacts["ids"]
    of_tool = ids[:, 0] < 0
    found[ids[of_tool, 1] - 1] = step.contacts["overlap"][of_tool]
    exact = np.array([depth(x[k], rotation(quat[k]), inside) for k in range(many)])
    worst = np.abs(found - exact).max() / GRAIN
    case.metric(f"grains that touch, {order}", float((found > 0).sum()), float(many), 0.0)
    case.below(f"overlap {order}, error over the radius", float(worst), 1e-10)


def approach(rng: np.random.Generator, turn: np.ndarray, inside: bool, end: bool) -> np.ndarray:
    """Place an ellipsoid some tens of micrometres deep in the cylinder."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    out = np.array([np.cos(angle), np.sin(angle), 0.0])
    wanted = rng.uniform(0.01, 0.04) * GRAIN
    if end:
        start = out * rng.uniform(0.5, 1.05) * BORE
        way = np.array([0.0, 0.0, rng.choice([-1.0, 1.0])])
        near, far = HALF, HALF + 4.0 * GRAIN
    else:
        start = np.array([0.0, 0.0, rng.uniform(-0.9, 0.9) * HALF])
        way = out
        near, far = (BORE, BORE - 4.0 * GRAIN) if inside else (BORE, BORE + 4.0 * GRAIN)
    for _ in range(30):
        middle = 0.5 * (near + far)
        if depth_fast(start + middle * way, turn, inside) > wanted:
            near = middle
        else:
            far = middle
    return start + near * way


def depth_fast(x: np.ndarray, turn: np.ndarray, inside: bool) -> float:
    """Estimate of depth on a coarse grid of the surface [m]."""
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(0.0, 2.0 * np.pi, 81))
    wide = np.sqrt(1.0 - u**2)
    unit = np.stack([wide * np.cos(v), wide * np.sin(v), u], -1)
    p = x + (unit * ELLIPSOID) @ turn.T
    across = np.hypot(p[..., 0], p[..., 1])
    deep = across - BORE if inside else np.minimum(BORE - across, HALF - np.abs(p[..., 2]))
    return float(deep.max())


def hertz(case: Case) -> None:
    """Force on a ball that overlaps by 20 micrometres, against Hertz with 1/r +- 1/(2R)."""
    deep, smooth = 20.0e-6, HERTZ.replace("FRICTION", "0.0")
    for side, sign in (("outside", 1.0), ("inside", -1.0)):
        place = BORE + sign * (GRAIN - deep)
        go(case, f"hertz_{side}", f"""&run title = 'Ball', t_end = 1.0e-9 /
&cylinder id = 'cylinder', side = '{side}', centre = 0.0, 0.0, 0.0, radius = {BORE},
  material = 'tool' /
&dynamics dt = 1.0e-10 /
&history every_time = 1.0e-9 /
""", np.array([[place, 0.0, 0.0]]), np.full(3, GRAIN), smooth)  # fmt: skip
        force = read_history(case.folder / f"hertz_{side}_surfaces.csv")["force_x"][0]
        radius = 1.0 / (1.0 / GRAIN + sign * 0.5 / BORE)
        exact = 4.0 / 3.0 * YOUNG / (2.0 * (1.0 - NU**2)) * np.sqrt(radius) * deep**1.5
        case.metric(f"force {side} / Hertz", float(-sign * force / exact), 1.0, 1e-9)


def converge(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Overlap with prisms of more and more sides against that with the bore they approach."""
    ball, deep = 0.4e-3, 40.0e-6
    angle = 2.0 * np.pi * (np.arange(59) + 0.3) / 59
    x = (BORE - ball + deep) * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], -1)
    error = []
    for sides in SIDES:
        write_tube(case.folder / "tube.stl", sides)
        go(case, "tube", """&run title = 'Prism', t_end = 1.0e-9 /
&surface id = 'tube', file = 'tube.stl', material = 'tool' /
&dynamics dt = 1.0e-10 /
&limits initial_overlap = 1.0, overlap = 1.0 /
&output every_time = 1.0 /
""", x, np.full(3, ball))  # fmt: skip
        force = field_steps(case.folder / "tube.h5")[0].grains["force"]
        found = np.linalg.norm(force, axis=1) / K
        error.append(np.sqrt(np.mean((found - deep) ** 2)) / BORE)
    size, error = 2.0 * np.pi / np.array(SIDES), np.array(error)
    order = np.log(error[-2] / error[-1]) / np.log(2.0)
    case.metric("order of a prism's overlap", float(order), 2.0, 0.2, "last two sizes")
    return size, error


def write_tube(path: Path, sides: int) -> None:
    """Write a prism about z as binary STL; its corners are rounded alike where they meet."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = BORE * np.stack([np.cos(angle), np.sin(angle)], -1)
    low = np.column_stack([ring, np.full(sides, -HALF)])
    high = np.column_stack([ring, np.full(sides, HALF)])
    low_next, high_next = np.roll(low, -1, 0), np.roll(high, -1, 0)
    triangles = np.concatenate([
        np.stack([low, high_next, low_next], 1), np.stack([low, high, high_next], 1)])  # fmt: skip
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corner"] = triangles
    path.write_bytes(b"tube".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def pendulum(case: Case) -> dict[str, np.ndarray]:
    """Let a ball roll to and fro in a bore; return its angles."""
    start, bore, ball = 0.6, 0.05, 5.0e-3
    x = (bore - ball) * np.array([[np.sin(start), 0.0, -np.cos(start)]])
    arm = (bore - ball) * 1.4
    period = 2.0 * np.pi * np.sqrt(arm / G) / agm(1.0, np.cos(0.5 * start))
    go(case, "swing", f"""&run title = 'Ball in a bore', t_end = {0.9 * period},
  gravity = 0.0, 0.0, -{G} /
&cylinder id = 'bore', side = 'inside', centre = 0.0, 0.0, 0.0, axis = 0.0, 1.0, 0.0,
  radius = {bore}, material = 'tool' /
&dynamics dt = 8.0e-6 /
&history every_time = 5.0e-3 /
&output every_time = 5.0e-3 /
""", x, np.full(3, ball), HERTZ.replace("FRICTION", "1.0"))  # fmt: skip
    steps = field_steps(case.folder / "swing.h5")
    time = np.array([step.time for step in steps])
    place = np.array([step.grains["x"][0] for step in steps])
    angle = np.arctan2(place[:, 0], -place[:, 2])
    zero = np.flatnonzero(angle[1:] * angle[:-1] < 0.0)
    cross = time[zero] - angle[zero] * (time[1] - time[0]) / (angle[zero + 1] - angle[zero])
    case.metric(
        "half period / pendulum's", float((cross[1] - cross[0]) / (0.5 * period)), 1.0, 1e-3
    )
    energy = read_history(case.folder / "swing_energy.csv")
    case.below("ledger of the ball", float(energy["relative_closure"].max()), 1e-4)
    return {"time": time, "angle": angle, "period": np.array(period)}


def agm(a: float, b: float) -> float:
    """Arithmetic-geometric mean."""
    for _ in range(20):
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    return a


def wheel(case: Case) -> None:
    """A wheel on a fixed, almost flat ellipsoid: from sliding to rolling, and down a slope."""
    radius, mass, inertia, speed, slope = 0.05, 2.0, 1.5e-3, 0.5, 0.1
    share = inertia / (mass * radius**2)
    flat = np.array([20.0, 20.0, 0.05])
    text = f"""&cylinder id = 'wheel', side = 'outside',
  centre = 0.0, 0.0, {radius + 0.05 - 1.0e-6},
  axis = 0.0, 1.0, 0.0, radius = {radius}, length = 0.1, material = 'tool',
  velocity = SPEED, 0.0, 0.0 /
&body surface = 'wheel', free = 'x', 'z', 'ry', mass = {mass}, inertia = {inertia} /
&fixed ids = 1 /
&dynamics dt = 1.0e-5 /
&history every_time = 1.0e-3 /
"""
    for name, start, tilt in (("slide", speed, 0.0), ("slope", 0.0, slope)):
        pull = f"{G * np.sin(tilt)}, 0.0, {-G * np.cos(tilt)}"
        head = f"&run title = 'Wheel', t_end = 0.4, gravity = {pull} /\n"
        go(case, name, head + text.replace("SPEED", f"{start}"), np.zeros((1, 3)), flat,
           HERTZ.replace("FRICTION", "0.3"))  # fmt: skip
        energy = read_history(case.folder / f"{name}_energy.csv")
        case.below(f"ledger of the wheel, {name}", float(energy["relative_closure"].max()), 1e-4)
    rows = read_history(case.folder / "slide_bodies.csv")
    case.metric(
        "rolling / sliding velocity",
        float(rows["velocity_x"][-1] / speed),
        1.0 / (1.0 + share),
        1e-4,
    )
    rows = read_history(case.folder / "slope_bodies.csv")
    late = rows["time"] > 0.1
    got = np.polyfit(rows["time"][late], rows["velocity_x"][late], 1)[0]
    case.metric(
        "downhill / g sin(slope)", float(got / (G * np.sin(slope))), 1.0 / (1.0 + share), 1e-4
    )


def servo(case: Case) -> dict[str, np.ndarray]:
    """Squeeze balls in a bore between two plates; return the servo's rows."""
    radius, high, stress, ball = 9.0e-3, 8.0e-3, 50.0e3, 1.5e-3
    x = cloud(radius - 1.05 * ball, high, ball)
    area = 2.0 * np.pi * radius * high
    go(case, "press", f"""&run title = 'Bore under a servo', t_end = 0.015 /
&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'tool' /
&wall id = 'lid', point = 0.0, 0.0, {high}, normal = 0.0, 0.0, -1.0, material = 'tool' /
&cylinder id = 'bore', side = 'inside', centre = 0.0, 0.0, 0.0, radius = {radius},
  material = 'tool' /
&servo surface = 'bore', stress = {stress}, area = {area}, gain = 0.2, speed = 0.3,
  tolerance = 1.0e-3 /
&dynamics dt_factor = 0.04, damping = 300.0 /
&history every_time = 1.0e-4 /
&measure id = 'all', region = 'cylinder', base = 0.0, 0.0, {-0.1 * high}, radius = {1.1 * radius},
  length = {1.2 * high} /
&checkpoint every_time = 0.005, keep = 9 /
&output every_time = 1.0 /
""", x, np.full(3, ball), HERTZ.replace("FRICTION", "0.0"))  # fmt: skip
    rows = read_history(case.folder / "press_surface_servos.csv")
    now = rows["position"][-1]
    target = stress * area * now / radius
    case.metric("force / stress times area", float(rows["force"][-1] / target), 1.0, 1e-3)
    measure = read_history(case.folder / "press_measure_all.csv")
    volume = 1.1**2 * 1.2 * np.pi * radius**2 * high
    mean = (
        0.5
        * (measure["stress_xx"][-1] + measure["stress_yy"][-1])
        * volume
        / (np.pi * now**2 * high)
    )
    case.metric("Love-Weber stress across / stress", float(-mean / stress), 1.0, 1e-2)
    energy = read_history(case.folder / "press_energy.csv")
    case.below("ledger of the bore", float(energy["relative_closure"].max()), 1e-4)
    names = ("press_surfaces.csv", "press_surface_servos.csv", "press_energy.csv")
    kept = {name: (case.folder / name).read_text() for name in names}
    for title, option in (("restart", "--restart=press.chk.2.h5"), ("two threads", "--threads=2")):
        case.run("talus-dem", "press.nml", option)
        case.same_histories(title, kept, ROUNDING)
    return rows | {"wanted": np.array(stress * area / radius)}


def cloud(radius: float, high: float, ball: float) -> np.ndarray:
    """Balls on a jittered lattice within a cylinder."""
    step = 2.15 * ball
    side = np.arange(-10, 11) * step
    level = np.arange(ball * 1.05, high - ball, step)
    x = np.stack(np.meshgrid(side, side, level, indexing="ij"), -1).reshape(-1, 3)
    x += np.random.default_rng(3).uniform(-0.03, 0.03, x.shape) * ball
    return x[np.hypot(x[:, 0], x[:, 1]) < radius]


def draw(case: Case, prisms: tuple, swing: dict, press: dict) -> None:
    """Order of the prisms, the pendulum, the servo."""
    fig, (left, middle, right) = case.figure(ncols=3, figsize=(11.0, 3.4))
    size, error = prisms
    left.loglog(size, error, "o")
    left.loglog(size, error[-1] * (size / size[-1]) ** 2, color="black", lw=0.8)
    left.set(xlabel="angle of a side [rad]", ylabel="error of the overlap / radius [-]")
    middle.plot(swing["time"][::4], swing["angle"][::4], "o")
    middle.axvline(0.5 * swing["period"], color="black", lw=0.8)
    middle.set(xlabel="time [s]", ylabel="angle of the ball [rad]")
    right.plot(1e3 * press["time"], press["force"])
    right.plot(1e3 * press["time"], press["wanted"] * press["position"], color="black", lw=0.8)
    right.set(xlabel="time [ms]", ylabel="force on the bore [N]")
    case.save(fig)
