"""A blade in beds of spheres against the passive wedge, with the friction that the grains show."""

import json

import numpy as np

from talus.compare import max_of
from talus.generate import cloud
from talus.packing import Packing, make_packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

LENGTH, WIDTH, HEIGHT = 0.5, 0.09, 0.21  # of the bed as it falls [m]
RADIUS, SPREAD = 7.0e-3, 0.2  # mean [m], relative half width
RAKE = np.radians(45.0)
LEVEL = 0.185  # top of the bed after it is cut off [m]
SPEED, GO, RAMP, END = 0.1, 0.15, 0.02, 0.57  # [m/s], [s]
WAY = (0.010, 0.040)  # displacement over which the force is averaged [m]
DENSITY, GRAVITY = 2650.0, 9.81
SEEDS = (1, 2, 3)
DEPTH, SHALLOW = 0.1, 0.06  # of the tip [m]
TEST_STRESS, TEST_STRAIN, TEST_COUNT = 2.0e3, 0.3, 1000  # [Pa]; of the plane strain test

MATERIALS = """&material id = 'grain',  density = 2650.0, young = 4.0e7, poisson = 0.25 /
&material id = 'smooth', density = 2650.0, young = 4.0e7, poisson = 0.25 /
&material id = 'blade',  density = 7800.0, young = 4.0e7, poisson = 0.25 /
&contact between = 'grain', 'grain',  law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.3 /
&contact between = 'grain', 'smooth', law = 'hertz_mindlin', friction = 0.0, damping_ratio = 0.3 /
&contact between = 'grain', 'blade',  law = 'hertz_mindlin', friction = 0.4, damping_ratio = 0.3 /
"""
BOX = f"""&wall id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'grain' /
&wall id = 'x0', point = 0.0, 0.0, 0.0, normal = 1.0, 0.0, 0.0, material = 'smooth' /
&wall id = 'x1', point = {LENGTH}, 0.0, 0.0, normal = -1.0, 0.0, 0.0, material = 'smooth' /
&wall id = 'y0', point = 0.0, 0.0, 0.0, normal = 0.0, 1.0, 0.0, material = 'smooth' /
&wall id = 'y1', point = 0.0, {WIDTH}, 0.0, normal = 0.0, -1.0, 0.0, material = 'smooth' /
"""
RUN = "&run title = '{}', t_end = {:.9g}, gravity = 0.0, 0.0, {} /\n"


def run(case: Case) -> None:
    """Settle beds, cut them, test the grains, compare."""
    peak, critical = friction_angles(case)
    cuts = [cut(case, seed, DEPTH) for seed in SEEDS]
    shallow = [cut(case, seed, SHALLOW) for seed in SEEDS]
    force = np.array([c["mean"] for c in cuts])
    case.above("critical friction angle in plane strain [deg]", critical, 15.0, "of round grains")
    sliding = np.degrees(np.arctan(0.4))
    face = float(np.mean([c["face"] for c in cuts]))
    case.below("friction angle of the blade's face [deg]", face, float(sliding),
               "that of the contacts, if none rolled")  # fmt: skip
    case.below("scatter of the beds", float(force.std(ddof=1) / force.mean()), 0.2)
    for name, own in (("", cuts), (", shallow blade", shallow)):
        expected = [wedge(c, phi, c["delta"], c["way"]) for c in own for phi in (peak, critical)]
        ratio = np.mean([c["mean"] for c in own]) / np.mean(expected)
        case.metric(f"mean force / wedge{name}", float(ratio), 1.0, 0.25,
                    "scatter of beds, and a rigid wedge for a soil that yields before")  # fmt: skip
    worst = max_of(c["closure"] for c in (*cuts, *shallow))
    case.below("largest relative closure of the ledger", worst, 1e-4)
    case.metric("75 N of the textbook", textbook(), 75.0, 0.5)
    draw(case, cuts, (peak, critical))


def textbook() -> float:
    """Force at friction 35, blade 23, rake 45 degrees, 0.1 m deep, 0.3 m wide, 14.7 kN/m3 [N]."""
    return 14.7e3 * 0.1**2 * 0.3 * least_factor(np.radians(35.0), np.radians(23.0), 0.0)[0]


def least_factor(phi: float, delta: float, load: float) -> tuple[float, float]:
    """Least N_gamma + load N_q/(cot rake + cot slip) over the slip angle, and that angle [rad].

    `load` is the heap: displacement over depth, its weight spread over the top of the wedge.
    """
    slip = np.radians(np.linspace(5.0, 80.0, 3001))
    open_ = 1.0 / np.tan(RAKE) + 1.0 / np.tan(slip)
    below = np.cos(RAKE + delta) + np.sin(RAKE + delta) / np.tan(slip + phi)
    factor = np.where(below > 0.0, (0.5 * open_ + load) / np.where(below > 0.0, below, 1.0), np.inf)
    k = int(np.argmin(factor))
    return float(factor[k]), float(slip[k])


def wedge(cut: dict, phi: float, delta: float, way: float) -> float:
    """Force of the passive wedge with the heap after a displacement [N]; angles in degrees."""
    factor = least_factor(np.radians(phi), np.radians(delta), way / cut["depth"])[0]
    return cut["weight"] * cut["depth"] ** 2 * WIDTH * factor


def settled(case: Case, seed: int) -> Packing:
    """Grains fallen into the box."""
    name = f"bed_{seed}.h5"
    if not (case.folder / name).exists():
        rng = np.random.default_rng(seed)
        count = int(0.6 * LENGTH * WIDTH * HEIGHT / (4.0 / 3.0 * np.pi * RADIUS**3))
        sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
        tall = np.array([LENGTH, WIDTH, 2.6 * HEIGHT])
        write_h5(case.folder / f"cloud_{seed}.h5", cloud(sizes, tall, np.ones(3), seed=seed))
        deck = RUN.format("bed", 3.0, -GRAVITY) + MATERIALS + BOX
        deck += f"&particles file = 'cloud_{seed}.h5', material = 'grain' /\n"
        deck += "&dynamics dt_factor = 0.4, damping = 2.0 /\n"
        deck += "&equilibrium unbalanced = 1.0e-3, energy_ratio = 1.0e-4, check_every = 500 /\n"
        deck += f"&output every_time = 5.0, packing = '{name}' /\n"
        (case.folder / f"settle_{seed}.nml").write_text(deck)
        case.run("talus-dem", f"settle_{seed}.nml", "--threads=1")
    return read_packing(case.folder / name)


def cut(case: Case, seed: int, depth: float) -> dict:
    """Level a bed, clear what is behind the blade, drive it; force, angle, weight, closure."""
    bed = settled(case, seed)
    radius = bed.axes[:, 0]
    tip = np.array([0.05 + depth / np.tan(RAKE), 0.0, LEVEL - depth])
    up = np.array([-np.cos(RAKE), 0.0, np.sin(RAKE)])
    ahead = (bed.x - tip) @ np.array([np.sin(RAKE), 0.0, np.cos(RAKE)])
    under = bed.x[:, 2] < tip[2] - radius
    keep = (bed.x[:, 2] < LEVEL) & ((ahead > radius) | under)
    name = f"blade_{seed}_{round(1e3 * depth)}"
    write_h5(case.folder / f"{name}_bed.h5",
             make_packing(bed.x[keep], bed.axes[keep], bed.quat[keep]))  # fmt: skip
    corners = [tip - [0.0, 0.01, 0.0], tip + [0.0, WIDTH + 0.01, 0.0]]
    corners.append(corners[1] + 0.3 * up)
    deck = RUN.format("blade", END, -GRAVITY) + MATERIALS + BOX
    deck += f"&particles file = '{name}_bed.h5', material = 'grain' /\n"
    deck += f"&curve id = 'go', times = 0.0, {GO}, {GO + RAMP}, 9.0,\n"
    deck += "  values = 0.0, 0.0, 1.0, 1.0 /\n"
    deck += f"&surface id = 'blade', material = 'blade', velocity = {SPEED}, 0.0, 0.0,\n"
    places = ", ".join(f"{v:.9g}" for v in np.concatenate(corners))
    deck += f"  curve = 'go', rectangle = {places} /\n"
    deck += "&dynamics dt_factor = 0.15 /\n&history every_time = 0.002 /\n"
    deck += "&output every_time = 0.01, fields = 'contacts' /\n"
    (case.folder / f"{name}.nml").write_text(deck)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_surfaces.csv")
    way = rows["x"] - rows["x"][0]
    push = -rows["force_x"] * np.sin(RAKE) - rows["force_z"] * np.cos(RAKE)
    drag = rows["force_x"] * -np.cos(RAKE) + rows["force_z"] * np.sin(RAKE)
    chosen = (way >= WAY[0]) & (way <= WAY[1])
    solid = (bed.x[:, 2] > 0.03) & (bed.x[:, 2] < LEVEL - 0.03)
    volume = LENGTH * WIDTH * (LEVEL - 0.06)
    fraction = 4.0 / 3.0 * np.pi * float((radius[solid] ** 3).sum()) / volume
    energy = read_history(case.folder / f"{name}_energy.csv")
    return {
        "way_all": way, "force_all": np.hypot(push, drag), "depth": depth,
        "mean": float(np.hypot(push[chosen].mean(), drag[chosen].mean())),
        "delta": float(np.degrees(np.arctan2(drag[chosen].mean(), push[chosen].mean()))),
        "face": face_angle(case, name, np.interp(WAY, way, rows["time"])),
        "way": float(way[chosen].mean()), "weight": DENSITY * GRAVITY * fraction,
        "fraction": fraction, "closure": float(energy["relative_closure"].max()),
    }  # fmt: skip


def face_angle(case: Case, name: str, times: np.ndarray) -> float:
    """Direction of the sum of the contacts on the blade's face between two times [deg].

    The force on the whole blade has that of its edge too, on which grains stand below the blade.
    """
    across = np.array([np.sin(RAKE), 0.0, np.cos(RAKE)])
    total = np.zeros(3)
    for step in field_steps(case.folder / f"{name}.h5"):
        if not times[0] <= step.time <= times[1]:
            continue
        contacts = step.contacts
        on_blade = contacts["ids"][:, 0] == contacts["ids"][:, 0].min()
        on_face = on_blade & (contacts["normal"] @ across > 1.0 - 1.0e-6)
        total += contacts["force"][on_face].sum(axis=0)
    return float(np.degrees(np.arctan2(np.hypot(*(total - total @ across * across)[[0, 2]]),
                                       total @ across)))  # fmt: skip


def friction_angles(case: Case) -> tuple[float, float]:
    """Peak and critical angle of the same grains in plane strain, without walls [deg]."""
    rng = np.random.default_rng(9)
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, TEST_COUNT)
    write_h5(case.folder / "test.h5",
             cloud(sizes, np.full(3, 0.24), np.ones(3), seed=9, periodic=True))  # fmt: skip
    common = MATERIALS + "&particles file = 'test.h5', material = 'grain' /\n&cell /\n"
    hold = f"stress = {TEST_STRESS}, rate = 4.0"
    deck = RUN.format("test", 4.0, 0.0) + common
    deck += f"&cell_stress component = 'mean', {hold}, tolerance = 1.0e-3 /\n"
    deck += "&relaxation damping = 'adaptive', dt_factor = 0.15 /\n"
    deck += "&checkpoint every_wall = 600.0 /\n"
    deck += "&equilibrium unbalanced = 1.0e-4, energy_ratio = 1.0e-6, check_every = 200 /\n"
    (case.folder / "press.nml").write_text(deck)
    case.run("talus-dem", "press.nml", "--threads=1")
    start = json.loads((case.folder / "press_summary.json").read_text())["time_s"]
    deck = RUN.format("test", start + TEST_STRAIN / 0.2, 0.0) + common
    deck += "&cell_rate component = 'zz', rate = -0.2 /\n"
    deck += f"&cell_stress component = 'yy', {hold}, gain = 0.3, tolerance = 0.1 /\n"
    deck += "&dynamics dt_factor = 0.3 /\n&history every_time = 2.0e-3 /\n"
    (case.folder / "shear.nml").write_text(deck)
    case.run("talus-dem", "shear.nml", "--threads=1", "--restart=press.chk.h5")
    rows = read_history(case.folder / "shear_cell.csv")
    most, least = rows["stress_zz"], rows["stress_yy"]
    angle = np.degrees(np.arcsin(np.abs(most - least) / np.abs(most + least)))
    strain = 0.2 * (rows["time"] - start)
    smooth = np.convolve(angle, np.ones(15) / 15.0, mode="valid")
    return float(smooth.max()), float(angle[strain > 0.6 * TEST_STRAIN].mean())


def draw(case: Case, cuts: list[dict], angles: tuple[float, float]) -> None:
    """Force over displacement, with the wedge and its heap."""
    fig, ax = case.figure()
    for number, c in zip(SEEDS, cuts, strict=True):
        ax.plot(1e3 * c["way_all"], c["force_all"], lw=0.8, label=f"bed {number}")
    way = np.linspace(0.0, WAY[1], 30)
    delta = np.mean([c["delta"] for c in cuts])
    for phi, style, name in zip(angles, ("k-", "k--"), ("peak", "critical"), strict=True):
        ax.plot(1e3 * way, [wedge(cuts[0], phi, delta, s) for s in way], style, lw=1.2,
                label=f"wedge, {name} {phi:.1f} deg")  # fmt: skip
    ax.axvspan(1e3 * WAY[0], 1e3 * WAY[1], color="0.93")
    ax.set(xlabel="displacement [mm]", ylabel="force [N]", ylim=(0.0, None))
    ax.legend(fontsize=8)
    case.save(fig)
