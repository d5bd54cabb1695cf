"""Triaxial compression in a flexible membrane and in a bore under a servo, the same specimens."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

from talus.compare import max_of, min_of
from talus.generate import cloud, uniform_sizes
from talus.packing import write_h5
from talus.verification import Case, Step, field_steps, read_history

RADIUS, SPREAD, DENSITY = 1.0e-3, 0.15, 2650.0  # of the grains [m], [-], [kg/m3]
WIDE, TALL = 8.0e-3, 18.0e-3  # radius and height of a specimen, about [m]
PACKED, LOOSE = 0.59, 0.28  # solid fractions: of a specimen, of its cloud
STRESS, SPEED, STRAIN = 20.0e3, 0.05, 0.08  # [Pa], [m/s], of the height
REST, GOES = 12.0e-3, 14.0e-3  # the lid stands under its servo, moves at its full speed [s]
CLOSING = 0.2  # speed of the lid that presses a cloud [m/s]
SEEDS = (1, 2, 3)
AROUND, ALONG = 48, 22  # rows of triangles of the membrane
MEANS = (0.02, 0.07)  # strains between which stresses are averaged
SIDE_ID = -3  # of contacts with the side: after both planes
BORE = """&cylinder  id = 'side', side = 'inside', centre = 0.0, 0.0, 0.0, radius = RADIUS,
           material = 'smooth' /
&curve     id = 'high', times = 0.0, REST, GOES, T_END, values = 1.0, 1.0, HIGH_ONE, HIGH_TWO /
&servo     surface = 'side', stress = 20.0e3, area = SIDE_AREA, curve = 'high', speed = 0.3,
           gain = 0.3, tolerance = 0.1 /
"""
SKIN = """&membrane  id = 'side', file = 'STL', material = 'smooth', young = 2.0e5,
           thickness = 3.0e-4, density = 2.0e4, pressure = 20.0e3, inside = 0.0, 0.0, 0.009,
           clamp = 'floor', 'lid', damping = 1000.0 /
"""
KINDS = {"bore": BORE, "skin": SKIN}
NAMES = {"bore": "bore under a servo", "skin": "membrane under pressure"}


def run(case: Case) -> None:
    """Press the specimens, shear each in both; stresses, volumes, balances."""
    with ThreadPoolExecutor(2) as pool:  # programs that run side by side
        packs = list(pool.map(lambda seed: press(case, seed), SEEDS))
        jobs = [(pack, kind) for pack in packs for kind in ("skin", "bore")]
        found = list(pool.map(lambda job: shear(case, *job), jobs))
    tests = {kind: [t for (_, own), t in zip(jobs, found, strict=True) if own == kind]
             for kind in KINDS}  # fmt: skip
    bore, skin = (np.array([test["ratio_mean"] for test in tests[kind]]) for kind in KINDS)
    case.metric("stress ratio in the membrane / in the bore, mean", float(skin.mean()
                / bore.mean()), 1.0, 0.1)  # fmt: skip
    case.below("their difference / scatter of the specimens", over_scatter(skin, bore), 2.0)
    bore, skin = (np.array([test["volume_end"] for test in tests[kind]]) for kind in KINDS)
    case.below("volume strain at the end, difference / scatter of the specimens",
               over_scatter(skin, bore), 2.0)  # fmt: skip
    case.above("volume strain at the end in the membrane, mean", float(skin.mean()), 0.0)
    rest = [test["rest"] for test in tests["skin"]]
    case.metric("radial stress on the grains at rest / pressure", float(np.mean(rest)), 1.0, 0.02)
    corrected = [test["corrected"] for test in tests["skin"]]
    case.metric("radial stress on the grains / pressure and pull of the membrane",
                float(np.mean(corrected)), 1.0, 1.0 / ALONG, "rims carry a row")  # fmt: skip
    for kind in KINDS:
        ends = np.mean([test["ends"] for test in tests[kind]])
        case.metric(f"force of the lid / of the floor, {NAMES[kind]}", float(ends), 1.0, 0.03)
    inertia = SPEED / min_of(test["height"] for test in found) * 2.0 * RADIUS
    case.below("inertial number", float(inertia * np.sqrt(DENSITY / STRESS)), 3e-3)
    case.below("ledger, pressing", max_of(pack["closure"] for pack in packs), 1e-4)
    for kind in KINDS:
        worst = max_of(test["closure"] for test in tests[kind])
        case.below(f"ledger, {NAMES[kind]}", worst, 1e-4)
    draw(case, tests)


def over_scatter(one: np.ndarray, other: np.ndarray) -> float:
    """Difference of two means over the scatter of single values of both."""
    scatter = np.hypot(one.std(ddof=1), other.std(ddof=1))
    return float(abs(one.mean() - other.mean()) / scatter)


def fill(case: Case, part: str, name: str, words: dict[str, object], more: str = "") -> str:
    """Write a deck with its words filled in, longest first; return its name."""
    text = (case.folder / "head.nml").read_text() + (case.folder / f"{part}.nml").read_text() + more
    for word in sorted(words, key=len, reverse=True):
        text = text.replace(word, str(words[word]))
    (case.folder / f"{name}.nml").write_text(text)
    return f"{name}.nml"


def press(case: Case, seed: int) -> dict:
    """Press a cloud; radius and height of the specimen [m], closure of the ledger."""
    grow = (PACKED / LOOSE) ** (1.0 / 3.0)
    radius, height = WIDE * grow, TALL * grow
    box = np.array([2.0 * radius, 2.0 * radius, height])
    count = int(LOOSE * box.prod() / (4.0 / 3.0 * np.pi * RADIUS**3))
    sizes = uniform_sizes(count, SPREAD, np.random.default_rng(seed))
    pack = cloud(sizes, box, np.full(3, RADIUS), seed)
    pack.x -= np.array([radius, radius, 0.0])
    clear = radius - (1.0 + SPREAD) * RADIUS
    pack = pack.take(np.hypot(pack.x[:, 0], pack.x[:, 1]) < clear).renumbered(0)
    write_h5(case.folder / f"cloud_{seed}.h5", pack)
    met = 0.8 * (height - TALL) / CLOSING + 0.01  # when the grains carry the stress [s]
    name = f"press_{seed}"
    words = {
        "CLOUD": f"cloud_{seed}.h5", "PACK": f"pack_{seed}.h5", "HEIGHT": height, "RADIUS": radius,
        "FRICTION": 0.05, "LID_AREA": np.pi * WIDE**2, "SIDE_AREA": 2.0 * np.pi * radius * TALL,
        "SIDE_SPEED": CLOSING * radius / height, "FINE": met, "FINER": met + 1.0e-3,
    }  # fmt: skip
    case.run("talus-dem", fill(case, "press", name, words), "--threads=1")
    side = read_history(case.folder / f"{name}_surface_servos.csv")
    lid = read_history(case.folder / f"{name}_walls.csv")
    energy = read_history(case.folder / f"{name}_energy.csv")
    return {"seed": seed, "radius": float(side["position"][-1]),
            "height": float(lid["z"][lid["wall"] == 1][-1]),
            "closure": float(energy["relative_closure"].max())}  # fmt: skip


def write_tube(path: Path, radius: float, height: float) -> None:
    """Write a tube of triangles whose flanks touch the cylinder, as binary STL."""
    level = np.arange(ALONG + 1)[:, None]
    angle = 2.0 * np.pi * (np.arange(AROUND) + 0.5 * (level % 2)) / AROUND
    out = radius / np.cos(np.pi / AROUND)
    node = np.stack([out * np.cos(angle), out * np.sin(angle),
                     level * height / ALONG + 0.0 * angle], -1)  # fmt: skip
    triangles = []
    for k in range(ALONG):
        low, high = node[k], node[k + 1]
        next_low, next_high = np.roll(low, -1, 0), np.roll(high, -1, 0)
        if k % 2 == 0:
            triangles += [(low, next_low, high), (next_low, next_high, high)]
        else:
            triangles += [(low, next_high, high), (low, next_low, next_high)]
    corners = np.concatenate([np.stack(three, 1) for three in triangles])
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(corners), record)
    rows["corner"] = corners
    path.write_bytes(b"tube".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def shear(case: Case, pack: dict, kind: str) -> dict:
    """Shorten a specimen; strains, stresses, volumes."""
    name, height, radius = f"{kind}_{pack['seed']}", pack["height"], pack["radius"]
    end = REST + STRAIN * height / SPEED
    if kind == "skin":
        write_tube(case.folder / f"{name}.stl", radius, height)
    lost = SPEED * np.array([0.5 * (GOES - REST), end - 0.5 * (REST + GOES)]) / height
    words = {
        "PACK": f"pack_{pack['seed']}.h5", "HEIGHT": height, "RADIUS": radius, "FRICTION": 0.5,
        "LID_AREA": np.pi * radius**2, "SIDE_AREA": 2.0 * np.pi * radius * height, "SPEED": SPEED,
        "REST": REST, "GOES": GOES, "T_END": end, "EVERY": end / 240, "OUTPUT": end / 60,
        "HIGH_ONE": 1.0 - lost[0], "HIGH_TWO": 1.0 - lost[1], "STL": f"{name}.stl",
        "SIDE": NAMES[kind],
    }  # fmt: skip
    case.run("talus-dem", fill(case, "shear", name, words, KINDS[kind]), "--threads=1")
    walls = read_history(case.folder / f"{name}_walls.csv")
    lid, floor = ({key: v[walls["wall"] == k] for key, v in walls.items()} for k in (1, 2))
    energy = read_history(case.folder / f"{name}_energy.csv")
    rows = np.array(list(look(case, name, lid)))
    at_rest = int(np.argmin(np.abs(rows[:, 0] - REST)))
    times, axial, volume, area, radial, pull = rows[at_rest:].T
    top = np.interp(times, lid["time"], smooth(lid["force_z"])) / area
    bottom = np.interp(times, floor["time"], smooth(-floor["force_z"])) / area
    steady = (axial >= MEANS[0]) & (axial <= MEANS[1])
    ratio = 0.5 * (top + bottom) / radial
    return {
        "strain": axial, "ratio": ratio, "volume": volume, "height": height,
        "ratio_mean": float(ratio[steady].mean()), "volume_end": float(volume[-1]),
        "rest": float(radial[0] / STRESS),
        "corrected": float((radial / (STRESS + pull))[steady].mean()),
        "ends": float(top[steady].mean() / bottom[steady].mean()),
        "closure": float(energy["relative_closure"].max()),
    }  # fmt: skip


def look(case: Case, name: str, lid: dict[str, np.ndarray]):  # noqa: ANN201, a generator
    """Of each step: time, axial strain, volume strain of the grains, area of the section [m2],
    radial stress of the contacts with the side [Pa], pull of the side over its radius [Pa]."""  # noqa: D209
    steps = field_steps(case.folder / f"{name}.h5")
    first = steps[int(np.argmin([abs(step.time - REST) for step in steps]))]
    for step in steps:
        high = float(np.interp(step.time, lid["time"], lid["z"]))
        volume, pull = enclosed(case, name, step, high)
        own = step.contacts["ids"][:, 0] == SIDE_ID
        virial = (step.contacts["point"][own, :2] * step.contacts["force"][own, :2]).sum()
        yield (step.time, 1.0 - high / lid["z"][0], grown(first, step), volume / high,
               abs(virial) / (2.0 * volume), pull)  # fmt: skip


def grown(first: Step, step: Step) -> float:
    """Volume strain of the linear map that is nearest to the grains' displacements."""
    x, y = first.grains["x"], step.grains["x"]
    x, y = x - x.mean(0), y - y.mean(0)
    return float(np.linalg.det(np.linalg.lstsq(x, y, rcond=None)[0]) - 1.0)


def enclosed(case: Case, name: str, step: Step, high: float) -> tuple[float, float]:
    """Volume within the side [m3], and the pull of a membrane as a radial stress [Pa]."""
    if name.startswith("bore"):
        side = read_history(case.folder / f"{name}_surface_servos.csv")
        return float(np.pi * np.interp(step.time, side["time"], side["position"]) ** 2 * high), 0.0
    with h5py.File(case.folder / f"{name}.h5") as file:
        steps = [file["steps"][key] for key in sorted(file["steps"])]
        times = [float(np.ravel(one.attrs["time"])[0]) for one in steps]
        one = steps[times.index(step.time)]["surfaces"]
        now, corner = one["x"][...], one["triangles"][...]
        start = steps[0]["surfaces"]["x"][...]
    a, b, c = (now[corner[:, k]] for k in range(3))
    normal = 0.5 * np.cross(b - a, c - a)
    volume = abs(((a + b + c) / 3.0 * normal)[:, :2].sum()) / 2.0
    return float(volume), tension_virial(start[corner], now[corner]) / (2.0 * volume)


def tension_virial(start: np.ndarray, now: np.ndarray) -> float:
    """Sum over triangles of area times resultant across the axis [N m], both (n, 3, 3).

    St. Venant-Kirchhoff sheet, as in the theory: A0 tr of the part of F S F^T across the axis.
    """
    young, thick, poisson = 2.0e5, 3.0e-4, 0.3
    edge = start[:, 1:] - start[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(edge[:, 0], edge[:, 1]), axis=1)
    one = edge[:, 0] / np.linalg.norm(edge[:, 0], axis=1, keepdims=True)
    up = np.cross(edge[:, 0], edge[:, 1])
    two = np.cross(up / np.linalg.norm(up, axis=1, keepdims=True), one)
    flat = np.stack([np.einsum("nkj,nj->nk", edge, e) for e in (one, two)], -1)
    gradient = np.einsum("nkj,nik->nji", now[:, 1:] - now[:, :1], np.linalg.inv(flat))
    strain = 0.5 * (np.einsum("nji,njk->nik", gradient, gradient) - np.eye(2))
    trace = np.einsum("nii->n", strain)[:, None, None] * np.eye(2)
    stress = young * thick / (1.0 - poisson**2) * ((1.0 - poisson) * strain + poisson * trace)
    pull = np.einsum("nij,njk,nlk->nil", gradient, stress, gradient)
    return float((area * (pull[:, 0, 0] + pull[:, 1, 1])).sum())


def smooth(values: np.ndarray, window: int = 5) -> np.ndarray:
    """Moving mean, of the same length."""
    wide = np.pad(values, window // 2, mode="edge")
    return np.convolve(wide, np.ones(window) / window, mode="valid")


def draw(case: Case, tests: dict[str, list[dict]]) -> None:
    """Stress ratio and volume over axial strain, single specimens and means."""
    fig, (left, right) = case.figure(ncols=2, figsize=(9.5, 4.2))
    for kind, colour in (("bore", "C0"), ("skin", "C1")):
        strain = np.linspace(0.0, STRAIN * 0.93, 50)
        for ax, key, factor in ((left, "ratio", 1.0), (right, "volume", 100.0)):
            own = [factor * np.interp(strain, t["strain"], t[key]) for t in tests[kind]]
            for line in own:
                ax.plot(100.0 * strain, line, color=colour, lw=0.6, alpha=0.6)
            ax.plot(100.0 * strain, np.mean(own, 0), color=colour, lw=1.8, label=NAMES[kind])
    left.set(xlabel="axial strain [%]", ylabel="axial / radial stress [-]", ylim=(0.8, None))
    right.set(xlabel="axial strain [%]", ylabel="volume strain of the grains [%]")
    left.legend()
    case.save(fig)
