"""Momentum, energy and waves where grains meet the facets of a solid that steps explicitly."""

import json

import h5py
import numpy as np
from coupled import audit_of, write_box, write_deck

from talus.verification import Case, field_steps, write_packing

RADIUS, SPEED = 5.0e-3, 1.0
MASS = 2650.0 * 4 / 3 * np.pi * RADIUS**3
END, EXCHANGE = 1.0e-4, 2.0e-7

YOUNG, DENSITY, SIDE, HEIGHT, ELEMENTS = 1.0e9, 1000.0, 0.01, 0.0025, 120  # of the bar
AREA, WAVE = SIDE**2, float(np.sqrt(YOUNG / DENSITY))
IMPEDANCE = DENSITY * WAVE * AREA
STIFFNESS, BALL = 1.8e6, 5.5e-3  # of the contact [N/m], mass of the sphere [kg]
BAR_END = 2.4e-4  # s: the wave has not come back, the sphere has left
STEPS = (2.0e-6, 1.5e-6, 1.0e-6, 0.75e-6)  # exchanges, s
FIXED = 10  # elements of the bar behind a pressed contact
SPAN, FEW = 1500, 500  # exchanges, and of runs that are unstable


def vectors(audit: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Columns name_x, name_y, name_z as rows of vectors."""
    return np.column_stack([audit[f"{name}_{c}"] for c in "xyz"])


def write_block(case: Case, finer: int = 1) -> None:
    """Write the block of elements of 10 mm over `finer`."""
    cells = (4 * finer, 4 * finer, 3 * finer)
    write_box(case.folder / "block.h5", [-0.02, -0.02, -0.03], [0.02, 0.02, 0.0], cells)


def write_impact(case: Case) -> np.ndarray:
    """Write block and grains; return where the sphere starts [m]."""
    write_block(case)
    ghost = np.array([3.0e-3, -2.0e-3, 0.0])
    lean = np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0])
    sphere = ghost + (2 * RADIUS + 1.0e-6) * lean
    v = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]])
    axes, kind = np.full((2, 3), RADIUS), np.array([1, 0])
    both = np.array([ghost, sphere])
    write_packing(case.folder / "pack.h5", both, axes, kind=kind, v=v, groups={"ghosts": [1]})
    return sphere


def impact(case: Case, kind: str, scheme: str, exchange: float, threads: int = 1) -> dict:
    """Run the impact on the block; return the audit."""
    values = {"kind": kind, "scheme": scheme, "exchange": exchange, "end": END}
    values |= {"threads": threads, "initial": "none"}
    name = f"{kind}_{scheme}.nml"
    case.run("talus-couple", write_deck(case, f"run_{name}", "impact.nml", **values))
    return audit_of(case, f"run_{kind}_{scheme}")


def judge_impact(case: Case, sphere: np.ndarray) -> dict:
    """Judge what is conserved; return the audits."""
    start = np.array([0.0, 0.0, -MASS * SPEED])
    spin, energy = np.cross(sphere, start), 0.5 * MASS * SPEED**2
    kept = {}
    for scheme, work_limit in (("symmetric", 1e-4), ("iterated", 1e-9)):
        off = []
        for exchange in (4 * EXCHANGE, 2 * EXCHANGE, EXCHANGE):
            audit = kept[scheme] = impact(case, "explicit", scheme, exchange)
            parts = ("grains_kinetic", "grains_elastic", "solid_kinetic", "solid_elastic")
            total = sum(audit[p] for p in parts)
            off.append(np.abs(total - energy).max() / energy)
        case.below(f"{scheme}: energy", off[-1], 5e-5, "of second order in the exchange")
        order = float(np.polyfit(np.log([4, 2, 1]), np.log(off), 1)[0])
        case.metric(f"{scheme}: order of the energy in the exchange", order, 2.0, 0.1)
        case.above(f"{scheme}: largest force [N]", np.abs(audit["force_on_solid_z"]).max(), 10.0)
        off = np.linalg.norm(vectors(audit, "momentum") - start, axis=1).max() / (MASS * SPEED)
        case.below(f"{scheme}: momentum", off, 1e-11, "round-off of 500 exchanges")
        turned = np.linalg.norm(vectors(audit, "angular_momentum") - spin, axis=1).max()
        off = turned / np.linalg.norm(spin)
        case.below(f"{scheme}: angular momentum", off, 5e-4, "small displacements, u/x")
        work = np.abs(audit["interface_work_difference"]).max() / energy
        case.below(f"{scheme}: works of both sides", work, work_limit)
    return kept


def judge_twins(case: Case) -> None:
    """Judge the impulse on explicit and Newmark blocks, which differ by their mass matrices."""
    off = []
    for finer in (1, 2):
        write_block(case, finer)
        given = [
            np.cumsum(impact(case, kind, scheme, 2 * EXCHANGE)["force_on_solid_z"])
            for kind, scheme in (("explicit", "symmetric"), ("newmark", "iterated"))
        ]
        off.append(np.abs(given[0] - given[1]).max() / np.abs(given[1][-1]))
    write_block(case)
    case.below("explicit and Newmark block: impulse", off[1], 0.02, "lumped and consistent mass")
    case.above("times less than on twice as large elements", off[0] / off[1], 3.0)


def judge_threads(case: Case) -> None:
    """Judge the bits of the audit on two threads of the solid."""
    name = "run_explicit_symmetric_audit.csv"
    impact(case, "explicit", "symmetric", EXCHANGE)
    one = (case.folder / name).read_bytes()
    impact(case, "explicit", "symmetric", EXCHANGE, 2)
    differs = float(one != (case.folder / name).read_bytes())
    case.metric("symmetric: audit of two threads differs", differs, 0.0, 0.0, "bytes")


def closed_form(t: np.ndarray) -> np.ndarray:
    """Force of a sphere on the end of a semi-infinite bar, F'' + k/Z F' + k/m F = 0 [N]."""
    decay = 0.5 * STIFFNESS / IMPEDANCE
    omega = np.sqrt(STIFFNESS / BALL - decay**2)
    force = STIFFNESS * SPEED / omega * np.exp(-decay * t) * np.sin(omega * t)
    return np.where((t >= 0) & (t <= np.pi / omega), force, 0.0)


def chain_force(times: np.ndarray) -> np.ndarray:
    """Impulse of the contact up to times, of the chain of nodes that the elements are [N s]."""
    nodes = ELEMENTS + 1
    mass = np.full(nodes + 1, DENSITY * AREA * HEIGHT)
    mass[[0, nodes - 1]] *= 0.5
    mass[nodes] = BALL  # meets node 0, behind it the bar
    k = np.zeros((nodes + 1, nodes + 1))
    springs = [(i, i + 1, YOUNG * AREA / HEIGHT) for i in range(nodes - 1)]
    for i, j, stiff in [*springs, (0, nodes, STIFFNESS)]:
        k[np.ix_([i, j], [i, j])] += stiff * np.array([[1, -1], [-1, 1]])
    root = np.sqrt(mass)
    squares, modes = np.linalg.eigh(k / np.outer(root, root))
    omega = np.sqrt(np.maximum(squares, 0.0))
    v0 = modes[nodes] * root[nodes] * SPEED  # of each mode, at the start
    # velocity of the sphere: sum over modes, cos(omega t)
    v = (modes[nodes] / root[nodes] * v0) @ np.cos(np.outer(omega, times))
    return BALL * (SPEED - v)


def write_bar(case: Case) -> None:
    """Bar along -z from its end at 0, ghost on the middle of the end, a sphere before it."""
    half = 0.5 * SIDE
    lower = [-half, -half, -HEIGHT * ELEMENTS]
    write_box(case.folder / "bar.h5", lower, [half, half, 0.0], (1, 1, ELEMENTS))
    both = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -SPEED]])
    axes, kind = np.full((2, 3), RADIUS), np.array([1, 0])
    write_packing(case.folder / "pack.h5", both, axes, kind=kind, v=v, groups={"ghosts": [1]})


def bar(case: Case, scheme: str, exchange: float) -> dict[str, np.ndarray]:
    """Run the bar; return the audit."""
    density = BALL / (4 / 3 * np.pi * RADIUS**3)
    values = {"scheme": scheme, "exchange": exchange, "dt": exchange / 8, "end": BAR_END}
    values |= {"density": f"{density:.17g}", "stiffness": STIFFNESS, "step": exchange / 2}
    for deck in ("bar_grains", "bar_solid"):
        write_deck(case, f"{deck}_run.nml", f"{deck}.nml", **values)
    case.run("talus-couple", write_deck(case, "bar_run.nml", "bar.nml", **values))
    return audit_of(case, "bar_run")


def judge_bar(case: Case) -> dict[str, list[float]]:
    """Judge waves in the bar by the exchange; return the errors by scheme."""
    errors = {}
    for scheme in ("symmetric", "iterated"):
        errors[scheme] = []
        for exchange in STEPS:
            audit = bar(case, scheme, exchange)
            given = np.cumsum(-audit["force_on_solid_z"]) * exchange
            touch = audit["time"] < 1.9e-4  # the sphere still touches
            off = np.abs(given - chain_force(audit["time"]))[touch].max()
            errors[scheme].append(off / (BALL * SPEED))
        order = float(np.polyfit(np.log(STEPS), np.log(errors[scheme]), 1)[0])
        case.below(f"bar, {scheme}: impulse against the chain", errors[scheme][-1], 1e-3)
        case.metric(f"bar, {scheme}: order in the exchange", order, 2.0, 0.2, "second order")
    return errors


def judge_wave(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Judge the last field of the bar against the closed form; return places and velocities."""
    last = field_steps(case.folder / "bar_solid_run.h5")[-1]
    with h5py.File(case.folder / "bar_solid_run.h5") as file:
        x = file["mesh/x"][:]
    z, v = -x[:, 2], -last.solid["v"][:, 2]
    exact = closed_form(BAR_END - z / WAVE) / IMPEDANCE
    off = np.sqrt(np.mean((v - exact) ** 2)) / exact.max()
    case.below("bar: velocity against the wave in a semi-infinite bar, rms", off, 0.02,
               "waves behind its front, which has a kink")  # fmt: skip
    return z, v


def write_pressed(case: Case) -> None:
    """A short bar before a sphere that presses its end and is too heavy to move."""
    half = 0.5 * SIDE
    lower = [-half, -half, -HEIGHT * FIXED]
    write_box(case.folder / "short.h5", lower, [half, half, 0.0], (1, 1, FIXED))
    both = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2 * RADIUS - 1.0e-6]])
    axes, kind = np.full((2, 3), RADIUS), np.array([1, 0])
    write_packing(case.folder / "pack.h5", both, axes, kind=kind, groups={"ghosts": [1]})


def pressed(case: Case, exchange: float, speed: float, scheme: str, span: int) -> tuple[dict, dict]:
    """Run the pressed contact for a span of exchanges; return audit and summary."""
    values = {"scheme": scheme, "exchange": exchange, "dt": exchange / 2, "speed": speed}
    values |= {"end": f"{exchange * span:.17g}", "initial": "dead_load"}
    for deck in ("pressed_grains", "pressed_solid"):
        write_deck(case, f"{deck}_run.nml", f"{deck}.nml", **values)
    case.run("talus-couple", write_deck(case, "pressed_run.nml", "pressed.nml", **values))
    return audit_of(case, "pressed_run"), json.loads(
        (case.folder / "pressed_run_summary.json").read_text()
    )


def judge_pressed(case: Case) -> None:
    """Judge energies of a contact that lasts, on both sides of the exchange that is told."""
    write_pressed(case)
    audit, _ = pressed(case, 2.0e-6, 0.0, "symmetric", SPAN)
    moved = audit["largest_ghost_displacement"].max()
    case.below("pressed, at rest: largest motion [m]", moved, 1e-8, "the sphere moves by 3e-9")
    _, summary = pressed(case, 3.0e-6, -1.0e-3, "symmetric", 30)
    told = summary["interface"]["stable_exchange_s"]
    case.below("pressed: stable exchange over the largest step of the bar",
               told / (HEIGHT / WAVE), 1.2, "the contact is as stiff as the elements")  # fmt: skip
    for share, scheme in ((0.5, "symmetric"), (0.98, "symmetric"), (1.7, "symmetric"),
                          (1.7, "iterated")):  # fmt: skip
        unstable = share > 1 and scheme == "symmetric"
        span = FEW if unstable else SPAN
        audit, _ = pressed(case, float(f"{share * told:.3e}"), -1.0e-3, scheme, span)
        motion = np.sqrt(audit["solid_kinetic"])
        later = motion[span // 2 :].max() / motion[: span // 2].max()
        label = f"pressed, {scheme}, {share} of the stable exchange"
        if unstable:
            case.above(f"{label}: later over earlier motion", later, 2.0, "unstable, as told")
            warned = "W438" in (case.folder / "pressed_run.log").read_text()
            case.above(f"{label}: is warned of", float(warned), 0.5)
        else:
            case.below(f"{label}: later over earlier motion", later, 1.1, "no growth")


def run(case: Case) -> None:
    """Judge impact, twins, bits, waves and a contact that lasts."""
    kept = judge_impact(case, write_impact(case))
    judge_twins(case)
    judge_threads(case)
    write_bar(case)
    errors = judge_bar(case)
    z, v = judge_wave(case)
    judge_pressed(case)
    fig, (left, middle, right) = case.figure(ncols=3, figsize=(11.0, 3.6))
    audit = kept["symmetric"]
    energy = 0.5 * MASS * SPEED**2
    grains = (audit["grains_kinetic"] + audit["grains_elastic"]) / energy
    solid = (audit["solid_kinetic"] + audit["solid_elastic"]) / energy
    for part, label in ((grains, "grain"), (solid, "solid"), (grains + solid, "both")):
        left.plot(1e6 * audit["time"], part, label=label)
    left.set(xlabel="time [µs]", ylabel="energy / energy at the start [-]")
    line = np.linspace(0.0, HEIGHT * ELEMENTS, 400)
    middle.plot(1e3 * line, closed_form(BAR_END - line / WAVE) / IMPEDANCE, label="closed form")
    middle.plot(1e3 * z, v, "o", ms=3, label="Talus")
    middle.set(xlabel="distance from the end [mm]", ylabel="velocity [m/s]")
    for scheme, off in errors.items():
        right.loglog(1e6 * np.array(STEPS), off, "o-", ms=4, label=scheme)
    right.set(xlabel="exchange [µs]", ylabel="error of the impulse / m v [-]")
    for ax in (left, middle, right):
        ax.legend(fontsize=7)
    case.save(fig)
