"""A sphere with partial slip against closed loops and springs with friction."""

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON, MU = 2.0e-3, 2650.0, 1.0e8, 0.25, 0.3
E_STAR = YOUNG / (2 * (1 - POISSON**2))
G_STAR = YOUNG / (2 * (1 + POISSON)) / (2 * (2 - POISSON))
MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3
DEPTH, STEP = 4.0e-6, 1.0e-6
SLIDE = MU * E_STAR / (4 * G_STAR) * DEPTH  # displacement at which all of the contact slides [m]


def hertz(overlap: np.ndarray | float) -> np.ndarray | float:
    """Normal force [N]."""
    return 4 / 3 * E_STAR * np.sqrt(RADIUS) * np.maximum(overlap, 0.0) ** 1.5


def loaded(u: np.ndarray | float) -> np.ndarray | float:
    """Return the force of a first loading by u [m] at DEPTH [N]."""
    return MU * (hertz(DEPTH) - hertz(DEPTH * (1 - u / SLIDE)))


class Springs:
    """Springs side by side, each with friction: place x across the contact, deflection w [m]."""

    def __init__(self, deepest: float, count: int = 4000) -> None:
        """Lay out springs for overlaps up to the deepest [m]."""
        edge = np.sqrt(RADIUS * deepest) * np.linspace(0.0, 1.0, count + 1)
        self.x, self.width = 0.5 * (edge[1:] + edge[:-1]), edge[1]
        self.w, self.lost = np.zeros((count, 2)), 0.0

    def step(self, shift: np.ndarray, overlap: float) -> np.ndarray:
        """Move on; return the tangential force (2) [N]."""
        limit = MU * E_STAR / (4 * G_STAR) * np.maximum(overlap - self.x**2 / RADIUS, 0.0)
        before, self.w = self.w, self.w + shift
        size = np.linalg.norm(self.w, axis=1)
        cut = np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)
        slip = self.w * (1 - cut)[:, None]
        self.w = self.w * cut[:, None]
        mean = 0.5 * (self.w + before)
        self.lost += 8 * G_STAR * self.width * float((mean * slip).sum())
        return 8 * G_STAR * self.width * self.w.sum(axis=0)


def ran(case: Case, name: str, wall: tuple, curve: tuple, depth: float, v: tuple, **words) -> tuple:
    """Run a heavy sphere; return wall and energy histories."""
    values = {
        "LAW": "mindlin_deresiewicz", "VELOCITY": ", ".join(f"{c:.16e}" for c in wall),
        "TIMES": ", ".join(f"{c:.16e}" for c in curve[0]), "END": f"{curve[0][-1]:.16e}",
        "VALUES": ", ".join(f"{c:.16e}" for c in curve[1]), "MASS": "1.0e15",
        "STEP": f"{STEP:.16e}", "ROW": f"{10 * STEP:.16e}",
    }  # fmt: skip
    deck = (case.folder / "deck.nml").read_text()
    for word, value in {**values, **words}.items():
        deck = deck.replace(word, value)
    (case.folder / f"{name}.nml").write_text(deck)
    write_packing(
        case.folder / "pack.h5", np.array([[0.0, 0.0, RADIUS - depth]]), np.full((1, 3), RADIUS),
        v=np.array([v]),
    )  # fmt: skip
    case.run("talus-dem", f"{name}.nml")
    return (
        read_history(case.folder / f"{name}_walls.csv"),
        read_history(case.folder / f"{name}_energy.csv"),
    )


def path_to(ends: list[float], speed: float) -> tuple[tuple, list[int]]:
    """Return the curve of a velocity of +-1 to these places, and the rows of their ends."""
    times, values, rows, here, now, ramp = [0.0], [0.0], [0], 0.0, 0.0, 20 * STEP
    for end in ends:
        wait = round(abs(end - here) / speed / (10 * STEP)) * 10 * STEP
        way = (end - here) / (speed * wait)
        times += [now + ramp, now + wait, now + wait + ramp]
        values += [way, way, 0.0]
        here, now = end, now + wait + ramp
        rows.append(round(now / (10 * STEP)))
    return (times, values), rows


def loops(case: Case, ax: object) -> None:
    """Judge loops at constant normal force, and an inner loop."""
    top, speed, scale = 0.7, 2.0e-3, MU * hertz(DEPTH)
    end = SLIDE * (1 - (1 - top) ** (2 / 3))
    ends = [end, -end, end, 0.0, 0.5 * end, -end, end]
    curve, rows = path_to(ends, speed)
    walls, energy = ran(case, "loops", (speed, 0, 0), curve, DEPTH, (0, 0, 0))
    u, force = walls["x"], -walls["force_x"]
    up, down = slice(0, rows[1] + 1), slice(rows[1], rows[2] + 1)
    back = loaded(u[rows[1]]) - 2 * loaded(0.5 * (u[rows[1]] - u))
    forth = 2 * loaded(0.5 * (u - u[rows[2]])) - loaded(-u[rows[2]])
    for name, part, wanted in (
        ("first loading", up, loaded(u)), ("unloading", down, back),
        ("reloading", slice(rows[2], rows[3] + 1), forth),
        ("after an inner loop", slice(rows[7] - 5, rows[7] + 1), forth),
    ):  # fmt: skip
        off = np.abs(force[part] - wanted[part]).max() / scale
        case.below(f"{name}: largest difference / (mu N)", off, 1e-9)
    part = np.abs(force[rows[1]]) / scale
    stiffness = 8 * G_STAR * np.sqrt(RADIUS * DEPTH)
    once = 1 - (1 - part) ** (5 / 3) - 5 / 6 * part * (1 + (1 - part) ** (2 / 3))
    once *= 7.2 * scale**2 / stiffness
    lost = energy["friction"][rows[3]] - energy["friction"][rows[1]]
    case.metric("friction in a loop / exact", lost / once, 1.0, 1e-4)
    apart = np.abs(energy["tangential_relaxation"]).max() / energy["friction"][-1]
    case.below("not booked as friction / friction", apart, 1e-3)
    turnover = energy["friction"][-1] + energy["elastic"][0]
    case.below("closure / energy", np.abs(energy["closure_error"]).max() / turnover, 1e-6)
    springs = Springs(DEPTH)
    wanted = [0.0] + [springs.step(np.array([d, 0.0]), DEPTH)[0] for d in np.diff(u)]
    off = np.abs(force - wanted).max() / scale
    case.below("springs: largest difference / (mu N)", off, 1e-5)
    ax.plot(u / SLIDE, np.array(wanted) / scale, "-", label="exact")
    ax.plot(u[::9] / SLIDE, force[::9] / scale, "o", ms=3.5, label="Talus")
    ax.set(xlabel="displacement / that of sliding", ylabel="tangential force / (mu N)")
    ax.legend()


def pressed(case: Case, ax: object) -> None:
    """Judge a steady displacement under a normal force that rises and falls."""
    turns = 3000 * STEP
    times = np.linspace(0.0, turns, 301)
    speed, drift = -5.0e-3, 0.9 * SLIDE / turns
    curve = (times, np.sin(2 * np.pi * 1.5 * times / turns))
    for name, along in (("straight", (drift, 0.0)), ("slow", (0.2 * drift, 0.0))):
        walls, energy = ran(case, name, (0, 0, speed), curve, DEPTH, (*along, 0.0))
        depth = DEPTH + walls["z"]
        shift = -np.array(along) * 10 * STEP
        springs = Springs(depth.max())
        wanted, fine = [np.zeros(2)], 10
        springs.step(np.zeros(2), DEPTH)
        for low, high in zip(depth[:-1], depth[1:], strict=True):
            for k in range(fine):
                found = springs.step(shift / fine, low + (high - low) * (k + 1) / fine)
            wanted.append(found)
        wanted, scale = np.array(wanted)[:, 0], MU * hertz(DEPTH)
        force = -walls["force_x"]
        off = np.abs(force - wanted).max() / scale
        case.below(f"{name}, changing normal force: largest difference / (mu N)", off, 2e-3)
        lost = energy["friction"][-1] / springs.lost
        case.metric(f"{name}: friction / that of the springs", lost, 1.0, 2e-2)
        time = walls["time"] * 1e3
        (line,) = ax.plot(time, -wanted / scale, "-", label=f"springs, {name}")
        ax.plot(time[::8], -force[::8] / scale, "o", ms=3.5, color=line.get_color())
    ax.plot(time, MU * hertz(depth) / scale, ":", label="friction x normal force")
    ax.set(xlabel="time [ms]", ylabel="tangential force / (mu N at the start)")
    ax.legend()


def bent(case: Case, ax: object) -> None:
    """Judge zigzags across a drift, under a normal force that rises and falls, in two steps."""
    turns = 3000 * STEP
    times = np.linspace(0.0, turns, 301)
    across = 2 * np.pi * 7.0 * 0.45 * SLIDE / turns  # speed of the zigzag, 0.45 SLIDE to each side
    curve = (times, np.sin(2 * np.pi * 7.0 * times / turns))
    drift = 3.0 * SLIDE / turns
    for name, fine in (("bent", 1), ("bent_fine", 16)):
        walls, energy = ran(case, name, (across, 0, -2.0e-3), curve, DEPTH, (0.0, drift, 0.0),
                            STEP=f"{STEP / fine:.16e}")  # fmt: skip
        depth, shift = DEPTH + walls["z"], np.diff(walls["x"])
        springs, wanted, parts = Springs(depth.max(), 2000), [np.zeros(2)], 16
        springs.step(np.zeros(2), DEPTH)
        for low, high, dx in zip(depth[:-1], depth[1:], shift, strict=True):
            step = np.array([dx, -drift * 10 * STEP]) / parts
            for k in range(parts):
                found = springs.step(step, low + (high - low) * (k + 1) / parts)
            wanted.append(found)
        wanted, scale = np.array(wanted), MU * hertz(DEPTH)
        force = -np.column_stack([walls["force_x"], walls["force_y"]])
        off = np.linalg.norm(force - wanted, axis=1).max() / scale
        case.below(f"{name}: largest difference / (mu N)", off, 1e-2)
        lost = energy["friction"][-1] / springs.lost
        case.metric(f"{name}: friction / that of the springs", lost, 1.0, 2e-2)
    ax.plot(*wanted.T / scale, "-", label="springs")
    ax.plot(*force[::6].T / scale, "o", ms=3.0, label="Talus")
    ax.set(xlabel="force across / (mu N)", ylabel="force along / (mu N)", aspect="equal")
    ax.legend()


def impact(angle: float, speed: float, dt: float, many: int) -> tuple[float, float]:
    """Return tangential velocity of the contact and spin after an impact on a plane, by springs."""
    vx, vz = speed * np.sin(angle), -speed * np.cos(angle)
    spin, depth = 0.0, 0.0
    deepest = (15 * MASS * vz**2 / (16 * E_STAR * np.sqrt(RADIUS))) ** 0.4
    springs = Springs(1.02 * deepest, many)
    while True:
        depth -= vz * dt
        if depth <= 0:
            return vx, spin
        arm = RADIUS - 0.5 * depth
        force = springs.step(np.array([-(vx - arm * spin) * dt, 0.0]), depth)[0]
        vx += force / MASS * dt
        spin -= force * arm / (0.4 * MASS * RADIUS**2) * dt
        vz += hertz(depth) / MASS * dt


def impacts(case: Case, ax: object) -> None:
    """Judge rebounds of oblique impacts against the springs; the law hertz_mindlin beside them."""
    speed, angles = 0.1, np.radians([5, 15, 25, 35, 45, 55, 65])
    deepest = (15 * MASS * speed**2 / (16 * E_STAR * np.sqrt(RADIUS))) ** 0.4
    time = 2.94 * deepest / speed
    step = time / 2000
    for law in ("mindlin_deresiewicz", "hertz_mindlin"):
        found, wanted = [], []
        for angle in angles:
            v = (speed * np.sin(angle), 0.0, -speed * np.cos(angle))
            name = f"{law}_{np.degrees(angle):.0f}"
            end = 1.6 * time
            _, energy = ran(
                case, name, (0, 0, 0), ([0.0, end], [0.0, 0.0]), -1e-10, v,
                LAW=law, MASS="1.0", STEP=f"{step:.10e}", ROW=f"{0.1 * end:.10e}",
            )  # fmt: skip
            last = field_steps(case.folder / f"{name}.h5")[-1].grains
            wanted.append(impact(angle, speed, step, 300))
            found.append((last["v"][0, 0], last["omega"][0, 1]))
            first = 0.5 * MASS * speed**2
            case.below(f"{law}, {np.degrees(angle):.0f} deg: closure / energy",
                       np.abs(energy["closure_error"]).max() / first, 1e-5)  # fmt: skip
        found, wanted = np.array(found), np.array(wanted)
        rim = found[:, 0] - RADIUS * found[:, 1], wanted[:, 0] - RADIUS * wanted[:, 1]
        entry = np.tan(angles) / MU
        if law == "mindlin_deresiewicz":
            off = np.abs(found - wanted) * [1.0, RADIUS] / speed
            case.below("impacts: largest difference to the springs / speed", off.max(), 5e-4)
            ax.plot(entry, rim[1] / (MU * speed * np.cos(angles)), "-", label="springs")
            ax.plot(entry, rim[0] / (MU * speed * np.cos(angles)), "o", label="Talus")
        else:
            ax.plot(entry, rim[0] / (MU * speed * np.cos(angles)), "x", label="hertz_mindlin")
    ax.set(xlabel="tangent of the angle / mu", ylabel="rim speed after / (mu v_n)")
    ax.legend()


def run(case: Case) -> None:
    """Judge loops, changing normal forces, bent paths and impacts; plot all four."""
    fig, axes = case.figure(ncols=2, nrows=2, figsize=(10.0, 8.4))
    loops(case, axes[0, 0])
    pressed(case, axes[0, 1])
    bent(case, axes[1, 0])
    impacts(case, axes[1, 1])
    case.save(fig)
