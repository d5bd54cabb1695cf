"""A ball dropped into glass beads: depth over height and density, and the time to stop."""

import numpy as np

from talus.compare import extent, max_of
from talus.generate import cloud, lattice
from talus.packing import FIXED, FREE, Packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

D, SPREAD, DENSITY, GRAVITY = 4.0e-3, 0.1, 2500.0, 9.81  # of the beads [m], [-], [kg/m3], [m/s2]
BALL = 6.0 * D  # diameter of the ball [m]
SIDE, DEEP = 18.0 * D, 16.0 * D  # of the bed [m]
MIDDLE = (0.5, 0.5)  # of the bed, in sides
HEIGHTS = (1.0, 3.0, 8.0, 20.0)  # free fall, in diameters of the ball, at a density of 2500
DENSITIES = (600.0, 2500.0, 8000.0)  # of the ball [kg/m3], at the third height
PLACES = ((0.0, 0.0), (0.5, 0.0))  # where the ball of the third height falls again, in sides
LONG, HIGH, WIDTH, REACH = 24.0 * D, 12.0 * D, 4.0 * D, 64.0 * D  # of the heap [m]
GATE, WAY, REST = 0.08, 22.0 * D, 0.3  # [m/s], [m], [s]


def run(case: Case) -> None:
    """Settle a bed, measure its friction by a heap, drop balls, compare."""
    friction = float(np.tan(np.radians(repose(case))))
    bed = settled(case)
    level, bulk = surface_of(bed)
    falls = [(h, 2500.0, MIDDLE) for h in HEIGHTS]
    falls += [(HEIGHTS[2], density, MIDDLE) for density in DENSITIES if density != 2500.0]
    falls += [(HEIGHTS[2], 2500.0, place) for place in PLACES]
    found = [drop(case, bed, level, fall) for fall in falls]
    for item in found:
        item["law"] = published(item, bulk, friction)
    judge(case, found)
    draw(case, found, bed, level)


def repose(case: Case) -> float:
    """Slope [deg] that the beads keep when a gate goes away slowly."""
    base = lattice("sc", (round(REACH / D), round(WIDTH / D), 1), D, np.full(3, 0.5 * D))
    base.x += [0.5 * D, 0.5 * D, -0.5 * D]
    base.kind[:] = FIXED
    count = int(0.6 * LONG * WIDTH * HIGH / (np.pi / 6.0 * D**3))
    sizes = 0.5 * D * np.random.default_rng(8).uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    loose = cloud(sizes, np.array([LONG, WIDTH, 2.2 * HIGH]), np.ones(3), seed=8)
    write_h5(case.folder / "heap_start.h5", loose.join(base.renumbered(count)))
    words = {"WIDTH": f"{WIDTH}", "LONG": f"{LONG}", "GATE": f"{GATE}",
             "T_END": f"{WAY / GATE + REST:.6g}"}  # fmt: skip
    for part in ("heap_settle", "heap"):
        go(case, part, f"{part}_run", words)
    last = field_steps(case.folder / "heap_run.h5")[-1].grains
    free = last["kind"] == FREE
    x, top = last["x"][free], np.zeros((round(REACH / D), 4))
    column = np.clip((x[:, 0] / D).astype(int), 0, len(top) - 1)
    lane = np.minimum(np.floor(np.mod(x[:, 1], WIDTH) / D).astype(int), 3)
    np.maximum.at(top, (column, lane), x[:, 2] + last["axes"][free, 0])
    height = top.mean(axis=1)
    crest = np.median(height[:4])
    end = int(np.argmax(height < 0.15 * crest))
    start = int(np.flatnonzero(height[:end] > 0.85 * crest)[-1])
    line = np.polyfit(D * (np.arange(start, end) + 0.5), height[start:end], 1)
    return float(np.degrees(np.arctan(-line[0])))


def go(case: Case, part: str, name: str, words: dict[str, str]) -> None:
    """Write a deck with its words filled in, and run it."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")


def settled(case: Case) -> Packing:
    """Return a loose bed, periodic along x and y."""
    count = int(0.59 * SIDE**2 * DEEP / (np.pi / 6.0 * D**3))
    sizes = 0.5 * D * np.random.default_rng(4).uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    loose = cloud(sizes, np.array([SIDE, SIDE, 2.0 * DEEP]), np.ones(3), seed=4)
    write_h5(case.folder / "start.h5", loose)
    write_stl(case, 3)
    go(case, "settle", "settle_run", {"SIDE": f"{SIDE}"})
    return read_packing(case.folder / "bed.h5")


def write_stl(case: Case, times: int) -> None:
    """Write the ball as an octahedron that is refined some times, its corners on the sphere."""
    tips = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    sides = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    triangles = tips[sides]
    for _ in range(times):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (p + q for p, q in ((a, b), (b, c), (c, a)))
        ab, bc, ca = (p / np.linalg.norm(p, axis=1, keepdims=True) for p in (ab, bc, ca))
        triangles = np.concatenate(
            [np.stack(part, 1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corner"] = 0.5 * BALL * triangles
    head = b"ball".ljust(80) + np.uint32(len(rows)).tobytes()
    (case.folder / "ball.stl").write_bytes(head + rows.tobytes())


def surface_of(bed: Packing) -> tuple[float, float]:
    """Mean level of the surface [m] and density of the bed [kg/m3]."""
    volume = 4.0 / 3.0 * np.pi * bed.axes[:, 0] ** 3
    low, high = 3.0 * D, DEEP - 4.0 * D
    core = (bed.x[:, 2] > low) & (bed.x[:, 2] < high)
    fraction = volume[core].sum() / (SIDE**2 * (high - low))
    # what lies above the core would reach up to the level if it were as dense
    above = bed.x[:, 2] > high
    level = high + volume[above].sum() / (SIDE**2 * fraction)
    return float(level), float(fraction * DENSITY)


def drop(case: Case, bed: Packing, level: float, fall: tuple) -> dict:
    """Let a ball fall by some of its diameters; return its depth over time."""
    height, density, place = fall
    name = f"h{height:g}_{density:g}_{place[0]:g}_{place[1]:g}"
    start = float((bed.x[:, 2] + bed.axes[:, 0]).max()) + 0.5 * BALL
    left = height * BALL - (start - 0.5 * BALL - level)
    words = {
        "NAME": name, "SIDE": f"{SIDE}", "SPEED": f"{-np.sqrt(2.0 * GRAVITY * left):.9g}",
        "PLACE": f"{place[0] * SIDE:.9g}, {place[1] * SIDE:.9g}, {start:.9g}",
        "MASS": f"{density * np.pi / 6.0 * BALL**3:.9g}",
    }  # fmt: skip
    go(case, "drop", name, words)
    rows = read_history(case.folder / f"{name}_bodies.csv")
    depth = level - rows["z"] + 0.5 * BALL
    energy = read_history(case.folder / f"{name}_energy.csv")
    last = field_steps(case.folder / f"{name}.h5")[-1].grains
    final = float(depth[-20:].mean())
    first = float(np.interp(0.0, depth, rows["time"]))
    return {
        "name": name, "place": place, "density": density, "fall": height * BALL, "final": final,
        "time": rows["time"] - first, "depth": depth,
        "stop": float(rows["time"][np.argmax(depth > 0.95 * final)]) - first,
        "lost": float((last["x"][:, 2] < 0.0).sum() + len(bed.id) - len(last["id"])),
        "closure": extent(energy["relative_closure"]), "creep": float(np.ptp(depth[-20:])),
        "grains": last,
    }  # fmt: skip


def published(item: dict, bulk: float, friction: float) -> dict:
    """Depth and time to stop by the published laws.

    Uehara et al.: depth = 0.14 / mu (rho_b / rho_g)^1/2 D_b^2/3 H^1/3, H = fall + depth; here
    the factor found in its place. Katsuragi and Durian: m z'' = m g - k z - m z'^2 / d_1 with
    d_1 = 0.25 / mu rho_b / rho_g D_b and k D_b = 12 mu (rho_g / rho_b)^1/2 m g.
    """
    ratio = item["density"] / bulk
    total = item["fall"] + item["final"]
    scale = np.sqrt(ratio) * BALL ** (2.0 / 3.0) * total ** (1.0 / 3.0) / friction
    length = 0.25 / friction * ratio * BALL
    stiff = 12.0 * friction / np.sqrt(ratio) * GRAVITY / BALL
    z, v, t, dt = 0.0, np.sqrt(2.0 * GRAVITY * item["fall"]), 0.0, 1.0e-6
    path = [(0.0, 0.0)]
    while v > 0.0:
        v += dt * (GRAVITY - stiff * z - v * v / length)
        z, t = z + dt * v, t + dt
        path.append((t, z))
    way = np.array(path)
    stop = float(way[np.argmax(way[:, 1] > 0.95 * z), 0])
    return {"factor": item["final"] / scale, "scale": scale, "depth": z, "stop": stop,
            "path": way}  # fmt: skip


def judge(case: Case, found: list[dict]) -> None:
    """Exponents and factor of the depth, time to stop, scatter, rest, mass, ledger."""
    heights, middle = found[:4], found[2]
    total = [item["fall"] + item["final"] for item in heights]
    power = np.polyfit(np.log(total), np.log([item["final"] for item in heights]), 1)[0]
    case.metric("exponent of the depth over the total height", float(power), 1.0 / 3.0, 0.07,
                "1/3 (Uehara et al., Ambroso et al.)")  # fmt: skip
    balls = [found[4], middle, found[5]]
    # at a given H: the small change of H with the depth is taken out by its own published power
    even = [i["final"] / (i["fall"] + i["final"]) ** (1.0 / 3.0) for i in balls]
    power = np.polyfit(np.log([item["density"] for item in balls]), np.log(even), 1)[0]
    case.metric("exponent of the depth over the density of the ball", float(power), 0.5, 0.1,
                "1/2 (Uehara et al., Ambroso et al.)")  # fmt: skip
    factor = float(np.mean([item["law"]["factor"] for item in found]))
    case.metric("factor of the depth, mean", factor, 0.14, 0.035, "0.14 (Uehara et al.)")
    depth = float(np.mean([item["final"] / item["law"]["depth"] for item in found]))
    case.metric("depth / that by the force law, mean", depth, 1.0, 0.25, "Katsuragi and Durian")
    stop = float(np.mean([item["stop"] / item["law"]["stop"] for item in found]))
    case.metric("time to 0.95 of the depth / that by the force law, mean", stop, 1.0, 0.25,
                "Katsuragi and Durian")  # fmt: skip
    case.below("time to 0.95 of the depth, highest over lowest fall",
               heights[3]["stop"] / heights[0]["stop"], 1.0,
               "a faster ball stops sooner")  # fmt: skip
    same = np.array([middle["final"], *(item["final"] for item in found[6:])])
    case.below("depth at three places, range over mean", float(np.ptp(same) / same.mean()), 0.15)
    case.below("motion in the last 10 ms / diameter of the ball",
               max_of(item["creep"] / BALL for item in found), 0.02)  # fmt: skip
    case.below("beads lost", max_of(item["lost"] for item in found), 0.0)
    case.below("closure of the ledger, relative", max_of(i["closure"] for i in found), 5e-3)


def draw(case: Case, found: list[dict], bed: Packing, level: float) -> None:
    """Depth over time, depth over the published scale, and a cut through the bed."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(14.0, 4.4))
    for k, item in enumerate(found[:6]):
        label = f"{item['fall'] / BALL:g} D, {item['density']:g} kg/m$^3$"
        ax.plot(1e3 * item["time"], item["depth"] / BALL, color=f"C{k}", label=label)
        path = item["law"]["path"]
        ax.plot(1e3 * path[:, 0], path[:, 1] / BALL, ":", color=f"C{k}", lw=0.9)
    ax.set(xlabel="time since touch [ms]", ylabel="depth / diameter of the ball", xlim=(0.0, 140.0),
           ylim=(0.0, None), title="dotted: force law of Katsuragi and Durian")  # fmt: skip
    ax.legend(fontsize=7)
    scale = np.array([item["law"]["scale"] for item in found]) / BALL
    line = np.linspace(0.0, 1.1 * scale.max(), 2)
    ax2.plot(line, 0.14 * line, "k", lw=1.0, label="Uehara et al. 2003: 0.14")
    ax2.plot(scale, [item["final"] / BALL for item in found], "o", label="Talus")
    ax2.set(xlabel=r"$(\rho_b/\rho_g)^{1/2}\,(H/D_b)^{1/3}/\mu$",
            ylabel="depth / diameter of the ball")  # fmt: skip
    ax2.legend(fontsize=8)
    beads, item = found[3]["grains"], found[3]
    near = np.abs(beads["x"][:, 1] - 0.5 * SIDE) < 0.6 * D
    ax3.scatter(np.mod(beads["x"][near, 0], SIDE) / D, (beads["x"][near, 2] - level) / D, s=14)
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    ax3.plot(0.5 * (SIDE + BALL * np.cos(angle)) / D,
             (0.5 * BALL * (1.0 + np.sin(angle)) - item["final"]) / D, "C1")  # fmt: skip
    ax3.set(xlabel="x / diameter of a bead", ylabel="height over the surface / diameter",
            aspect="equal", title="fall of 20 diameters of the ball")  # fmt: skip
    case.save(fig)
