"""Contacts that turn as rigid bodies do: what their springs hold must turn with them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from triangle_nets import net, write_stl

from talus.verification import Case, read_history, write_packing

RADIUS, YOUNG, POISSON, OVERLAP = 1.0e-3, 1.0e8, 0.25, 1.0e-5
E_STAR = YOUNG / (2 * (1 - POISSON**2))
G_STAR = YOUNG / (2 * (1 + POISSON)) / (2 * (2 - POISSON))
LENGTH, ARM = 2 * RADIUS - OVERLAP, RADIUS - OVERLAP / 2
HALF = RADIUS / 2  # effective radius of the pair [m]
RATE, TURNS, DRIFT = 1000.0, 10, 3.14e-6  # [rad/s], [-], aside at the end [m]
SLIP = DRIFT  # of the contact at the end where partners turn a little on each other [m]
LINEAR = 5.0e3  # stiffness of the law 'linear' [N/m]
STEPS = (1000, 2000, 4000)  # a turn
PLACES = 1 / 48  # of the force: half of the last of 12 intervals that springs have in bent paths
HEAVY = 1.0e9  # centripetal force of a partner that circles [N]
BOND = {"young": 1.0e7, "ratio": 2.0, "radius": 0.8 * RADIUS}
PULL = BOND["young"] * np.pi * BOND["radius"] ** 2 / LENGTH
SHEAR, BENDING = PULL / BOND["ratio"], PULL * BOND["radius"] ** 2 / 4
TWIST = SHEAR * BOND["radius"] ** 2 / 2
X, Y, Z = np.eye(3)


def hertz(overlap: float | np.ndarray, radius: float) -> float | np.ndarray:
    """Normal force [N]."""
    return 4 / 3 * E_STAR * np.sqrt(radius) * overlap**1.5


def stiffness(overlap: float | np.ndarray, radius: float) -> float | np.ndarray:
    """Tangential stiffness 8 G* a of Mindlin [N/m]."""
    return 8 * G_STAR * np.sqrt(radius * overlap)


def rotated(axis: np.ndarray, angle: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Rotate vectors (n, 3) by angles (n) about a unit axis."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return c * v + s * np.cross(axis, v) + (1 - c) * (v @ axis)[:, None] * axis


@dataclass
class Turn:
    """Rigid motion of a contact: axis, and the small constant spin of the other body beside it."""

    axis: np.ndarray
    extra: np.ndarray  # [rad/s]

    def relative(self, t: np.ndarray) -> np.ndarray:
        """Return the turn of the other body on the first, in the frame that turns [rad]."""
        along = (self.axis @ self.extra) * self.axis
        across, angle = self.extra - along, RATE * t[:, None]
        side = np.cross(self.axis, across)
        return along * t[:, None] + (np.sin(angle) * across - (1 - np.cos(angle)) * side) / RATE

    def carried(self, t: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return slip (n, 3) [m] and turn (n, 3) [rad] of the other body as the springs see them.

        They turn with the mean spin of both bodies about the normal, so by half of what the other
        one turns on the first. arm: from the centre of the other body to the contact.
        """
        n = arm / np.linalg.norm(arm)
        fine = np.linspace(0.0, t[-1], 8000 * TURNS + 1)
        turn = self.relative(fine)
        half = 0.5 * (turn @ n)
        about = (turn @ n)[:, None] * n
        rows = []
        for values in (np.cross(turn, arm), turn - about):
            steps = rotated(n, -0.5 * (half[1:] + half[:-1]), np.diff(values, axis=0))
            summed = rotated(n, half, np.vstack([0 * values[:1], np.cumsum(steps, axis=0)]))
            rows.append(np.column_stack([np.interp(t, fine, summed[:, c]) for c in range(3)]))
        slip, across = rows
        return slip, across + (self.relative(t) @ n)[:, None] * n

    def into_space(self, t: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return vectors (n, 3) of the frame that turns, in space."""
        return rotated(self.axis, RATE * t, v)


@dataclass
class Springs:
    """What a law gives for a slip u (n, 3) [m] and a turn (n, 3) [rad] of the other body."""

    force: Callable[[np.ndarray], np.ndarray]
    rolling: float = 0.0  # stiffness [N m]
    twisting: float = 0.0  # [N m]

    def moment(self, u: np.ndarray, turn: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """Return the moment on the first body about its centre [N m]; arm (3) to the contact."""
        n = arm / np.linalg.norm(arm)
        about = (turn @ n)[:, None] * n
        on_other = -self.rolling * (turn - about) - self.twisting * about
        return np.cross(arm, self.force(u)) - on_other


def elastic(k: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the force on the first body of a spring without slip, pulled by u."""
    return lambda u: k * u


def partial_slip(mu: float, radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the force of Cattaneo and Mindlin for a straight path of u."""
    limit = mu * E_STAR / (4 * G_STAR) * OVERLAP

    def force(u: np.ndarray) -> np.ndarray:
        size = np.linalg.norm(u, axis=1)[:, None]
        load = mu * (hertz(OVERLAP, radius) - hertz(OVERLAP * (1 - size / limit), radius))
        return load * u / np.maximum(size, 1e-300)

    return force


def vector(v: np.ndarray) -> str:
    """Return a vector as a deck has it."""
    return ", ".join(f"{c:.17e}" for c in v)


def ran(case: Case, name: str, steps: int, words: dict, bodies: dict) -> None:
    """Run 10 turns with one or two spheres: their places, velocities and spins (n, 3)."""
    dt = 2 * np.pi / RATE / steps
    end = TURNS * steps * dt
    values = {
        "END": f"{end:.17e}", "DENSITY": "1.0e18", "STEP": f"{dt:.17e}",
        "ROW": f"{steps // 20 * dt:.17e}",
    }  # fmt: skip
    text = (case.folder / "deck.nml").read_text()
    for word, value in {**values, **words}.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    x, v, omega = (np.array(bodies[key], dtype=float) for key in ("x", "v", "omega"))
    write_packing(case.folder / "pack.h5", x, np.full(x.shape, RADIUS), v=v, omega=omega)
    case.run("talus-dem", f"{name}.nml")


def loads(case: Case, name: str) -> tuple[np.ndarray, ...]:
    """Return times, forces and moments (n, 3) on the body of a history."""
    rows = read_history(case.folder / f"{name}.csv")
    return rows["time"], *(
        np.column_stack([rows[f"{what}_{c}"] for c in "xyz"]) for what in ("force", "moment")
    )


def driven(spin: np.ndarray, bond: str = "") -> str:
    """Return the groups of a deck that let the first sphere spin on the spot."""
    return f"&driven ids = 1, velocity = 0.0, 0.0, 0.0, spin = {vector(spin)} /\n{bond}"


def circling(case: Case, name: str, steps: int, law: "Law", turn: Turn) -> tuple:
    """Run a pair whose partner circles about the driven sphere, or spins with it on the spot.

    The centripetal force is that of the polygon whose corners the leapfrog visits; beside it the
    forces of the contact are too small to move the partner.
    """
    words = {"LAW": law.text, "OTHERS": driven(RATE * turn.axis, law.bond)}
    v = 0 * X
    if abs(turn.axis @ Z) < 0.5:
        angle = 2 * np.pi / steps
        dt = angle / RATE
        mass = HEAVY * dt**2 / (2 * LENGTH * (1 - np.cos(angle)))
        words["DENSITY"] = f"{mass / (4 / 3 * np.pi * RADIUS**3):.17e}"
        pull = HEAVY + law.normal
        words["LAW"] += f", cohesion = 'constant', pull_force = {pull:.17e}"
        v = np.cross(turn.axis, Z) * LENGTH * np.sin(angle) / dt
    spin = RATE * turn.axis
    ran(case, name, steps, words, {"x": [0 * X, LENGTH * Z], "v": [0 * X, v],
                                   "omega": [spin, spin + turn.extra]})  # fmt: skip
    return loads(case, f"{name}_driven")


@dataclass
class Law:
    """A law of the deck and what it should give between two spheres."""

    text: str
    springs: Springs
    normal: float = hertz(OVERLAP, HALF)  # [N]
    bond: str = ""


@dataclass
class Found:
    """What a run gave: times [s], loads (n, 3), the exact ones, normal force [N]."""

    time: np.ndarray
    loads: np.ndarray
    wanted: np.ndarray
    normal: np.ndarray

    def off(self) -> np.ndarray:
        """Return the differences over the largest exact load."""
        largest = np.linalg.norm(self.wanted, axis=1).max()
        return np.linalg.norm(self.loads - self.wanted, axis=1) / largest


def laws(radius: float) -> dict[str, Law]:
    """Return the laws of contacts with an effective radius [m]."""
    k = stiffness(OVERLAP, radius)
    turning = k * radius**2
    roll = "friction = 0.0, rolling_friction = 1.0e4, twisting_friction = 1.0e4"
    constant = f"normal_stiffness = {LINEAR}, tangential_stiffness = {LINEAR}"
    none, normal = elastic(0.0), hertz(OVERLAP, radius)
    return {
        "hertz_mindlin": Law("law = 'hertz_mindlin', friction = 1.0", Springs(elastic(k)), normal),
        "linear": Law(f"law = 'linear', friction = 1.0, {constant}", Springs(elastic(LINEAR)),
                      LINEAR * OVERLAP),
        "mindlin_deresiewicz": Law("law = 'mindlin_deresiewicz', friction = 1.0",
                                   Springs(partial_slip(1.0, radius)), normal),
        "little slip": Law("law = 'mindlin_deresiewicz', friction = 100.0",
                           Springs(partial_slip(100.0, radius)), normal),
        "rolling": Law(f"law = 'hertz_mindlin', {roll}", Springs(none, turning, turning), normal),
    }  # fmt: skip


def bonded() -> Law:
    """Return a bond over a contact without friction."""
    words = "young = {young}, stiffness_ratio = {ratio}, radius = 0.8".format(**BOND)
    bond = f"&bond {words}, tensile_strength = 1.0e12, shear_strength = 1.0e12 /"
    springs = Springs(elastic(SHEAR), BENDING, TWIST)
    return Law("law = 'hertz_mindlin', friction = 0.0", springs, bond=bond)


def turning_pair(case: Case, law: Law, turn: Turn, steps: int) -> Found:
    """Moment on the driven sphere, whose partner circles about it."""
    t, force, moment = circling(case, "pair", steps, law, turn)
    slip, rotation = turn.carried(t, -ARM * Z)
    wanted = turn.into_space(t, law.springs.moment(slip, rotation, ARM * Z))
    normal = turn.into_space(t, np.tile(Z, (len(t), 1)))
    return Found(t, moment, wanted, (force * normal).sum(axis=1))


def drifting_pair(case: Case, law: Law, share: float, steps: int) -> Found:
    """Tangential force on the driven sphere; share: of both spins, its own."""
    end = TURNS * 2 * np.pi / RATE
    spins = 2 * RATE * np.array([share * Z, (1 - share) * Z])
    ran(case, "drift", steps, {"LAW": law.text, "OTHERS": driven(spins[0], law.bond)},
        {"x": [0 * X, LENGTH * Z], "v": [0 * X, DRIFT / end * X], "omega": spins})  # fmt: skip
    t, force, _ = loads(case, "drift_driven")
    offset = DRIFT * t[:, None] / end
    n = offset * X + LENGTH * Z
    n /= np.linalg.norm(n, axis=1)[:, None]
    along = X - (n @ X)[:, None] * n
    along /= np.linalg.norm(along, axis=1)[:, None]
    wanted = np.linalg.norm(law.springs.force(offset * X), axis=1)[:, None] * along
    normal = (force * n).sum(axis=1)
    return Found(t, force - normal[:, None] * n, wanted, normal)


def on_plate(case: Case, law: Law, turn: Turn, steps: int) -> Found:
    """Moment on a sphere within a triangle that turns about its centre."""
    spin = RATE * turn.axis
    plate = f"""&surface id = 'plate', file = 'plate.stl', material = 'soft',
  centre = 0.0, 0.0, 0.0, spin = {vector(spin)} /"""
    shift = np.array([3e-3, 1e-3, -RADIUS + OVERLAP])
    write_stl(case.folder / "plate.stl", net(2, 10 * RADIUS) + shift)
    ran(case, "plate", steps, {"LAW": law.text, "OTHERS": plate},
        {"x": [0 * X], "v": [0 * X], "omega": [spin + turn.extra]})  # fmt: skip
    t, force, moment = loads(case, "plate_surfaces")
    slip, rotation = turn.carried(t, -ARM * Z)
    wanted = -turn.into_space(t, law.springs.moment(-slip, -rotation, -ARM * Z))
    return Found(t, moment, wanted, force @ Z)


def motions() -> dict[str, Turn]:
    """Return the turns about the axes; the normal is z at first."""
    grow = SLIP / ARM / (TURNS * 2 * np.pi / RATE)
    sway = SLIP / ARM * RATE / 2
    oblique = np.array([0.48, 0.64, 0.6])
    return {
        "x": Turn(X, grow * X), "y": Turn(Y, grow * Y), "z": Turn(Z, sway * X),
        "x, twisted": Turn(X, sway * Z), "oblique": Turn(oblique, grow * oblique),
        "oblique, swaying": Turn(oblique, sway * np.array([-0.8, 0.6, 0.0])),
    }  # fmt: skip


def choose(name: str, way: str) -> bool:
    """Whether the closed forms hold: slip from the rim, straight paths; little slip, all others."""
    straight = {"mindlin_deresiewicz": True, "little slip": False}
    return straight.get(name, way in ("x", "y", "oblique")) == (way in ("x", "y", "oblique"))


def chord(found: Found, law: Law, steps: int) -> float:
    """Return the slip that a circle of chords feigns, over the largest exact moment [-].

    The partner goes along the chord of an angle a, the spins along its arc: L a^3/6 a step.
    """
    false = LENGTH * (2 * np.pi / steps) ** 2 * 2 * np.pi * TURNS / 6
    moment = ARM * np.linalg.norm(law.springs.force(np.array([[SLIP, 0.0, 0.0]])))
    return false / SLIP * moment / np.linalg.norm(found.wanted, axis=1).max()


def judge_pairs(case: Case) -> None:
    """Judge pairs that turn as one body and a little on each other."""
    lag, steps = np.pi / STEPS[-1], STEPS[-1]
    for name, law in {**laws(HALF), "bond": bonded()}.items():
        for way, turn in motions().items():
            if way.startswith("oblique") or not choose(name, way):
                continue
            found = turning_pair(case, law, turn, steps)
            limit = 1.0e-4 if way != "z" else 0.0
            limit += 0.0 if way == "z" else 1.2 * chord(found, law, steps)
            limit += 0.0 if way in ("x", "y") else 1.2 * lag
            limit += PLACES if name == "little slip" else 0.0
            case.below(f"pair, {name}, about {way}: largest error", found.off().max(), limit,
                       "of first or second order in the step")  # fmt: skip
            if name == "bond":
                stretched = np.ptp(found.normal) / (PULL * SLIP)
                case.below(f"pair, bond, about {way}: feigned pull / (k_n x slip)", stretched, 1e-3)


def judge_drift(case: Case) -> None:
    """Judge pairs of which one drifts aside while both, or one alone, spin about the normal."""
    lag = np.pi / STEPS[-1]
    for name, law in {**laws(HALF), "bond": bonded()}.items():
        if name in ("rolling", "mindlin_deresiewicz"):
            continue
        more = PLACES if name == "little slip" else 0.0
        for who, share in (("both spin", 0.5), ("one spins", 1.0)):
            found = drifting_pair(case, law, share, STEPS[-1])
            note = "half an angle of the step; the overlap falls by 2.5e-4"
            case.below(f"drift, {name}, {who}: largest error", found.off().max(),
                       1.2 * lag + 2.5e-4 + more, note)  # fmt: skip
            size = np.linalg.norm(found.loads[-1]) / np.linalg.norm(found.wanted[-1])
            case.metric(f"drift, {name}, {who}: T / (k_t x offset)", size, 1.0, 2.5e-4 + more)


def judge_plate(case: Case) -> None:
    """Judge a sphere and a triangle that turn as one body."""
    lag = np.pi / STEPS[-1]
    for name, law in laws(RADIUS).items():
        for way, turn in motions().items():
            if not choose(name, way):
                continue
            found = on_plate(case, law, turn, STEPS[-1])
            limit = {"x": 1e-8, "y": 1e-8, "oblique": 1e-4}.get(way, 1.2 * lag)
            if way == "oblique, swaying":  # into the new plane, by tilt^2/4 of a step at most
                tilt = 0.8 * 2 * np.pi / STEPS[-1]
                limit += 0.25 * tilt**2 * STEPS[-1] * TURNS
            if name == "little slip":
                limit += PLACES
            if name == "mindlin_deresiewicz":
                most = np.linalg.norm(law.springs.force(np.array([[SLIP, 0.0, 0.0]])))
                limit += 6e-3 * law.normal / most
            case.below(f"triangle, {name}, about {way}: largest error", found.off().max(), limit)


def judge_orders(case: Case, ax: object) -> None:
    """Judge and plot the errors over the step."""
    law, turns = laws(HALF)["hertz_mindlin"], motions()
    rows = {
        "about x": (2, lambda n: turning_pair(case, law, turns["x"], n)),
        "about z": (1, lambda n: turning_pair(case, law, turns["z"], n)),
        "bond, about x": (2, lambda n: turning_pair(case, bonded(), turns["x"], n)),
    }
    for mark, (label, (order, ask)) in zip("osd", rows.items(), strict=True):
        found = [float(ask(n).off().max()) for n in STEPS]
        slope = np.polyfit(np.log(STEPS), np.log(found), 1)[0]
        case.metric(f"{label}: order in the step", -slope, order, 0.25)
        ax.loglog(STEPS, found, mark, label=label)
        ax.loglog(STEPS, found[0] * (np.array(STEPS) / STEPS[0]) ** -float(order), "-", color="0.5")
    ax.set(xlabel="steps a turn [-]", ylabel="largest error in ten turns [-]")
    ax.legend()


def show(case: Case, ax: object, law: Law, turn: Turn, title: str) -> None:
    """Plot the moment on the driven sphere over the first turns."""
    found = turning_pair(case, law, turn, STEPS[-1])
    part = found.time * RATE <= 2.05 * 2 * np.pi
    turned = found.time[part] * RATE / (2 * np.pi)
    for c in range(3):
        ax.plot(turned, 1e6 * found.wanted[part, c], "-", color=f"C{c}")
        ax.plot(turned, 1e6 * found.loads[part, c], "o", color=f"C{c}", ms=3.5, label="xyz"[c])
    ax.set(xlabel="turns [-]", ylabel="moment on the first sphere [uN m]", title=title)
    ax.legend()


def run(case: Case) -> None:
    """Judge pairs, drifts, triangles and the order in the step; plot moments and errors."""
    judge_pairs(case)
    judge_drift(case)
    judge_plate(case)
    fig, axes = case.figure(ncols=3, figsize=(12.5, 3.8))
    show(case, axes[0], laws(HALF)["hertz_mindlin"], motions()["z"], "tangential, about the normal")
    show(case, axes[1], laws(HALF)["rolling"], motions()["x, twisted"], "rolling, tumbling")
    judge_orders(case, axes[2])
    case.save(fig)
