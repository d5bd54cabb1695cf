"""Peak friction angle of spheres over the place of the middle stress, and in plane strain."""

import json

import numpy as np

from talus.compare import max_of
from talus.drivers import angle_by, lade, matsuoka_nakai, plane_strain_angle
from talus.generate import cloud
from talus.packing import write_h5
from talus.verification import Case, read_history

COUNT, BOX, RADIUS, SPREAD = 1500, 0.072, 2.0e-3, 0.2
SEEDS = (3, 4)  # of the packs
PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)  # b
STRESS, STRAIN, RATE = 100.0e3, 0.035, 1.0  # [Pa], [-], [1/s]
WINDOW = 0.01  # strain over which a peak is averaged
HOLD = "&cell_stress component = 'yy', between = 'xx', 'zz', b = {}, rate = 8.0, gain = 0.3, "


def run(case: Case) -> None:
    """Compress packs, shear each six times, compare with the criteria."""
    packs = [pack(case, seed) for seed in SEEDS]
    every = [test for tests in packs for test in tests.values()]
    peak = {b: float(np.mean([tests[b]["peak"] for tests in packs])) for b in (*PLACES, "plane")}
    angles = {c: fit(c, peak) for c in (lade, matsuoka_nakai, mohr_coulomb)}
    for b in PLACES:
        expected = angle_by(lade, angles[lade][0], b)
        case.metric(f"peak friction angle, b = {b} [deg]", peak[b], expected, 1.0,
                    "Lade's criterion fitted to all")  # fmt: skip
        errors = [np.abs(t[b]["place"] - b)[t[b]["strain"] > 0.005].max() for t in packs]
        case.below(f"b less {b}, largest", float(max_of(errors)), 0.03)
    misfit = {c: angles[c][1] for c in angles}
    case.below("rms misfit, Lade / Matsuoka-Nakai", misfit[lade] / misfit[matsuoka_nakai], 1.0)
    case.below("rms misfit, Lade / Mohr-Coulomb", misfit[lade] / misfit[mohr_coulomb], 1.0)
    case.above("plane strain less triaxial compression [deg]", peak["plane"] - peak[0.0], 2.0)
    weak, strong = (plane_strain_angle(c, angles[lade][0]) for c in (matsuoka_nakai, lade))
    case.above("plane strain [deg]", peak["plane"], weak - 0.5, "Matsuoka-Nakai")
    case.below("plane strain [deg], no more than", peak["plane"], strong + 0.5, "Lade")
    place = float(np.mean([tests["plane"]["place_there"] for tests in packs]))
    case.above("b in plane strain at the peak", place, bishops_place(peak["plane"]), "Bishop")
    case.below("b in plane strain, no more than", place, 0.5, "Lade")
    last = [float(np.abs(t["lateral"] / STRESS - 1.0).mean()) for t in every]
    case.below("lateral stress, mean error", max_of(last), 0.02)
    case.below("ledger, largest", max_of(t["closure"] for t in every), 1e-4)
    case.below("work by stress and strain less boundary work, relative",
               max_of(t["work_error"] for t in every), 5e-3)  # fmt: skip
    draw(case, packs, peak, {c: angles[c][0] for c in angles}, place)


def pack(case: Case, seed: int) -> dict:
    """Compress a pack, shear it at all places of the middle stress and in plane strain."""
    rng = np.random.default_rng(seed)
    sizes = RADIUS * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, COUNT)
    write_h5(case.folder / f"cloud_{seed}.h5",
             cloud(sizes, np.full(3, BOX), np.ones(3), seed=seed, periodic=True))  # fmt: skip
    text = (case.folder / "press.nml").read_text().replace("cloud.h5", f"cloud_{seed}.h5")
    (case.folder / f"press_{seed}.nml").write_text(text)
    case.run("talus-dem", f"press_{seed}.nml", "--threads=1")
    tests = {b: shear(case, seed, f"b{100 * b:.0f}", HOLD.format(b) + "tolerance = 0.1 /")
             for b in PLACES}  # fmt: skip
    return tests | {"plane": shear(case, seed, "plane", "")}


def mohr_coulomb(ratio: float, b: float) -> float:
    """Mohr and Coulomb's measure of failure, which knows no middle stress."""
    return ratio + 0.0 * b


def fit(criterion: object, peak: dict) -> tuple[float, float]:
    """Angle in triaxial compression [deg] by which a criterion fits all places best; its rms."""
    trial = np.linspace(22.0, 32.0, 201)
    error = [np.sqrt(np.mean([(angle_by(criterion, float(t), b) - peak[b]) ** 2 for b in PLACES]))
             for t in trial]  # fmt: skip
    best = int(np.argmin(error))
    return float(trial[best]), float(error[best])


def bishops_place(angle: float) -> float:
    """Place b of Bishop's middle stress (s1 + s3)/2 cos^2 phi in plane strain."""
    sine = np.sin(np.radians(angle))
    ratio = (1.0 + sine) / (1.0 - sine)
    return float((0.5 * (ratio + 1.0) * (1.0 - sine**2) - 1.0) / (ratio - 1.0))


def shear(case: Case, seed: int, name: str, middle: str) -> dict:
    """Shear a compressed pack; return its curves and its peak."""
    start = json.loads((case.folder / f"press_{seed}_summary.json").read_text())["time_s"]
    name = f"{name}_{seed}"
    text = (case.folder / "shear.nml").read_text().replace("cloud.h5", f"cloud_{seed}.h5")
    text = text.replace("T_END", f"{start + STRAIN / RATE:.9g}")
    text = text.replace("\nMIDDLE\n", f"\n{middle}\n")
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1", f"--restart=press_{seed}.chk.h5")
    rows = read_history(case.folder / f"{name}_cell.csv")
    least, middle_stress, most = (-rows[f"stress_{c}{c}"] for c in "xyz")
    edges = np.stack([rows["edge_ax"], rows["edge_by"], rows["edge_cz"]])
    strain = -np.log(edges[2] / edges[2, 0])
    angle = np.degrees(np.arcsin((most - least) / (most + least)))
    width = int(np.searchsorted(strain, WINDOW))
    mean = np.convolve(angle, np.ones(width) / width, mode="valid")
    at = int(mean.argmax())
    place = (middle_stress - least) / np.maximum(most - least, 1.0)
    energy = read_history(case.folder / f"{name}_energy.csv")
    rate = -np.diff(np.log(edges), axis=1)
    stress = np.stack([least, middle_stress, most])
    mid = 0.5 * (stress[:, 1:] + stress[:, :-1]) * 0.5 * (rows["volume"][1:] + rows["volume"][:-1])
    own, told = float((mid * rate).sum()), energy["boundary"][-1] - energy["boundary"][0]
    return {
        "strain": strain, "angle": angle, "place": place, "lateral": least,
        "volume": np.log(rows["volume"] / rows["volume"][0]), "peak": float(mean[at]),
        "place_there": float(place[at : at + width].mean()),
        "closure": float(energy["relative_closure"].max()),
        "work_error": float(abs(own / told - 1.0)),
    }  # fmt: skip


def draw(case: Case, packs: list[dict], peak: dict, angles: dict, place: float) -> None:
    """Angles over strain and over b."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.2))
    for b in PLACES:
        test = packs[0][b]
        ax.plot(100.0 * test["strain"], test["angle"], lw=0.9, label=f"b = {b}")
    plane = packs[0]["plane"]
    ax.plot(100.0 * plane["strain"], plane["angle"], "k--", lw=1.0, label="plane strain")
    ax.set(xlabel="axial strain [%]", ylabel="friction angle [deg]", ylim=(0.0, None))
    ax.legend(fontsize=8)
    fine = np.linspace(0.0, 1.0, 101)
    names = {lade: ("Lade", "-"), matsuoka_nakai: ("Matsuoka-Nakai", "--"),
             mohr_coulomb: ("Mohr-Coulomb", ":")}  # fmt: skip
    for criterion, (name, dash) in names.items():
        curve = [angle_by(criterion, angles[criterion], b) for b in fine]
        ax2.plot(fine, curve, dash, color="0.5", label=f"{name}, best fit")
    for k, tests in enumerate(packs):
        ax2.plot(PLACES, [tests[b]["peak"] for b in PLACES], "x", color="0.6",
                 label="" if k else "packs")  # fmt: skip
    ax2.plot(PLACES, [peak[b] for b in PLACES], "o", label="their mean")
    ax2.plot(place, peak["plane"], "ks", label="plane strain")
    ax2.set(xlabel="b = (s2 - s3)/(s1 - s3)", ylabel="peak friction angle [deg]")
    ax2.legend(fontsize=8)
    case.save(fig)
