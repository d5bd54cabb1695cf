"""Rounded polyhedra against statics, rigid impacts, closed forms and themselves."""

import numpy as np
import rigid_bodies as bodies
import same_bits
from rigid_bodies import UPRIGHT, turned

from talus.clumps import Template, core_of, rotation, weighed
from talus.commands.pack_clump import packing_of_clumps
from talus.packing import write_h5
from talus.polyhedra import hull_of, named_points, rounded, template_of_core
from talus.verification import Case, field_steps, read_history

DENSITY, YOUNG, POISSON, G = 2500.0, 1.0e8, 0.2, 9.81
FLOOR = "&wall id = 'w', point = 0, 0, 0, normal = 0, 0, 1, material = 'glass' /\n"
STEP = "&dynamics dt = {!r}, allow_unstable = .true. /\n"
MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  # of two equal bodies


def write(
    case: Case, name: str, templates: list[Template], kind: list[int], x: list, quat: list,
    v: list | None = None, omega: list | None = None,
) -> object:  # fmt: skip
    """Write and return a packing of bodies with their centres of mass at x."""
    n = len(kind)
    made = packing_of_clumps(
        templates, np.array(kind), np.ones(n), np.array(x, float), np.array(quat)
    )
    made.clumps.v = np.array(v if v is not None else np.zeros((n, 3)), float)
    made.clumps.omega = np.array(omega if omega is not None else np.zeros((n, 3)), float)
    write_h5(case.folder / f"{name}_pack.h5", made)
    return made


def run_deck(case: Case, name: str, more: str = "", **words: object) -> list:
    """Run the deck with some words set; return the steps of its fields."""
    values = {"GRAVITY": "0.0, 0.0, 0.0", "YOUNG": YOUNG, "FRICTION": 0.0, "DASH": 0.0}
    values |= {"PACK": f"{name}_pack"} | words
    values.setdefault("EVERY", values["END"])
    deck = (case.folder / "deck.nml").read_text()
    for word in sorted(values, key=len, reverse=True):
        deck = deck.replace(word, str(values[word]))
    (case.folder / f"{name}.nml").write_text(deck + more)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    return field_steps(case.folder / f"{name}.h5")


def judge_masses(case: Case) -> None:
    """Judge mass and moments: a cube in closed form, a body without symmetry by directions."""
    cube = rounded(named_points("cube:4e-3"), 0.2)
    core = hull_of(np.random.default_rng(1).normal(size=(7, 3)) * [1e-3, 2e-3, 0.7e-3])
    irregular = template_of_core(core, 4e-4)
    write(case, "mass", [cube, irregular], [0, 1], [[0, 0, 0], [0.05, 0, 0]], [UPRIGHT] * 2)
    end = run_deck(case, "mass", STEP.format(1.0e-6), END=1.0e-5)[-1].clumps
    volume, moment = bodies.rounded_cube(4.0e-3, float(cube.radius[0]))
    case.metric("cube, volume / closed form", end["mass"][0] / DENSITY / volume, 1.0, 1e-12)
    case.metric("cube, moment / closed form", end["inertia"][0, 1] / DENSITY / moment, 1.0, 1e-12)
    volume, _, tensor = weighed(irregular)
    moments = np.linalg.eigvalsh(tensor)
    off = [end["mass"][1] / DENSITY / volume, *np.sort(end["inertia"][1]) / DENSITY / moments]
    case.below("irregular body, mass and moments against talus", float(np.abs(np.array(off) - 1)
               .max()), 1e-12, "whose own are tested by an integral over directions")  # fmt: skip


def judge_rest(case: Case) -> None:
    """Judge a cube on a larger cube on the floor: sinking by Hertz's law, no spin."""
    large, small = (rounded(named_points(f"cube:{a}"), 0.1) for a in ("8e-3", "5e-3"))
    weight = np.array([DENSITY * weighed(t)[0] * G for t in (large, small)])
    loads = weight.sum(), weight[1]
    radii = float(large.radius[0]), float(small.radius[0])
    sink = [bodies.overlap_of(0.25 * f, r, MODULUS) for f, r in zip(loads, radii, strict=True)]
    x = [[0, 0, 4.0e-3], [0, 0, 10.5e-3]]
    write(case, "rest", [large, small], [0, 1], x, [UPRIGHT, turned([0, 0, 1], 0.4)])
    end = run_deck(case, "rest", FLOOR + "&dynamics damping = 500.0 /\n", END=0.1, FRICTION=0.3,
                   GRAVITY=f"0.0, 0.0, {-G}")[-1]  # fmt: skip
    z = end.clumps["x"][:, 2] - [4.0e-3, 10.5e-3]
    case.metric("rest, sinking of the lower cube / Hertz", float(-z[0] / sink[0]), 1.0, 1e-3)
    case.metric("rest, sinking of the upper one", float((z[0] - z[1]) / sink[1]), 1.0, 1e-3)
    held = float(end.clumps["force"][1, 2] / weight[1])
    case.metric("rest, force on the upper cube / its weight", held, 1.0, 1e-5)
    spin = np.abs(end.clumps["omega"]).max() * 5.0e-3 / np.sqrt(G * 5.0e-3)
    case.below("rest, speed of spins / of a fall by an edge", float(spin), 1e-6)


def incline(case: Case, name: str, word: str, angle: float, friction: float) -> dict:
    """Return the motion of a brick on an inclined floor after a start at rest, and its weight."""
    brick = rounded(named_points(word), 0.1)
    height = float(word.split("x")[-1] if "x" in word else word.split(":")[1])
    load = DENSITY * weighed(brick)[0] * G * np.cos(angle)
    sink = bodies.overlap_of(0.25 * load, float(brick.radius[0]), MODULUS)
    write(case, name, [brick], [0], [[0, 0, 0.5 * height - sink]], [UPRIGHT])
    pull = f"{float(G * np.sin(angle))}, 0.0, {float(-G * np.cos(angle))}"
    words = {"FRICTION": friction, "DASH": 0.5, "GRAVITY": pull}
    return run_deck(case, name, FLOOR + "&dynamics /\n", END=0.1, **words)[-1].clumps


def judge_incline(case: Case) -> None:
    """Judge a cube that rests below the angle of friction and slides above, and a tower."""
    friction = 0.4
    for share in (0.9, 1.2):
        angle = float(np.arctan(share * friction))
        end = incline(case, f"slope_{share}", "cube:4e-3", angle, friction)
        drive = G * (np.sin(angle) - friction * np.cos(angle))
        if share < 1.0:
            way = float(end["x"][0, 0]) / 4e-3
            case.below("below the angle of friction, way / edge", way, 1e-3, "elastic shear")
            continue
        case.metric("above it, speed / statics", float(end["v"][0, 0] / (0.1 * drive)), 1.0, 2e-2,
                    "0.1 s, with rocking at the start")  # fmt: skip
        case.below("above it, turn [rad]", bodies.tilt(end["quat"][0]), 1e-3)
    word, radius = "brick:2e-3x4e-3x6e-3", float(rounded(named_points("brick:2e-3x4e-3x6e-3"),
                                                         0.1).radius[0])  # fmt: skip
    critical = (1.0e-3 - radius) / 3.0e-3
    for share in (0.95, 1.05):
        end = incline(case, f"tower_{share}", word, float(np.arctan(share * critical)), 2.0)
        turn = bodies.tilt(end["quat"][0])
        if share < 1.0:
            case.below("tower below tan = b/h, turn [rad]", turn, 1e-2, "overlaps shift the pivot")
        else:
            case.above("tower above tan = b/h, turn [rad]", turn, 0.2)


def judge_impacts(case: Case) -> None:
    """Judge a corner on the floor and an edge on an edge at rising stiffness."""
    errors = []
    for k, young in enumerate((1.0e9, 3.2e10, 1.024e12)):
        errors.append([corner(case, k, young), edges(case, k, young)])
    order = np.log(np.array(errors[0]) / errors[2]) / np.log(1024.0)
    for k, what in enumerate(("corner on a floor", "edge on an edge")):
        case.below(f"{what}, motion that differs / speed", float(errors[2][k]), 5e-3)
        case.metric(f"{what}, order in 1/E", float(order[k]), 0.4, 0.1, "contact time")
    case.figure_data = np.array(errors)


def strike(case: Case, name: str, young: float, time: float, more: str) -> dict:
    """Return the bodies after an impact of the deck, in steps of 1/2000 of a contact."""
    return run_deck(case, name, more + STEP.format(float(time / 2000.0)), YOUNG=young,
                    END=repr(float(6.0 * time)))[-1].clumps  # fmt: skip


def corner(case: Case, k: int, young: float) -> float:
    """Return the error of a brick that strikes the floor with a vertex, over its speed."""
    speed, body = 0.5, rounded(named_points("brick:3e-3x4e-3x5e-3"), 0.1)
    volume, _, tensor = weighed(body)
    mass, quat = DENSITY * volume, turned([1.0, 2.0, 0.5], 0.9)
    turn, (core, radius) = rotation(quat), core_of(body)
    arms = (core.x - weighed(body)[1]) @ turn.T
    arm = arms[arms[:, 2].argmin()]
    time = 3.0 * (mass**2 / (radius * young**2 * speed)) ** 0.2
    height = -arm[2] + radius + 0.5 * speed * time
    n, spread = np.array([0.0, 0.0, 1.0]), turn @ np.linalg.inv(DENSITY * tensor) @ turn.T
    lever = np.cross(arm - radius * n, n)
    push = 2.0 * speed / (1.0 / mass + lever @ spread @ lever)
    wanted = np.array([0.0, 0.0, -speed]) + push * n / mass, push * spread @ lever
    write(case, f"corner_{k}", [body], [0], [[0, 0, height]], [quat], [[0, 0, -speed]])
    end = strike(case, f"corner_{k}", young, time, FLOOR)
    off = np.linalg.norm(end["v"][0] - wanted[0]) / speed
    return float(off + np.linalg.norm(end["omega"][0] - wanted[1]) * np.linalg.norm(arm) / speed)


def edges(case: Case, k: int, young: float) -> float:
    """Return the error of two cubes that meet edge across edge, off their centres."""
    speed, body = 0.5, rounded(named_points("cube:4e-3"), 0.1)
    volume, _, tensor = weighed(body)
    mass, radius, moment = DENSITY * volume, float(body.radius[0]), DENSITY * tensor[0, 0]
    quats = [turned([1, 0, 0], 0.25 * np.pi), turned([0, 1, 0], 0.25 * np.pi)]
    half = 2.0e-3 - radius
    time = 3.0 * (mass**2 / (radius * young**2 * speed)) ** 0.2
    apart = 2.0 * (np.sqrt(2.0) * half + radius) + speed * time
    shift = np.array([0.6e-3, 0.8e-3, 0.0])
    x = np.array([[0.0, 0.0, 0.0], shift + [0.0, 0.0, apart]])
    n = np.array([0.0, 0.0, 1.0])
    # the lower edge runs along x at y = 0, the upper one along y at x = shift
    at = np.array([shift[0], 0.0, 0.0])
    levers = [np.cross(at, n), np.cross(at - shift, n)]
    push = 2.0 * (2.0 * speed) / (2.0 / mass + sum(a @ a for a in levers) / moment)
    v = np.array([[0, 0, speed], [0, 0, -speed]])
    write(case, f"edges_{k}", [body], [0, 0], x, quats, v)
    end = strike(case, f"edges_{k}", young, time, "")
    off = 0.0
    for i, sense in enumerate((-1.0, 1.0)):
        off += np.linalg.norm(end["v"][i] - v[i] - sense * push * n / mass) / speed
        spin = sense * push * levers[i] / moment
        off += np.linalg.norm(end["omega"][i] - spin) * half / speed
    return float(off)


def judge_flight(case: Case) -> None:
    """Judge a brick in free flight by Euler's equations."""
    brick = rounded(named_points("brick:2e-3x3e-3x5e-3"), 0.1)
    errors = []
    for k, step in enumerate((4.0e-6, 2.0e-6)):
        write(case, f"flight_{k}", [brick], [0], [[1e-3, 2e-3, 3e-3]], [UPRIGHT],
              [[0.1, -0.05, 0.2]], [[10.0, 300.0, 20.0]])  # fmt: skip
        steps = run_deck(case, f"flight_{k}", STEP.format(step), END=0.1)
        first, last = steps[0].clumps, steps[-1].clumps
        spins = [rotation(c["principal"][0]).T @ c["omega"][0] for c in (first, last)]
        exact = bodies.spin_rates(first["inertia"][0], spins[0], 0.1, 10000)
        errors.append(np.linalg.norm(spins[1] - exact) / np.linalg.norm(exact))
    case.below("flight, spin against Euler's equations", float(errors[1]), 1e-3)
    case.metric("flight, order of the spin", float(np.log2(errors[0] / errors[1])), 2.0, 0.1)
    momenta = [rotation(c["principal"][0]) @ (c["inertia"][0] * spin)
               for c, spin in zip((first, last), spins, strict=True)]  # fmt: skip
    change = np.linalg.norm(momenta[1] - momenta[0]) / np.linalg.norm(momenta[0])
    case.below(
        "flight, change of angular momentum",
        float(change),
        2.2e-11,
        "50 000 steps, two roundings of 2.2e-16 each",
    )


def judge_gaps(case: Case) -> None:
    """Judge the least gap of random pairs of two bodies against a search over their features."""
    rng = np.random.default_rng(11)
    kinds = [rounded(named_points(w), 0.1) for w in ("dodecahedron:1.5e-3", "tetrahedron:5e-3")]
    x, quat, wanted = [], [], []
    for k in range(24):
        turns = rng.normal(size=(2, 4))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        cores = [core_of(t) for t in kinds]
        overlap = 0.2 * rng.uniform() * min(radius for _, radius in cores)
        place = bodies.until_overlap(cores, turns, way, overlap)
        x += [[0.03 * k, 0.0, 0.0], [0.03 * k, 0.0, 0.0] + place]
        quat += [*turns]
        wanted.append(bodies.overlap_of_cores(cores, turns, place))
    write(case, "gaps", kinds, [0, 1] * 24, x, quat)
    end = run_deck(case, "gaps", STEP.format(1.0e-12), END=1.0e-12)[0].contacts
    found = np.zeros(24)
    owner = np.cumsum([len(kinds[k % 2].radius) for k in range(48)])
    pair = np.searchsorted(owner, end["ids"][:, 0], side="left") // 2
    np.maximum.at(found, pair, end["overlap"])
    off = np.abs(found - wanted).max() / 5.0e-3
    case.below("largest overlap of 24 random pairs that differs / size", float(off), 1e-10)
    case.above("least of these overlaps / size", float(np.min(wanted)) / 5e-3, 1e-6)


def judge_cycle(case: Case) -> None:
    """Judge the energy of bodies that collide in a cell without friction and loss."""
    kinds = [rounded(named_points(w), 0.15) for w in ("cube:4e-3", "tetrahedron:6e-3")]
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3)
    quat = rng.normal(size=(8, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    v, spin = rng.normal(0.0, 0.3, (8, 3)), rng.normal(0.0, 100.0, (8, 3))
    closures = []
    for k, step in enumerate((2.0e-6, 1.0e-6)):
        made = write(case, f"cycle_{k}", kinds, [0, 1] * 4, grid * 6.5e-3 + 3.2e-3, quat, v, spin)
        made.cell = np.eye(3) * 13.0e-3
        write_h5(case.folder / f"cycle_{k}_pack.h5", made)
        run_deck(case, f"cycle_{k}", "&cell /\n" + STEP.format(step), END=0.06, EVERY=1e-3)
        rows = read_history(case.folder / f"cycle_{k}_energy.csv")
        closures.append(np.abs(rows["closure_error"]).max() / rows["kinetic"][0])
    case.below("elastic collisions, change of the energy", float(closures[1]), 3e-4)
    case.above("elastic collisions, gain by half the step", float(closures[0] / closures[1]), 1.5)
    case.above("they have collided: elastic / kinetic", float((rows["elastic"]
               / rows["kinetic"]).max()), 0.02)  # fmt: skip


def judge_bed(case: Case) -> None:
    """Judge a bed of bodies and spheres: ledger, threads, restart; one vertex is a sphere."""
    rng = np.random.default_rng(5)
    kinds = [rounded(named_points(w), 0.15) for w in ("cube:3e-3", "octahedron:3e-3")]
    ball = Template(np.zeros((1, 3)), np.array([1.0e-3]))
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
    x = (grid + 0.6 + rng.uniform(-0.05, 0.05, grid.shape)) * 5.5e-3
    quat = rng.normal(size=(27, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    v = rng.normal(0.0, 0.2, x.shape)
    kind = [k % 3 for k in range(27)]
    more = FLOOR + "&dynamics dt = 2.0e-6 /\n&checkpoint every_time = 0.012, keep = 3 /\n"
    words = {"END": 0.04, "GRAVITY": f"0.0, 0.0, {-G}", "FRICTION": 0.4, "DASH": 0.2}
    ends = []
    for name, one in (("bed", None), ("point", [np.array([0])])):
        ball.corners = one
        write(case, name, [*kinds, ball], kind, x, quat, v)
        ends.append(run_deck(case, name, more, **words)[-1].clumps)
    same = all((ends[0][key] == ends[1][key]).all() for key in ("x", "quat", "v", "omega"))
    case.metric("one vertex as a sphere: the same bits", float(same), 1.0, 0.0)
    ledger = read_history(case.folder / "bed_energy.csv")
    closure = abs(ledger["closure_error"][-1]) / ledger["kinetic"].max()
    case.below("bed, closure error / energy", float(closure), 1e-3)
    same_bits.judge(case, "bed", "bed, ")


def run(case: Case) -> None:
    """Judge all; plot the limit of stiff impacts."""
    judge_masses(case)
    judge_rest(case)
    judge_incline(case)
    judge_impacts(case)
    judge_flight(case)
    judge_gaps(case)
    judge_cycle(case)
    judge_bed(case)
    bodies.plot_limit(case, case.figure_data, ["corner on a floor", "edge across edge"])
