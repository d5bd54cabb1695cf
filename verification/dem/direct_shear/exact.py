"""Direct shear in a box of two halves against plane strain and simple shear of the same grains."""

import json

import numpy as np

from talus.compare import max_of
from talus.drivers import direct_shear_angle, read_shear_box
from talus.generate import cloud
from talus.packing import write_h5
from talus.verification import Case, read_history

RADIUS, SPREAD = 2.0e-3, 0.2  # mean [m], relative half width
LONG, WIDE, TALL = 0.16, 0.02, 0.08  # of the box as it is filled [m]
COUNT, CUBE_COUNT, CUBE = 2280, 1500, 0.072  # grains of box and cell; edge of the cell [m]
STRESS, SPEED, WAY = 100.0e3, 0.07, 0.012  # [Pa], [m/s], [m]
UPPER, LID, FLANGE = (4, 5, 6, 7), 7, 3  # surfaces of the deck
WINDOW = 11  # rows that are averaged
FILLINGS, CELLS = (1, 2, 3), (3, 4, 5)  # seeds: one pack scatters by 0.7 degrees
RATES = {"plane": ("'zz', rate = -1.0", "'xx'", 0.12), "simple": ("'xz', rate = 3.0", "'zz'", 0.4)}


def run(case: Case) -> None:
    """Shear a box, and a cell of the same grains in plane strain and simple shear; compare."""
    boxes = [box(case, seed) for seed in FILLINGS]
    own = mean_of(boxes)
    cells = [cell(case, seed) for seed in CELLS]
    plane, simple = (mean_of([one[name] for one in cells]) for name in RATES)
    for name, test in (("box", own), ("simple shear", simple)):
        peak = direct_shear_angle(plane["peak"], test["dilation"])
        case.metric(f"peak angle, {name} [deg]", test["peak"], peak, 2.0,
                    "Davis, with the dilation measured")  # fmt: skip
    case.metric("angle at the end, box [deg]", own["critical"], simple["critical"], 2.0,
                "simple shear; the work of dilation taken off both")  # fmt: skip
    case.above("peak less end, box [deg]", own["peak"] - own["critical"], 2.0, "it was dense")
    case.above("dilation at the peak, box [deg]", own["dilation"], 5.0)
    for seed, one in zip(FILLINGS, boxes, strict=True):
        case.metric(f"normal force / target, mean, {seed}", one["normal"], 1.0, 0.01)
        case.metric(f"force times way / work of the lower half, {seed}", one["way_work"], 1.0, 0.01)
    error, balance = (max_of(one[k] for one in boxes) for k in ("work_error", "balance"))
    case.below("work of walls and surfaces less boundary work, relative", error, 1e-9)
    case.below("forces that are out of balance / normal force", balance, 0.03)
    tests = [*boxes, *(test for one in cells for test in one.values())]
    closure = max_of(test["closure"] for test in tests)
    case.below("ledger, largest", closure, 1e-4)
    draw(case, boxes, cells, (own, plane, simple))


def mean_of(tests: list[dict]) -> dict[str, float]:
    """Means over packs of the angles that all have [deg]."""
    names = [k for k in ("peak", "critical", "dilation") if k in tests[0]]
    return {k: float(np.mean([test[k] for test in tests])) for k in names}


def sizes(count: int, seed: int) -> np.ndarray:
    """Radii [m]."""
    rng = np.random.default_rng(seed)
    return RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, count)


def deck(case: Case, part: str, name: str, words: dict[str, str]) -> str:
    """Write a deck with its words filled in; return its name."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    return f"{name}.nml"


def end_of(case: Case, name: str) -> float:
    """Time at which a run ended [s]."""
    return json.loads((case.folder / f"{name}_summary.json").read_text())["time_s"]


def smooth(values: np.ndarray) -> np.ndarray:
    """Moving mean, of the same length."""
    wide = np.pad(values, WINDOW // 2, mode="edge")
    return np.convolve(wide, np.ones(WINDOW) / WINDOW, mode="valid")


def whole_windows(values: np.ndarray) -> np.ndarray:
    """Moving mean where the window is full: nothing counts more than once."""
    return np.convolve(values, np.ones(WINDOW) / WINDOW, mode="valid")


def box(case: Case, seed: int) -> dict:
    """Fill and press a box, shear it; angles, dilation, balances."""
    filled = cloud(sizes(COUNT, seed), np.array([LONG, WIDE, TALL]), np.ones(3), seed=seed)
    press, shear = f"press_{seed}", f"box_shear_{seed}"
    words = {"box.h5": f"box_{seed}.h5"}
    write_h5(case.folder / words["box.h5"], filled)
    case.run("talus-dem", deck(case, "press", press, words), "--threads=1")
    words["T_END"] = f"{end_of(case, press) + WAY / SPEED:.9g}"
    case.run("talus-dem", deck(case, "shear", shear, words), "--threads=1",
             f"--restart={press}.chk.h5")  # fmt: skip
    table = case.folder / f"{shear}_surfaces.csv"
    rows = read_history(table)
    part = {k: {c: v[rows["surface"] == k] for c, v in rows.items()} for k in range(1, 8)}
    walls = read_history(case.folder / f"{shear}_walls.csv")
    floor = {c: v[walls["wall"] == 3] for c, v in walls.items()}
    curves = read_shear_box(table, UPPER, LID, FLANGE)
    way, normal, rise = curves.way, curves.normal, curves.rise
    under = floor["force_x"] + sum(part[k]["force_x"] for k in (1, 2, 3))
    energy = read_history(case.folder / f"{shear}_energy.csv")
    told = energy["boundary"] - energy["boundary"][0]
    pieces = [*part.values(), *({c: v[walls["wall"] == k] for c, v in walls.items()}
                                for k in (1, 2, 3))]  # fmt: skip
    works = sum(piece["work"] - piece["work"][0] for piece in pieces)
    lower = [*(part[k] for k in (1, 2, 3)), floor]
    given = sum(piece["work"][-1] - piece["work"][0] for piece in lower)
    own = -float((0.5 * (under[1:] + under[:-1]) * np.diff(way)).sum())
    test = angles(way, smooth(curves.shear / normal), smooth(rise))
    return test | {
        "normal": float((part[LID]["force_z"] / (STRESS * LONG * WIDE)).mean()),
        "work_error": float(np.abs(works - told).max() / told[-1]), "way_work": own / given,
        "balance": float(np.abs(whole_windows(curves.shear + under)).max() / normal.mean()),
        "closure": float(energy["relative_closure"].max()),
    }  # fmt: skip


def angles(way: np.ndarray, ratio: np.ndarray, rise: np.ndarray) -> dict:
    """Peak angle, dilation there, and the angle of the last quarter less its dilation [deg].

    What the stresses do on dilation is no friction: tan = shear/normal - rise/way (Taylor).
    """
    at = int(ratio.argmax())
    near = slice(max(0, at - WINDOW), at + WINDOW + 1)
    late = way > 0.75 * way[-1]
    grows = np.polyfit(way[late], rise[late], 1)[0]
    return {
        "way": way, "angle": np.degrees(np.arctan(ratio)), "rise": rise,
        "peak": float(np.degrees(np.arctan(ratio[at]))),
        "critical": float(np.degrees(np.arctan(ratio[late].mean() - grows))),
        "dilation": float(np.degrees(np.arctan(np.polyfit(way[near], rise[near], 1)[0]))),
    }  # fmt: skip


def cell(case: Case, seed: int) -> dict[str, dict]:
    """Compress the same grains in a cell, shear them in plane strain and in simple shear."""
    pack = cloud(sizes(CUBE_COUNT, seed), np.full(3, CUBE), np.ones(3), seed=seed, periodic=True)
    press, files = f"cell_press_{seed}", {"cell.h5": f"cell_{seed}.h5"}
    write_h5(case.folder / files["cell.h5"], pack)
    case.run("talus-dem", deck(case, "cell_press", press, files), "--threads=1")
    start = end_of(case, press)
    tests = {}
    for kind, (rates, hold, strain) in RATES.items():
        rate, name = abs(float(rates.split()[-1])), f"{kind}_{seed}"
        words = {"RATES": rates, "HOLD": hold, "T_END": f"{start + strain / rate:.9g}"} | files
        case.run("talus-dem", deck(case, "cell_shear", name, words), "--threads=1",
                 f"--restart={press}.chk.h5")  # fmt: skip
        rows = read_history(case.folder / f"{name}_cell.csv")
        way = rate * (rows["time"] - rows["time"][0])
        if kind == "plane":
            most, least = -rows["stress_zz"], -rows["stress_xx"]
            angle = smooth(np.degrees(np.arcsin((most - least) / (most + least))))
            tests[kind] = {"way": way, "angle": angle, "peak": float(angle.max()),
                           "critical": float(angle[way > 0.75 * strain].mean())}  # fmt: skip
        else:
            ratio = 0.5 * (rows["stress_xz"] + rows["stress_zx"]) / -rows["stress_zz"]
            tests[kind] = angles(way, smooth(ratio), smooth(np.log(rows["volume"])))
        energy = read_history(case.folder / f"{name}_energy.csv")
        tests[kind]["closure"] = float(energy["relative_closure"].max())
    return tests


def draw(case: Case, boxes: list[dict], cells: list[dict], means: tuple[dict, ...]) -> None:
    """Angle and rise over displacement, of the boxes and of simple shear, and their means."""
    own, plane, simple = means
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.2))
    for k, (one, cell_of) in enumerate(zip(boxes, cells, strict=True)):
        ax.plot(1e3 * one["way"], one["angle"], color=f"C{k}", label=f"box, filling {k + 1}")
        ax.plot(1e3 * one["way"], 1e4 * one["rise"], color="0.5", lw=0.8,
                label="" if k else "rise of the lid [0.1 mm]")  # fmt: skip
        pure, flat = cell_of["simple"], cell_of["plane"]
        ax2.plot(100.0 * pure["way"], pure["angle"], color=f"C{k}",
                 label="" if k else "simple shear in three cells")  # fmt: skip
        ax2.plot(200.0 * flat["way"], flat["angle"], lw=0.6, color=f"C{k}",
                 label="" if k else "plane strain, s1 and s3")  # fmt: skip
    for test, axis in ((own, ax), (simple, ax2)):
        axis.axhline(direct_shear_angle(plane["peak"], test["dilation"]), color="0.3", lw=0.8,
                     ls="--", label="Davis, peak")  # fmt: skip
        axis.axhline(simple["critical"], color="0.3", lw=0.8, ls=":", label="end, simple shear")
        axis.set(ylim=(0.0, 40.0), ylabel="angle [deg]")
        axis.legend(fontsize=8)
    ax.set(xlabel="displacement of the lower half [mm]")
    ax2.set(xlabel="shear strain, twice the axial one [%]")
    case.save(fig)
