"""Columns of beads collapse in channels: run-out and height of the deposit over aspect ratio."""

import numpy as np

from talus.compare import max_of
from talus.generate import cloud, lattice
from talus.packing import FIXED, FREE, Packing, make_packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, SPREAD = 2.0e-3, 0.2  # mean [m], relative half width
D = 2.0 * RADIUS
REACH, FLOOR = 180.0 * D, -1.01 * D  # of the base, level of the floor beyond it [m]
GRAVITY = 9.81
CHANNELS = {"open": 4.0 * D, "slot": 5.0 * D}  # widths: periodic, between walls with friction [m]
COLUMNS = {"low": (16.0 * D, (0.5, 1.0, 2.0)), "tall": (8.0 * D, (2.0, 4.0, 8.0))}


def run(case: Case) -> None:
    """Settle columns in two channels, cut them to heights, let them collapse, fit the laws."""
    found = []
    for channel in CHANNELS:
        for name, (_, ratios) in COLUMNS.items():
            bed = settled(case, channel, name, max(ratios))
            found += [collapse(case, bed, (channel, name), ratio) for ratio in ratios]
    judge(case, found)
    draw(case, found)


def volume(packing: Packing, keep: np.ndarray) -> float:
    """Volume of some spheres [m3]."""
    return 4.0 / 3.0 * np.pi * float((packing.axes[keep, 0] ** 3).sum())


def settled(case: Case, channel: str, name: str, ratio: float) -> Packing:
    """Beads fallen on a base of fixed beads whose tops lie at z = 0."""
    width, length = CHANNELS[channel], COLUMNS[name][0]
    base = lattice("sc", (round(REACH / D), round(width / D), 1), D, np.full(3, RADIUS))
    base.x += [RADIUS, RADIUS, -RADIUS]
    base.kind[:] = FIXED
    rng = np.random.default_rng(5)
    solid = 0.62 * length * width * 1.05 * ratio * length
    count = int(solid / (4.0 / 3.0 * np.pi * RADIUS**3 * (1.0 + SPREAD**2)))
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    box = np.array([length, width, 2.2 * ratio * length])
    loose = cloud(sizes, box, np.ones(3), seed=5)
    write_h5(case.folder / f"start_{channel}_{name}.h5", loose.join(base.renumbered(count)))
    deck = write_deck(case, "settle", channel, f"{channel}_{name}", {"LONG": f"{length}"})
    case.run("talus-dem", deck, "--threads=1")
    return read_packing(case.folder / f"settled_{channel}_{name}.h5")


def write_deck(case: Case, part: str, channel: str, name: str, words: dict[str, str]) -> str:
    """Write a deck with its words filled in; return its name."""
    width = CHANNELS[channel]
    sides = f"&cell size = 1.0, {width}, 1.0, origin = 0.0, 0.0, -0.1, periodic = 'b' /"
    if channel == "slot":
        wall = "&wall id = '{}', point = 0.0, {}, 0.0, normal = 0.0, {}, 0.0, material = 'side' /"
        sides = wall.format("near", 0.0, 1.0) + "\n" + wall.format("far", width, -1.0)
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in (words | {"NAME": name, "SIDES\n": sides + "\n"}).items():
        text = text.replace(word, value)
    (case.folder / f"{part}_{name}.nml").write_text(text)
    return f"{part}_{name}.nml"


def cut(case: Case, bed: Packing, kind: tuple[str, str], ratio: float) -> tuple[Packing, float]:
    """Keep the lowest beads up to a height; return the column and its solid fraction."""
    width, length = CHANNELS[kind[0]], COLUMNS[kind[1]][0]
    free = bed.kind == FREE
    z, top = bed.x[:, 2], np.quantile(bed.x[free, 2], 0.99)
    core = free & (z > 0.2 * top) & (z < 0.8 * top)
    fraction = volume(bed, core) / (length * width * 0.6 * top)
    order = np.flatnonzero(free)[np.argsort(z[free])]
    stack = np.cumsum(4.0 / 3.0 * np.pi * bed.axes[order, 0] ** 3)
    wanted = fraction * length * width * ratio * length
    keep = np.concatenate([order[stack <= wanted], np.flatnonzero(~free)])
    return make_packing(bed.x[keep], bed.axes[keep], bed.quat[keep], bed.kind[keep]), fraction


def collapse(case: Case, bed: Packing, kind: tuple[str, str], ratio: float) -> dict:
    """Cut a column to its height, let it go; lengths, heights, profile, ledger."""
    width, length = CHANNELS[kind[0]], COLUMNS[kind[1]][0]
    name = f"{kind[0]}_{kind[1]}_{ratio:g}"
    column, fraction = cut(case, bed, kind, ratio)
    write_h5(case.folder / f"column_{name}.h5", column)
    height = volume(column, column.kind == FREE) / (fraction * length * width)
    end = 6.0 * np.sqrt(height / GRAVITY) + 0.15
    deck = write_deck(case, "collapse", kind[0], name, {"T_END": f"{end:.3f}",
                                                        "FLOOR": f"{FLOOR:.5f}"})  # fmt: skip
    case.run("talus-dem", deck, "--threads=1")
    final = field_steps(case.folder / f"collapse_{name}.h5")[-1].grains
    beads = final["kind"] == FREE
    x, radius = final["x"][beads], final["axes"][beads, 0]
    edges = np.arange(0.0, REACH, D)
    mass = np.histogram(x[:, 0], edges, weights=4.0 / 3.0 * np.pi * radius**3)[0]
    depth = mass / (fraction * width * D)
    # a few beads roll ahead of the deposit: its front is where all but 1 % of the mass lie behind
    order = np.argsort(x[:, 0])
    share = np.cumsum(radius[order] ** 3) / (radius**3).sum()
    front = float(x[order, 0][int(np.searchsorted(share, 0.99))])
    energy = read_history(case.folder / f"collapse_{name}_energy.csv")
    return {
        "name": name, "channel": kind[0], "length": length, "ratio": height / length,
        "depth": depth, "edges": edges, "run_out": (front - length) / length,
        "left": float(depth[:2].mean()) / length,
        "lost": int(beads.sum() != (column.kind == FREE).sum()) + int((x[:, 2] < FLOOR).sum()),
        "closure": float(energy["relative_closure"].max()),
        "unrest": float(energy["kinetic"][-1] / abs(energy["gravity"][-1])),
    }  # fmt: skip


def sand(a: np.ndarray) -> np.ndarray:
    """Run-out in channels (Lube et al. 2005), the lower one where both laws are near."""
    return np.minimum(1.2 * a, 1.9 * a ** (2.0 / 3.0))


def exponent(found: list[dict], channel: str, name: str, least: float = 0.0) -> float:
    """Exponent of a result over the aspect ratio, from columns above an aspect ratio."""
    own = [item for item in found if item["channel"] == channel and item["ratio"] > least]
    return float(np.polyfit(*(np.log([item[k] for item in own]) for k in ("ratio", name)), 1)[0])


def judge(case: Case, found: list[dict]) -> None:
    """Run-out and height against the published laws, mass, rest and ledgers."""
    both = [exponent(found, channel, "run_out") for channel in CHANNELS]
    case.metric("exponent of the run-out, no walls", both[0], 0.9, 0.15,
                "wide channels 0.9 ± 0.1 (Balmforth and Kerswell)")  # fmt: skip
    case.metric("exponent of the run-out, slot", both[1], 0.65, 0.1,
                "narrow slots 0.65 ± 0.05 (Balmforth and Kerswell)")  # fmt: skip
    case.metric("exponent of the run-out, slot less no walls", both[1] - both[0], -0.25, 0.15,
                "0.65 ± 0.05 less 0.9 ± 0.1")  # fmt: skip
    case.metric("exponent of the height, no walls, a > 1.5",
                exponent(found, "open", "left", 1.5), 0.4, 0.1,
                "1 - 0.6 (Balmforth and Kerswell), 2/5 (Lube)")  # fmt: skip
    case.metric("exponent of the height, slot, a > 1.5", exponent(found, "slot", "left", 1.5), 0.5,
                0.1, "1 - 0.5 (Balmforth and Kerswell)")  # fmt: skip
    tall = [i["run_out"] / sand(i["ratio"]) for i in found if i["name"].startswith("open_tall")]
    case.metric("run-out of tall columns / 1.9 a^(2/3), no walls", float(np.mean(tall)), 1.0, 0.3,
                "sand, salt, rice, couscous in channels (Lube)")  # fmt: skip
    pairs = [
        [i["run_out"] for i in found if i["channel"] == c and abs(i["ratio"] - 2.0) < 0.1]
        for c in CHANNELS
    ]
    for channel, (low, slender) in zip(CHANNELS, pairs, strict=True):
        case.metric(f"run-out of 8 over 16 beads long columns, a = 2, {channel}", slender / low,
                    1.0, 0.25)  # fmt: skip
    case.below("beads lost", float(sum(item["lost"] for item in found)), 0.0)
    case.below("kinetic energy at the end / work of gravity",
               max_of(item["unrest"] for item in found), 2e-3)  # fmt: skip
    case.below("ledger, largest", max_of(item["closure"] for item in found), 1e-3)


def draw(case: Case, found: list[dict]) -> None:
    """Deposits, and run-out and height over the aspect ratio."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(14.0, 4.4))
    colours = {"open": "C0", "slot": "C1"}
    for item in found:
        x = 0.5 * (item["edges"][1:] + item["edges"][:-1]) / item["length"]
        ax.plot(x, item["depth"] / item["length"], color=colours[item["channel"]], lw=0.8)
    ax.set(xlabel="x / width of the column", ylabel="depth / width", xlim=(0.0, 14.0),
           ylim=(0.0, None))  # fmt: skip
    a = np.geomspace(0.4, 10.0, 100)
    for axis, name in ((ax2, "run_out"), (ax3, "left")):
        for channel, colour in colours.items():
            own = [item for item in found if item["channel"] == channel]
            label = "Talus, no walls" if channel == "open" else "Talus, slot of 5 beads"
            axis.loglog([i["ratio"] for i in own], [i[name] for i in own], "o", color=colour,
                        label=label)  # fmt: skip
    ax2.loglog(a, sand(a), "0.4", label="Lube 2005: 1.2 a, 1.9 a$^{2/3}$")
    ax2.loglog(a, 1.6 * a**0.9, "C0:", label="a$^{0.9}$: wide, Balmforth and Kerswell 2005")
    ax2.loglog(a, 1.6 * a**0.65, "C1:", label="a$^{0.65}$: slot, factor free")
    ax2.set(xlabel="aspect ratio a", ylabel="run-out / width of the column")
    ax3.loglog(a, np.minimum(a, a**0.4), "0.4", label="Lube 2005: a, a$^{2/5}$")
    ax3.set(xlabel="aspect ratio a", ylabel="height left / width of the column")
    for axis in (ax2, ax3):
        axis.legend(fontsize=7)
    case.save(fig)
