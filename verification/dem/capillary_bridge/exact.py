"""Capillary bridges pulled apart, hanging columns, and wet grains in a box."""

import numpy as np
import same_bits

from talus.compare import difference, extent, max_of
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, TENSION, SPEED, TOUCH = 1.0e-3, 0.072, 0.01, 1.0e-9
MASS = 2650.0 * 4.0 / 3.0 * np.pi * RADIUS**3
STEPS, EXACT = 4000, 1.0e-10
RATIO = 1.0e-3  # V/R3
SETTLED = 4.5e-3  # overlap over diameter at which Hertz and bridge balance, about
# angle [deg] and volume [m3], separations [m], pulls of the profiles of Young and Laplace [N]
PROFILES = (
    ((0.0, 1.0e-13), (0.0, 5.0e-6, 2.0e-5, 4.0e-5),
     (4.363100e-4, 2.128432e-4, 3.764579e-5, 1.159971e-5)),
    ((0.0, 1.0e-12), (0.0, 5.0e-6, 1.0e-5, 2.0e-5, 4.0e-5, 6.0e-5, 8.0e-5),
     (4.235041e-4, 3.485354e-4, 2.794497e-4, 1.758846e-4, 7.938357e-5, 4.432336e-5, 2.781338e-5)),
    ((20.0, 1.0e-12), (0.0, 5.0e-6, 1.0e-5, 2.0e-5, 4.0e-5, 6.0e-5, 8.0e-5, 1.0e-4),
     (3.949067e-4, 3.258413e-4, 2.619744e-4, 1.658891e-4, 7.598957e-5, 4.332351e-5, 2.825793e-5,
      1.918778e-5)),
)  # fmt: skip
TABLE = 2.0e-3  # cubics over 20 intervals, places between rows of the history
APART = (0.75, 1.08)  # closed form over the profile, as published for these volumes
BODIES = {
    "driven": "&driven ids = 2, velocity = SPEED, 0.0, 0.0 /\n",
    "walls": "&wall id = 'plane', point = PLACE, 0.0, 0.0, normal = -1.0, 0.0, 0.0, velocity = "
    "SPEED, 0.0, 0.0, material = 'glass' /\n",
    "surfaces": "&surface id = 'sheet', rectangle = PLACE, -0.02, -0.02, PLACE, 0.02, -0.02, "
    "PLACE, 0.02, 0.02, velocity = SPEED, 0.0, 0.0, material = 'glass' /\n",
}


class Bridge:
    """The closed form for an angle [deg], a volume [m3] and R = 2 R_e [m]."""

    def __init__(self, angle: float, volume: float, radius: float = RADIUS) -> None:
        """Derive the pull at touch and the rupture distance."""
        self.angle, self.volume = angle, volume
        self.stretch = np.sqrt(radius / volume)
        self.first = 2.0 * np.pi * radius * TENSION * np.cos(np.radians(angle))
        self.end = (1.0 + np.radians(angle) / 2.0) * (
            volume ** (1 / 3) + volume ** (2 / 3) / 10.0 / radius
        )

    def pull(self, distance: np.ndarray) -> np.ndarray:
        """Return the pull at separations up to rupture [N]."""
        s = np.maximum(distance, 0.0) * self.stretch
        return self.first / (1.0 + 1.05 * s + 2.5 * s**2)

    def energy(self) -> float:
        """Return the work from touch to rupture by Gauss' rule [J]."""
        x, w = np.polynomial.legendre.leggauss(200)
        return float(self.end / 2 * np.sum(w * self.pull(self.end / 2 * (x + 1))))


def moved(
    case: Case, name: str, bridge: Bridge, axes: list, body: str = "driven", sign: float = 1.0,
    steps: int = STEPS, form: str = "closed", ratio: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, dict, dict]:  # fmt: skip
    """Move a body away from the first grain, or (sign -1) to it from within its reach.

    Return separation, pull on the body, its history and the ledger.
    """
    begin = -TOUCH if sign > 0 else 0.9 * bridge.end
    end = (1.2 * bridge.end if sign > 0 else begin + TOUCH) / SPEED
    axes = np.array(axes)
    x = np.array([[0.0, 0.0, 0.0], [axes[:, 0].sum() + begin, 0.0, 0.0]])
    kind, speed = np.array([0, 2], dtype=np.int32), np.array([[0.0] * 3, [sign * SPEED, 0.0, 0.0]])
    place = axes[:, 0].sum()
    if body != "driven":
        x, axes, kind, speed, place = x[:1], axes[:1], kind[:1], speed[:1], axes[0, 0]
    write_packing(case.folder / "pair.h5", x, axes, kind=kind, v=speed)
    text = (case.folder / "pair.nml").read_text().replace("FORM", form) + BODIES[body]
    if ratio:
        text = text.replace("bridge_volume = VOLUME", f"bridge_ratio = {ratio}")
    rows = 200 if steps == STEPS else 2000
    words = {"ANGLE": bridge.angle, "VOLUME": bridge.volume, "END": end, "STEP": end / steps,
             "ROW": end / rows, "PLACE": place + begin, "SPEED": sign * SPEED}  # fmt: skip
    for word, value in words.items():
        text = text.replace(word, f"{value:.15e}")
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml")
    rows = read_history(case.folder / f"{name}_{body}.csv")
    gap = rows["x"] - place if "x" in rows else begin + sign * SPEED * rows["time"]
    return gap, -rows["force_x"], rows, read_history(case.folder / f"{name}_energy.csv")


def curve(case: Case, name: str, bridge: Bridge, gap: np.ndarray, pull: np.ndarray) -> None:
    """Judge a pull against the closed form, and that it ends where it should."""
    lives = (gap > 0) & (gap < bridge.end * 0.9999)
    case.below(f"{name}: largest difference to the closed form / pull at touch",
               max_of(abs(pull - bridge.pull(gap))[lives]) / bridge.first, EXACT)  # fmt: skip
    case.metric(f"{name}: pull beyond rupture", max_of(abs(pull[gap > bridge.end * 1.0001])), 0.0,
                0.0)  # fmt: skip


def pairs(case: Case, ax: object) -> None:
    """Judge pulls of equal spheres, and their energies; plot them with the exact profiles."""
    ball = [RADIUS] * 3
    for k, ((angle, volume), places, pulls) in enumerate(PROFILES):
        bridge, name = Bridge(angle, volume), f"pair_{k}"
        gap, pull, rows, ledger = moved(case, name, bridge, [ball, ball], steps=120000)
        title = f"{angle:g} deg, {volume:g} m3"
        curve(case, title, bridge, gap, pull)
        # from the overlap of TOUCH at the pull of D = 0; a step is 6e-10 m
        wanted = bridge.energy() + bridge.first * TOUCH
        case.metric(f"{title}: work to rupture / exact", rows["work"][-1] / wanted, 1.0, 1e-6,
                    "a step beyond rupture")  # fmt: skip
        lost = ledger["breakage"][-1] / bridge.energy()
        case.metric(f"{title}: lost at rupture / exact", lost, 1.0, 1e-6, "a step beyond rupture")
        off = max_of(abs(ledger["closure_error"])) / wanted
        case.below(f"{title}: closure / energy", off, 1e-7)
        ratio = bridge.pull(np.array(places)) / np.array(pulls)
        case.above(f"{title}: least of closed form / Young and Laplace", ratio.min(), APART[0])
        case.below(f"{title}: largest of them", ratio.max(), APART[1])
        shown = (gap >= 0) & (np.arange(len(gap)) % 60 == 1)
        ax.plot(gap[shown] * 1e6, pull[shown] * 1e6, "o", ms=4, label=title)
        fine = np.linspace(0, bridge.end, 300)
        ax.plot(fine * 1e6, bridge.pull(fine) * 1e6, "k-", lw=0.8)
        tabled(case, title, name, bridge, places, pulls)
        ax.plot(np.array(places) * 1e6, np.array(pulls) * 1e6, "k+", ms=8)
    ax.set(xlabel="separation [um]", ylabel="pull [uN]", yscale="log", ylim=(5, 600))
    ax.legend(title="+ Young and Laplace")


def tabled(case: Case, title: str, name: str, bridge: Bridge, places: tuple, pulls: tuple) -> None:
    """Judge pulls of the table against profiles of Young and Laplace, and its energies."""
    ball = [RADIUS] * 3
    gap, pull, rows, ledger = moved(case, f"{name}_table", bridge, [ball, ball], steps=20000,
                                    form="table")  # fmt: skip
    lives = pull > 0
    found = np.interp(places, gap[lives], pull[lives])
    off = max_of(abs(found / np.array(pulls) - 1.0))
    case.below(f"{title}, table: largest difference to Young and Laplace / pull", off, TABLE)
    off = max_of(abs(ledger["closure_error"])) / rows["work"][-1]
    case.below(f"{title}, table: closure / energy", off, 1e-7)
    case.metric(f"{title}, table: lost at rupture / work", ledger["breakage"][-1]
                / (rows["work"][-1] - pull[0] * TOUCH), 1.0, 1e-6)  # fmt: skip


def bodies(case: Case) -> None:
    """Judge pulls between other bodies, and that nothing pulls before the touch."""
    ball, tip = [RADIUS] * 3, [2.0e-3, 1.0e-3, 1.0e-3]
    large = [2.0e-3] * 3
    sides = [1.0e-3, 1.5e-3, 2.5e-3]  # radii of curvature where they touch: b2/a and c2/a
    mean = 2.0 / (sides[0] / sides[1] ** 2 + sides[0] / sides[2] ** 2)  # of mean curvature
    runs = (
        ("unequal", "driven", [ball, large], 4.0 / 3.0 * RADIUS),
        ("tips", "driven", [tip, tip], 0.5e-3),
        ("sides", "driven", [sides, sides], mean),
        ("plane", "walls", [ball, ball], 2.0 * RADIUS),
        ("sheet", "surfaces", [ball, ball], 2.0 * RADIUS),
    )
    for name, body, axes, radius in runs:
        bridge = Bridge(10.0, 1.0e-13, radius)
        gap, pull, _, _ = moved(case, name, bridge, axes, body)
        curve(case, name, bridge, gap, pull)
    # in proportion: spheres of 1 and 2 mm have R = 4/3 mm; a flat face no more than a plane
    flat = [0.5e-3, 2.0e-3, 2.0e-3]
    for name, axes, radius, size in (
        ("ratio", [ball, large], 4.0 / 3.0 * RADIUS, 4.0 / 3.0 * RADIUS),
        ("ratio, faces", [flat, flat], 8.0e-3, 1.0e-3 - TOUCH),  # twice the way to the touch
    ):
        bridge = Bridge(10.0, RATIO * size**3, radius)
        gap, pull, _, _ = moved(case, name.replace(", ", "_"), bridge, axes, ratio=RATIO)
        curve(case, name, bridge, gap, pull)
    bridge = Bridge(10.0, 1.0e-13)
    gap, pull, _, _ = moved(case, "approach", bridge, [ball, ball], sign=-1.0)
    case.metric("approach: pull before the touch", max_of(abs(pull[gap > 0])), 0.0, 0.0)


def column(case: Case, layers: int, volume: float) -> np.ndarray:
    """Hang layers of 2 x 2 spheres from a fixed one; return the heights at the end."""
    grid = np.stack(np.meshgrid([0, 1], [0, 1], np.arange(layers + 1), indexing="ij"), -1)
    x = 2.0 * RADIUS * grid.reshape(-1, 3).astype(float)
    x[:, :2] *= 1.01  # columns stand apart, wider than a bridge
    x[:, :2] += 0.2 * RADIUS * (x[:, :2] > 0)
    x[:, 2] *= -(1.0 - SETTLED)
    kind = (x[:, 2] > -RADIUS).astype(np.int32)
    write_packing(case.folder / "column.h5", x, np.full(x.shape, RADIUS), kind=kind)
    text = (case.folder / "column.nml").read_text().replace("VOLUME", f"{volume:.9e}")
    name = f"column_{layers}"
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml")
    return field_steps(case.folder / f"{name}.h5")[-1].grains["x"][:, 2]


def columns(case: Case) -> None:
    """Judge how many layers a bridge carries: F(0)/(m g) spheres, not one more."""
    bridge = Bridge(0.0, 1.0e-13)
    most = int(bridge.first / (MASS * 9.81))
    for layers, falls in ((most, 0.0), (most + 1, 1.0)):
        z = column(case, layers, bridge.volume)
        lowest = -2.0 * RADIUS * layers
        fell = float(z.min() < lowest - bridge.end)
        case.metric(f"column of {layers} layers, {bridge.first / (MASS * 9.81):.2f} bear: falls",
                    fell, falls, 0.0)  # fmt: skip
        rows = read_history(case.folder / f"column_{layers}_liquid.csv")
        case.metric(f"column of {layers} layers: bridges in the end", rows["bridges"][-1],
                    4.0 * layers - 4.0 * falls, 0.0)  # fmt: skip


def shaken(case: Case, ax: object) -> None:
    """Judge the liquid and the ledger of grains that collide, and their bits; plot the bridges."""
    rng = np.random.default_rng(11)
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), -1).reshape(-1, 3)
    x = 1.5e-3 + 2.6e-3 * grid + rng.uniform(-1e-4, 1e-4, (64, 3))
    axes = np.full((64, 3), 1.0e-3)
    axes[::2] = [1.2e-3, 1.0e-3, 0.85e-3]
    quat = rng.normal(size=(64, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    v = rng.normal(scale=0.25, size=(64, 3))
    write_packing(case.folder / "packing.h5", x, axes, quat=quat, v=v, ids=rng.permutation(64) + 1)
    case.run("talus-dem", "shaken.nml")
    rows = read_history(case.folder / "shaken_liquid.csv")
    energy = read_history(case.folder / "shaken_energy.csv")
    volume = 1.0e-12
    case.above("box: bridges that broke", rows["ruptured"][-1], 50.0)
    case.above("box: bridges in the end", rows["bridges"][-1], 1.0)
    case.metric("box: formed - ruptured - there", max_of(abs(
        rows["formed"] - rows["ruptured"] - rows["bridges"])), 0.0, 1e-9)  # fmt: skip
    case.below("box: drawn - returned - held, over drawn",
               max_of(abs(rows["balance"])) / rows["drawn"][-1], 1e-12)  # fmt: skip
    case.below("box: held - bridges x volume, over held",
               max_of(abs(rows["held"] / volume - rows["bridges"])) / rows["bridges"].max(),
               1e-12)  # fmt: skip
    given = max_of(energy["kinetic"] + abs(energy["gravity"]))
    case.below("box: closure / energy", max_of(abs(energy["closure_error"])) / given, 1e-3,
               "pulls that begin and end within a step")  # fmt: skip
    ax.plot(rows["time"] * 1e3, rows["bridges"], "o-", ms=3, label="there")
    ax.plot(rows["time"] * 1e3, rows["ruptured"], "o-", ms=3, label="broken so far")
    ax.set(xlabel="time [ms]", ylabel="bridges [-]")
    ax.legend()
    others(case, volume)
    one = field_steps(case.folder / "shaken.h5")[-1].grains
    if not case.ranks:
        case.run("talus-dem", "shaken.nml", "--output=two", ranks=2)
        two = field_steps(case.folder / "two" / "shaken.h5")[-1].grains
        off = max_of(difference(one[k], two[k]) / extent(one[k]) for k in ("x", "v", "omega"))
        case.below("box: two ranks", off, 1e-9, "rounding of sums, which collisions magnify")
        other = read_history(case.folder / "two" / "shaken_liquid.csv")
        case.metric("box: liquid of two ranks", max_of(abs(other["held"] - rows["held"])) / volume,
                    0.0, 1e-9)  # fmt: skip
    same_bits.judge(case, "shaken", "box, ")


def others(case: Case, volume: float) -> None:
    """Judge the liquid of grains in a periodic cell, and where some leave with their bridges."""
    lines = (case.folder / "shaken.nml").read_text().splitlines(keepends=True)
    bare = "".join(k for k in lines if not k.startswith(("&output", "&checkpoint")))
    bodies = ("&wall", "&surface")
    free = "".join(k for k in bare.splitlines(keepends=True) if not k.startswith(bodies))
    sink = "&sink id = 'out', region = 'plane', point = 0.0, 0.0, 6.0e-3, normal = 0.0, 0.0, 1.0, "
    for name, text in (
        ("cell", free.replace("9.81", "0.0") + "&cell size = 11.0e-3, 11.0e-3, 11.0e-3 /\n"),
        ("sink", bare + sink + "every_time = 5.0e-3, start = 8.0e-3 /\n"),
    ):
        (case.folder / f"{name}.nml").write_text(text)
        case.run("talus-dem", f"{name}.nml")
        rows = read_history(case.folder / f"{name}_liquid.csv")
        gone = rows["formed"] - rows["ruptured"] - rows["bridges"]
        off = max_of(abs(rows["balance"] - volume * gone)) / rows["drawn"][-1]
        case.below(f"{name}: balance - liquid of the bridges that left, over drawn", off, 1e-12)
        if name == "cell":
            case.metric("cell: bridges that left", max_of(abs(gone)), 0.0, 1e-9)
        else:
            case.above("sink: bridges that left", gone[-1], 1.0)


def run(case: Case) -> None:
    """Judge pulls, columns and a box of wet grains; plot pulls and bridges."""
    fig, axes = case.figure(ncols=2, figsize=(9.5, 4.0))
    pairs(case, axes[0])
    bodies(case)
    columns(case)
    shaken(case, axes[1])
    case.save(fig)
