"""Columns of spheres collapse in a channel: run-out and height of the deposit over aspect ratio."""

import numpy as np

from talus.compare import max_of
from talus.generate import cloud, lattice
from talus.packing import FIXED, FREE, Packing, make_packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

RADIUS, SPREAD = 2.0e-3, 0.2  # mean [m], relative half width
D = 2.0 * RADIUS
WIDTH, REACH = 4.0 * D, 140.0 * D  # across the channel, of the base [m]
GRAVITY = 9.81
COLUMNS = {"wide": (16.0 * D, (0.5, 1.0, 2.0)), "slender": (8.0 * D, (2.0, 3.5, 6.0))}


def run(case: Case) -> None:
    """Settle two columns, cut them to several heights, let them collapse, fit the laws."""
    found = []
    for name, (length, ratios) in COLUMNS.items():
        bed = settled(case, name, length, max(ratios))
        found += [collapse(case, f"{name}_{ratio:g}", bed, length, ratio) for ratio in ratios]
    judge(case, found)
    draw(case, found)


def volume(packing: Packing, keep: np.ndarray) -> float:
    """Volume of some spheres [m3]."""
    return 4.0 / 3.0 * np.pi * float((packing.axes[keep, 0] ** 3).sum())


def settled(case: Case, name: str, length: float, ratio: float) -> Packing:
    """Grains fallen on a base of fixed grains whose tops lie at z = 0."""
    base = lattice("sc", (round(REACH / D), round(WIDTH / D), 1), D, np.full(3, RADIUS))
    base.x += [RADIUS, RADIUS, -RADIUS]
    base.kind[:] = FIXED
    rng = np.random.default_rng(5)
    solid = 0.62 * length * WIDTH * 1.05 * ratio * length
    count = int(solid / (4.0 / 3.0 * np.pi * RADIUS**3 * (1.0 + SPREAD**2)))
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    box = np.array([length, WIDTH, 2.2 * ratio * length])
    loose = cloud(sizes, box, np.ones(3), seed=5)
    write_h5(case.folder / f"start_{name}.h5", loose.join(base.renumbered(count)))
    words = {"NAME": name, "WIDTH": f"{WIDTH}", "LONG": f"{length}"}
    case.run("talus-dem", write_deck(case, "settle", name, words), "--threads=1")
    return read_packing(case.folder / f"settled_{name}.h5")


def write_deck(case: Case, part: str, name: str, words: dict[str, str]) -> str:
    """Write a deck with its words filled in; return its name."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{part}_{name}.nml").write_text(text)
    return f"{part}_{name}.nml"


def collapse(case: Case, name: str, bed: Packing, length: float, ratio: float) -> dict:
    """Cut a column to its height, let it go; lengths, heights, profile, ledger."""
    free = bed.kind == FREE
    z, top = bed.x[:, 2], np.quantile(bed.x[free, 2], 0.99)
    core = free & (z > 0.2 * top) & (z < 0.8 * top)
    fraction = volume(bed, core) / (length * WIDTH * 0.6 * top)
    order = np.flatnonzero(free)[np.argsort(z[free])]
    wanted = fraction * length * WIDTH * ratio * length
    stack = np.cumsum(4.0 / 3.0 * np.pi * bed.axes[order, 0] ** 3)
    keep = np.concatenate([order[stack <= wanted], np.flatnonzero(~free)])
    column = make_packing(bed.x[keep], bed.axes[keep], bed.quat[keep], bed.kind[keep])
    write_h5(case.folder / f"column_{name}.h5", column)
    height = volume(column, column.kind == FREE) / (fraction * length * WIDTH)
    end = 6.0 * np.sqrt(height / GRAVITY) + 0.15
    words = {"NAME": name, "WIDTH": f"{WIDTH}", "T_END": f"{end:.3f}"}
    case.run("talus-dem", write_deck(case, "collapse", name, words), "--threads=1")
    final = field_steps(case.folder / f"collapse_{name}.h5")[-1].grains
    grains = final["kind"] == FREE
    x, radius = final["x"][grains], final["axes"][grains, 0]
    edges = np.arange(0.0, REACH, D)
    mass = np.histogram(x[:, 0], edges, weights=4.0 / 3.0 * np.pi * radius**3)[0]
    depth = mass / (fraction * WIDTH * D)
    # a few grains roll ahead of the deposit: its front is where all but 1 % of the mass lie behind
    order = np.argsort(x[:, 0])
    share = np.cumsum(radius[order] ** 3) / (radius**3).sum()
    front = float(x[order, 0][int(np.searchsorted(share, 0.99))])
    energy = read_history(case.folder / f"collapse_{name}_energy.csv")
    return {
        "name": name, "length": length, "ratio": height / length, "depth": depth,
        "run_out": (front - length) / length, "left": float(depth[:2].mean()) / length,
        "lost": int(grains.sum() != (column.kind == FREE).sum()) + int((x[:, 2] < -RADIUS).sum()),
        "closure": float(energy["relative_closure"].max()),
        "unrest": float(energy["kinetic"][-1] / abs(energy["gravity"][-1])), "edges": edges,
    }  # fmt: skip


def sand(a: np.ndarray) -> np.ndarray:
    """Run-out of sand in channels (Lube et al. 2005), the lower one where both laws are near."""
    return np.minimum(1.2 * a, 1.9 * a ** (2.0 / 3.0))


def discs(a: np.ndarray) -> np.ndarray:
    """Run-out of discs without walls beside them (Staron and Hinch 2005)."""
    return np.minimum(2.5 * a, 3.25 * a**0.7)


def judge(case: Case, found: list[dict]) -> None:
    """Run-out and height against the published laws, mass, rest and ledgers."""
    for item in found:
        a, run_out = item["ratio"], item["run_out"]
        case.above(f"run-out / that of sand, {item['name']}", float(run_out / sand(a)), 0.9)
        case.below(f"run-out / that of discs, {item['name']}", float(run_out / discs(a)), 1.1)
    exponent, _ = power_law(found, "run_out")
    case.metric("exponent of the run-out", exponent, 1.0, 0.15,
                "1 (Lube, short columns), 0.9 ± 0.1 (Balmforth and Kerswell)")  # fmt: skip
    tall = [item for item in found if item["name"].startswith("slender")]
    exponent, _ = power_law(tall, "left")
    case.metric("exponent of the height, tall columns", exponent, 0.4, 0.15,
                "2/5 (Lube; Balmforth and Kerswell)")  # fmt: skip
    twice = [item["run_out"] for item in found if abs(item["ratio"] - 2.0) < 0.1]
    case.metric("run-out of the slender over the wide column", twice[1] / twice[0], 1.0, 0.25)
    case.below("grains lost", float(sum(item["lost"] for item in found)), 0.0)
    case.below("kinetic energy at the end / work of gravity",
               max_of(item["unrest"] for item in found), 2e-3)  # fmt: skip
    case.below("ledger, largest", max_of(item["closure"] for item in found), 1e-4)


def power_law(items: list[dict], name: str) -> tuple[float, float]:
    """Exponent and factor of a result over the aspect ratio."""
    a, value = (np.log([item[key] for item in items]) for key in ("ratio", name))
    exponent, constant = np.polyfit(a, value, 1)
    return float(exponent), float(np.exp(constant))


def draw(case: Case, found: list[dict]) -> None:
    """Deposits, and run-out and height over the aspect ratio."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.2))
    for item in found:
        x = 0.5 * (item["edges"][1:] + item["edges"][:-1]) / item["length"]
        ax.plot(x, item["depth"] / item["length"], lw=0.9,
                label=f"{item['name'].split('_')[0]}, a = {item['ratio']:.1f}")  # fmt: skip
    ax.set(xlabel="x / width of the column", ylabel="depth / width", xlim=(0.0, 12.0),
           ylim=(0.0, None))  # fmt: skip
    ax.legend(fontsize=8)
    for k, name in enumerate(COLUMNS):
        own = [item for item in found if item["name"].startswith(name)]
        a = [item["ratio"] for item in own]
        ax2.loglog(a, [item["run_out"] for item in own], "os"[k], color="C0",
                   label=f"run-out, {name}")  # fmt: skip
        ax2.loglog(a, [item["left"] for item in own], "os"[k], color="C1", mfc="none",
                   label=f"height, {name}")  # fmt: skip
    a = np.geomspace(0.4, 9.0, 100)
    ax2.loglog(a, sand(a), "0.5", label="sand: 1.2 a, 1.9 a^(2/3)")
    ax2.loglog(a, discs(a), "0.5", ls=":", label="discs: 2.5 a, 3.25 a^0.7")
    ax2.set(xlabel="aspect ratio a", ylabel="run-out, height / width of the column")
    ax2.legend(fontsize=7)
    case.save(fig)
