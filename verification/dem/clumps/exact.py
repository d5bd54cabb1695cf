"""Clumps against closed forms of rigid bodies."""

import numpy as np
import same_bits
from rigid_bodies import UPRIGHT, plot_limit, spin_rates, turned
from triangle_nets import net, write_stl

from talus.clumps import Template, mass_of, rotation
from talus.commands.pack_clump import packing_of_clumps
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, DENSITY = 1.0e-3, 2500.0
APART = 1.2e-3  # of the spheres of the dumbbell [m]
FACE = "&surface id = 'w', file = 'face.stl', material = 'glass' /\n"
FLOOR = "&wall id = 'w', point = 0, 0, 0, normal = 0, 0, 1, material = 'glass' /\n"
STEP = "&dynamics dt = {!r}, allow_unstable = .true. /\n"
TRIPLE = Template(
    np.array([[0.0, 0.0, 0.0], [1.5e-3, 0.2e-3, 0.1e-3], [-0.3e-3, 1.1e-3, 0.4e-3]]),
    np.array([1.0e-3, 0.7e-3, 0.8e-3]),
)


def dumbbell(apart: float = APART) -> Template:
    """Return two spheres along x."""
    return Template(np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * apart, np.full(2, RADIUS))


def lens(apart: float) -> tuple[float, float, float]:
    """Volume, moment about the axis and across it of two overlapping spheres, closed forms."""
    # two spheres cut at the middle plane: half of a sphere beyond z = -d/2, twice
    d = 0.5 * apart
    z = np.polynomial.polynomial.Polynomial([0.0, 1.0])
    area = np.pi * (RADIUS**2 - z**2)
    whole = (area.integ()(RADIUS) - area.integ()(-d)) * 2.0
    polar = 0.5 * np.pi * (RADIUS**2 - z**2) ** 2
    along = 2.0 * (polar.integ()(RADIUS) - polar.integ()(-d))
    second = (area * (z + d) ** 2).integ()
    across = 0.5 * along + 2.0 * (second(RADIUS) - second(-d))
    return whole, along, across


def write(
    case: Case, name: str, templates: list[Template], kind: list[int], x: list[list[float]],
    quat: list[np.ndarray], v: list[list[float]] | None = None,
    omega: list[list[float]] | None = None,
) -> object:  # fmt: skip
    """Write and return a packing of clumps with their centres of mass at x."""
    n = len(kind)
    made = packing_of_clumps(templates, np.array(kind), np.ones(n), np.array(x), np.array(quat))
    made.clumps.v = np.array(v if v is not None else np.zeros((n, 3)), float)
    made.clumps.omega = np.array(omega if omega is not None else np.zeros((n, 3)), float)
    write_h5(case.folder / f"{name}_pack.h5", made)
    return made


def run_deck(case: Case, name: str, more: str = "", **words: object) -> list:
    """Run the deck with some words set; return the steps of its fields."""
    values = {"GRAVITY": 0.0, "YOUNG": 1.0e8, "FRICTION": 0.0, "DASH": 0.0, "PACK": f"{name}_pack"}
    values |= words
    values.setdefault("EVERY", values["END"])
    deck = (case.folder / "deck.nml").read_text()
    for word in sorted(values, key=len, reverse=True):
        deck = deck.replace(word, str(values[word]))
    (case.folder / f"{name}.nml").write_text(deck + more)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    return field_steps(case.folder / f"{name}.h5")


def judge_masses(case: Case) -> None:
    """Judge volumes and moments: lens, coinciding members, turned templates, columns."""
    turns = [UPRIGHT, turned([1, 2, 3], 0.7), turned([-2, 1, 0.5], 2.1)]
    spun = [Template(TRIPLE.centre @ rotation(q).T, TRIPLE.radius) for q in turns]
    twice = Template(np.zeros((2, 3)), np.full(2, RADIUS))
    x = [[0.01 * k, 0.0, 0.0] for k in range(5)]
    write(case, "mass", [dumbbell(), twice, *spun], [0, 1, 2, 3, 4], x, [UPRIGHT] * 5)
    end = run_deck(case, "mass", STEP.format(1.0e-6), END=1.0e-5)[-1].clumps
    volume, moments = end["mass"] / DENSITY, np.sort(end["inertia"], axis=1) / DENSITY
    exact, along, across = lens(APART)
    case.metric("dumbbell, volume / closed form", volume[0] / exact, 1.0, 1e-10)
    case.metric("dumbbell, moment along the axis", moments[0, 0] / along, 1.0, 1e-10)
    case.metric("dumbbell, moment across the axis", moments[0, 2] / across, 1.0, 1e-10)
    ball = 4.0 / 3.0 * np.pi * RADIUS**3
    case.metric("two members in one place, volume / sphere", volume[1] / ball, 1.0, 1e-12)
    spread = max(float(np.ptp(volume[2:]) / volume[2]), *np.ptp(moments[2:], axis=0) / moments[2])
    case.below("three spheres, turned templates differ by", spread, 1e-6, "error of the quadrature")
    other = mass_of(TRIPLE.centre, TRIPLE.radius)
    apart = np.abs(np.linalg.eigvalsh(other[2]) / moments[2] - 1.0).max()
    case.below("three spheres, moments from columns", float(apart), 1e-4, "400 columns across")


def judge_impact(case: Case) -> None:
    """Judge rebound and spin of an inclined dumbbell on a wall at rising stiffness."""
    volume, _, across = lens(APART)
    angle, speed, drop = 0.6, 0.5, 1.0e-6
    arm, mass, moment = 0.5 * APART * np.cos(angle), DENSITY * volume, DENSITY * across
    push = 2.0 * speed / (1.0 / mass + arm**2 / moment)
    wanted = -speed + push / mass, push * arm / moment
    height = RADIUS + 0.5 * APART * np.sin(angle) + drop
    errors = []
    for k, young in enumerate((1.0e9, 3.2e10, 1.024e12)):
        time = 3.0 * (mass**2 / (RADIUS * young**2 * speed)) ** 0.2  # of a Hertzian contact
        name = f"impact_{k}"
        write(case, name, [dumbbell()], [0], [[0, 0, height]], [turned([0, 1, 0], angle)],
              [[0, 0, -speed]])  # fmt: skip
        more = FLOOR + STEP.format(float(time / 2000.0))
        end = run_deck(case, name, more, END=repr(float(2.0 * drop / speed + 3.0 * time)),
                       YOUNG=young)[-1]  # fmt: skip
        v, spin = end.clumps["v"][0, 2], end.clumps["omega"][0, 1]
        errors.append([abs(v - wanted[0]) / speed, abs(abs(spin) / wanted[1] - 1.0)])
        if k == 2:
            case.metric("impact, rebound / speed", float(v / speed), wanted[0] / speed, 2e-3)
            case.metric("impact, spin / closed form", float(abs(spin) / wanted[1]), 1.0, 2e-3)
            other = float(np.abs([*end.clumps["v"][0, :2], *end.clumps["omega"][0, [0, 2]]]).max())
            case.below("impact, other components [m/s, rad/s]", other, 1e-9, "no friction, a plane")
    order = np.log(np.array(errors[0]) / errors[2]) / np.log(1024.0)
    case.metric("impact, order of the rebound in 1/E", float(order[0]), 0.4, 0.1, "contact time")
    case.figure_data = np.array(errors)


def judge_surface(case: Case) -> None:
    """Judge a tumbling fall of two kinds with friction onto a triangle against the wall."""
    write_stl(case.folder / "face.stl", net(1, 0.1))
    x, quat = [[0, 0, 3e-3], [6e-3, 1e-3, 4e-3]], [turned([1, 2, 0], 0.7), turned([0, 1, 1], 1.9)]
    words = {"END": 0.02, "GRAVITY": -9.81, "FRICTION": 0.4, "DASH": 0.1}
    ends = []
    for name, plane in (("on_wall", FLOOR), ("on_face", FACE)):
        write(case, name, [dumbbell(), TRIPLE], [0, 1], x, quat, [[0.2, 0, -0.3], [0, 0.1, -0.3]])
        ends.append(run_deck(case, name, plane + STEP.format(1.0e-6), **words)[-1].clumps)
    off = max(float(np.abs(ends[1][k] - ends[0][k]).max() / np.abs(ends[0][k]).max())
              for k in ("x", "v", "omega", "quat"))  # fmt: skip
    case.below("onto a triangle and onto a wall, motion that differs", off, 1e-9, "rounding")
    case.above("they have struck, spin [rad/s]", float(np.abs(ends[0]["omega"]).max()), 10.0)


def flight(case: Case, name: str, step: float) -> list:
    """Return the steps of the flight of three spheres."""
    write(case, name, [TRIPLE], [0], [[2e-3, 1e-3, 3e-3]], [UPRIGHT], [[0.1, -0.05, 0.2]],
          [[300.0, 20.0, -40.0]])  # fmt: skip
    return run_deck(case, name, STEP.format(step), END=0.2, EVERY=0.02)


def judge_flight(case: Case) -> None:
    """Judge angular momentum, energy, Euler's equations and the path of the centre."""

    def momentum(c: dict) -> np.ndarray:
        r = rotation(c["principal"][0])
        return r @ (c["inertia"][0] * (r.T @ c["omega"][0]))

    def body_spin(c: dict) -> np.ndarray:
        return rotation(c["principal"][0]).T @ c["omega"][0]

    errors = []
    for k, step in enumerate((4.0e-6, 2.0e-6)):
        steps = flight(case, f"flight_{k}", step)
        first, last = steps[0].clumps, steps[-1].clumps
        start = body_spin(first)
        exact = spin_rates(first["inertia"][0], start, 0.2, 20000)
        errors.append(np.linalg.norm(body_spin(last) - exact) / np.linalg.norm(exact))
    change = np.linalg.norm(momentum(last) - momentum(first)) / np.linalg.norm(momentum(first))
    case.below("flight, change of angular momentum", float(change), 1e-11, "100 000 steps")
    ledger = read_history(case.folder / "flight_1_energy.csv")["kinetic"]
    case.below("flight, change of energy", float(np.ptp(ledger) / ledger[0]), 1e-6, "bounded")
    case.below("flight, spin against Euler's equations", float(errors[1]), 1e-3, "10 turns")
    case.metric("flight, order of the spin", float(np.log2(errors[0] / errors[1])), 2.0, 0.1)
    way = last["x"][0] - first["x"][0] - 0.2 * np.array([0.1, -0.05, 0.2])
    case.below("flight, centre off its line [m]", float(np.abs(way).max()), 2e-13,
               "rounding of 100 000 sums")  # fmt: skip
    arms = [np.diff(s.grains["x"], axis=0) for s in (steps[0], steps[-1])]
    lengths = [np.linalg.norm(a, axis=1) for a in arms]
    case.below("flight, change of distances", float(np.abs(lengths[1] / lengths[0] - 1).max()),
               1e-13, "rigid")  # fmt: skip


def judge_rest(case: Case) -> None:
    """Judge the reactions of a clump on three of its spheres, another one above them."""
    feet = np.array([[0.0, 0.0, 0.0], [4.0e-3, 0.5e-3, 0.0], [1.0e-3, 3.0e-3, 0.0]])
    shape = Template(np.vstack([feet, [[1.4e-3, 1.0e-3, 1.5e-3]]]), np.array([1, 1, 1, 1.8]) * 1e-3)
    middle = mass_of(shape.centre, shape.radius)[1]
    write(case, "rest", [shape], [0], [[0, 0, middle[2] + RADIUS]], [UPRIGHT])
    more = FLOOR + "&dynamics damping = 400.0 /\n"
    end = run_deck(case, "rest", more, END=0.1, GRAVITY=-9.81, FRICTION=0.3)[-1]
    weight = 9.81 * end.clumps["mass"][0]
    share = np.linalg.solve(np.vstack([feet[:, :2].T, np.ones(3)]), [*middle[:2], 1.0])
    for k in range(3):
        bears = float(end.grains["force"][k, 2] / weight)
        note = "centre of mass from columns, tilt by overlaps"
        case.metric(f"rest, share of support {k + 1}", bears, float(share[k]), 1e-4, note)


def judge_one(case: Case) -> None:
    """Judge a bed of clumps of one sphere against spheres, bit by bit; then threads, restarts."""
    rng = np.random.default_rng(5)
    lattice = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), -1).reshape(-1, 3)
    x = (lattice * 2.1 + 1.5 + rng.uniform(-0.04, 0.04, lattice.shape)) * RADIUS
    v = rng.normal(0.0, 0.2, x.shape)
    spin = rng.normal(0.0, 50.0, x.shape)
    n = len(x)
    one = Template(np.zeros((1, 3)), np.array([RADIUS]))
    write(case, "one", [one], [0] * n, x, [UPRIGHT] * n, v, spin)
    plain = make_packing(x, np.full((n, 3), RADIUS), v=v, omega=spin)
    write_h5(case.folder / "plain_pack.h5", plain)
    more = FLOOR + "&dynamics /\n"
    words = {"END": 0.03, "GRAVITY": -9.81, "FRICTION": 0.4, "DASH": 0.1}
    ends = [run_deck(case, name, more, **words)[-1].grains for name in ("one", "plain")]
    same = all((ends[0][key] == ends[1][key]).all() for key in ("x", "quat", "v", "omega", "force"))
    case.metric("clumps of one sphere as spheres: the same bits", float(same), 1.0, 0.0)
    kinds = rng.integers(2, size=n)
    quat = rng.normal(size=(n, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    write(case, "bed", [dumbbell(), TRIPLE], kinds, 1.8 * x, quat, v, spin)
    more = FLOOR + "&dynamics dt_factor = {} /\n&checkpoint every_time = 0.012, keep = 3 /\n"
    closures = []
    for k, factor in enumerate((0.1, 0.05)):
        (case.folder / f"bed_{k}_pack.h5").write_bytes((case.folder / "bed_pack.h5").read_bytes())
        run_deck(case, f"bed_{k}", more.format(factor), **words)
        ledger = read_history(case.folder / f"bed_{k}_energy.csv")
        closures.append(abs(ledger["closure_error"][-1]) / ledger["kinetic"][0])
    case.below("bed, closure error / energy", float(closures[1]), 3e-4, "second order in the step")
    same_bits.judge(case, "bed_1", "bed, ")


def judge_cell(case: Case) -> None:
    """Judge two dumbbells that meet over a face of a cell against the same inside it."""
    ends = []
    for name, off in (("inside", 4.0e-3), ("over", 7.9e-3)):
        x = [[off - 1.7e-3, 4e-3, 4e-3], [off + 1.7e-3, 4.3e-3, 4.2e-3]]
        quat = [turned([0, 1, 1], 0.5), turned([1, 0, 2], -0.8)]
        made = write(case, name, [dumbbell()], [0, 0], x, quat, [[0.4, 0, 0], [-0.4, 0, 0]])
        made.cell = np.eye(3) * 8.2e-3
        made.clumps.x -= 8.2e-3 * np.floor(np.array(x) / 8.2e-3)
        made.x = made.clumps.members()[0]
        write_h5(case.folder / f"{name}_pack.h5", made)
        more = "&cell /\n" + STEP.format(1.0e-6)
        ends.append(run_deck(case, name, more, END=0.004, FRICTION=0.3, DASH=0.1)[-1].clumps)
    change = float(np.abs(ends[0]["v"][0, 0] - 0.4))
    case.above("meeting, change of velocity [m/s]", change, 0.05, "they do meet")
    off = [np.abs(ends[0][k] - ends[1][k]).max() / np.abs(ends[0][k]).max() for k in ("v", "omega")]
    case.below("meeting over a face, motion that differs", float(max(off)), 1e-8, "rounding")
    off = (ends[1]["x"] - ends[0]["x"] - [3.9e-3, 0, 0]) / 8.2e-3
    off = 8.2e-3 * np.abs(off - np.round(off)).max()
    case.below("meeting over a face, places that differ [m]", float(off), 1e-11, "rounding")
    p = (ends[1]["mass"][:, None] * ends[1]["v"]).sum(axis=0)
    case.below("meeting, momentum / first", float(np.abs(p).max() / (0.4 * ends[1]["mass"][0])),
               1e-12, "none at the start")  # fmt: skip


def run(case: Case) -> None:
    """Judge all; plot the limit of the stiff impact."""
    judge_masses(case)
    judge_impact(case)
    judge_surface(case)
    judge_flight(case)
    judge_rest(case)
    judge_one(case)
    judge_cell(case)
    plot_limit(case, case.figure_data, ["rebound", "spin"])
