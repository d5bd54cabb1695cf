"""Contacts of regions: a lattice in closed form, a bed against sums over its field file."""

import itertools
import shutil

import h5py
import numpy as np
from same_bits import ROUNDING

from talus.compare import difference, max_of
from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, history_difference, read_history, write_packing

RADIUS, YOUNG, POISSON = 1.0e-3, 29.0e9, 0.25
NUMBER = np.array([6, 5, 4])  # spheres along x, y, z
OVERLAP = 2.0 * RADIUS * np.array([1.0e-3, 6.0e-4, 2.0e-4])
PITCH = 2.0 * RADIUS - OVERLAP
MODULUS = 0.5 * YOUNG / (1.0 - POISSON**2)
FORCE = 4.0 / 3.0 * MODULUS * np.sqrt(0.5 * RADIUS) * OVERLAP**1.5
LOWER, BLOCK = PITCH * [0.4, 1.3, 0.4], np.array([5, 2, 3])  # a box of whole pitches
BASE, CENTRE = PITCH * [2.7, 2.3, 0.3], PITCH * [2.7, 2.3, 1.9]
AXES = np.array([2.5e-3, 2.0e-3, 1.5e-3])
ROUND = 1.0e-12


def run(case: Case) -> None:
    """Judge the lattice, then the bed."""
    judge_lattice(case)
    judge_bed(case)


def judge_lattice(case: Case) -> None:
    """Compare four regions of the lattice with its contacts laid out anew."""
    grid = np.array(list(itertools.product(*map(range, NUMBER))))
    x = (grid + 0.25) * PITCH
    write_h5(case.folder / "spheres.h5", make_packing(x, np.full((len(x), 3), RADIUS)))
    three = {"SIZE": NUMBER * PITCH, "LOWER": LOWER, "UPPER": LOWER + BLOCK * PITCH, "BASE": BASE}
    three["CENTRE"] = CENTRE
    text = (case.folder / "lattice.nml").read_text()
    for word, value in three.items():
        text = text.replace(word, ", ".join(f"{v:.17g}" for v in value))
    text = text.replace("T_END", "2.0e-6").replace("DT", "1.0e-7")
    (case.folder / "lattice.nml").write_text(text)
    case.run("talus-dem", "lattice.nml", "--threads=1")
    rows = {name: last_row(case, f"lattice_contacts_{name}") for name in ("box", "pipe", "ball")}
    rows["cell"] = last_row(case, "lattice_contacts_whole")
    for name, row in rows.items():
        wanted = lattice_row(name)
        off = max_of(abs(row[k] - v) / scale_of(k, wanted) for k, v in wanted.items())
        case.below(f"lattice, {name}: largest error of {len(wanted)} columns", off, ROUND)
    for axis in range(3):
        name = "stress_" + 2 * "xyz"[axis]
        exact = -FORCE[axis] * PITCH[axis] / PITCH.prod()
        for region in ("box", "cell"):
            case.metric(
                f"lattice, {region}: {name} [Pa]", rows[region][name], exact, -ROUND * exact
            )
    whole = last_row(case, "lattice_measure_whole")
    off = max_of(abs(rows["cell"][k] - whole[k]) for k in whole if k.startswith("stress"))
    case.below("whole cell: stress of its contacts - of its branches [Pa]", off, 0.0)
    cell = last_row(case, "lattice_cell")
    off = max_of(
        abs(rows["cell"][k] / cell[k] - 1.0) for k in ("stress_xx", "stress_yy", "stress_zz")
    )
    case.below("whole cell: stress against that of the cell's history", off, ROUND)


def scale_of(name: str, row: dict[str, float]) -> float:
    """Return what an error of a column is compared with: the largest of its kind."""
    kind = name.split("_")[0]
    return max(abs(v) for k, v in row.items() if k.split("_")[0] == kind) or 1.0


def last_row(case: Case, name: str) -> dict[str, float]:
    """Return the last row of a history."""
    return {k: float(v[-1]) for k, v in read_history(case.folder / f"{name}.csv").items()}


def lattice_row(region: str) -> dict[str, float]:
    """Return the columns of a region from all contacts of the endless lattice around it."""
    cells = np.array(list(itertools.product(range(-12, 19), repeat=3)))
    points = (cells[:, None, :] + 0.25 + 0.5 * np.eye(3)) * PITCH  # along x, y, z
    inside, volume = which(points, region)
    n = inside.sum(0)
    bears = n * FORCE
    row = {
        "volume": volume, "contacts": float(n.sum()), "boundary_contacts": 0.0,
        "coordination": 6.0, "sliding": 0.0, "normal_force_mean": bears.sum() / n.sum(),
        "normal_force_largest": FORCE.max(), "overlap_mean": (n * OVERLAP).sum() / n.sum(),
        "overlap_largest": OVERLAP.max(), "pressure": (bears * PITCH).sum() / volume / 3.0,
    }  # fmt: skip
    for i, a in enumerate("xyz"):
        row[f"stress_{a}{a}"] = -bears[i] * PITCH[i] / volume
        row[f"fabric_contact_{a}{a}"] = n[i] / n.sum()
        row[f"fabric_force_{a}{a}"] = bears[i] / bears.sum()
    for pair in ("xy", "yz", "zx"):
        row |= {f"stress_{pair}": 0.0, f"fabric_contact_{pair}": 0.0, f"fabric_force_{pair}": 0.0}
    return row


def which(points: np.ndarray, region: str) -> tuple[np.ndarray, float]:
    """Return whether points lie in a region, and its volume."""
    if region == "cell":
        inside = ((points >= 0.0) & (points < NUMBER * PITCH)).all(-1)
        return inside, float((NUMBER * PITCH).prod())
    if region == "box":
        inside = ((points >= LOWER) & (points < LOWER + BLOCK * PITCH)).all(-1)
        return inside, float((BLOCK * PITCH).prod())
    if region == "ball":
        return ((points - CENTRE) ** 2).sum(-1) < 3.6e-3**2, 4.0 / 3.0 * np.pi * 3.6e-3**3
    off = points - BASE
    inside = ((off[..., :2] ** 2).sum(-1) < 3.3e-3**2) & (off[..., 2] >= 0) & (off[..., 2] < 7e-3)
    return inside, float(np.pi * 3.3e-3**2 * 7.0e-3)


def judge_bed(case: Case) -> None:
    """Compare rows with sums over the field file; then the same bits in four ways."""
    rng = np.random.default_rng(5)
    grid = np.array(list(itertools.product(range(5), range(4), range(3))))
    x = grid * 5.2e-3 + [2.7e-3, 2.7e-3, 2.6e-3] + rng.uniform(-5e-5, 5e-5, size=grid.shape)
    quat = rng.normal(size=(len(x), 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    write_packing(case.folder / "cloud.h5", x, np.tile(AXES, (len(x), 1)), quat=quat)
    case.run("talus-dem", "bed.nml", "--threads=1")
    steps = field_steps(case.folder / "bed.h5")[1:]
    rows = read_history(case.folder / "bed_contacts_core.csv")
    lower, upper = np.array([0.006, 0.004, -0.001]), np.array([0.05, 0.021, 0.008])
    off, slid = 0.0, 0.0
    for k, step in enumerate(steps, 1):
        wanted = bed_row(step, lower, upper)
        slid = max_of(slid, wanted["sliding"])
        off = max_of(off, *(abs(rows[n][k] - v) / scale_of(n, wanted) for n, v in wanted.items()))
    case.below("bed: largest error of the columns", off, ROUND)
    case.above("bed: largest share of sliding contacts", slid, 0.02, "or it would not be tested")
    case.above("bed: contacts with walls and ramp", rows["boundary_contacts"].max(), 5.0)
    judge_list(case, steps[-1], lower, upper)
    judge_bits(case)
    draw(case, rows)


def bed_row(step: object, lower: np.ndarray, upper: np.ndarray) -> dict[str, float]:
    """Return the columns of a box from one step of the field file."""
    c, g = step.contacts, step.grains
    inside = ((c["point"] >= lower) & (c["point"] < upper)).all(1)
    at = {int(i): x for i, x in zip(g["id"], g["x"], strict=True)}
    first = np.array([at.get(int(i), p) for i, p in zip(c["ids"][:, 0], c["point"], strict=True)])
    branch = np.array([at[int(i)] for i in c["ids"][:, 1]]) - first
    force, n = c["force"][inside], c["normal"][inside]
    normal = (force * n).sum(1)
    tangential = np.linalg.norm(force - normal[:, None] * n, axis=1)
    boundary = c["ids"][inside, 0] < 0
    friction = np.where(boundary, 0.1, 0.3)
    elastic = 2.0 / 3.0 * c["stiffness"][inside, 0] * c["overlap"][inside]
    volume = float((upper - lower).prod())
    sigma = -branch[inside].T @ force / volume
    overlap, total = c["overlap"][inside], max(1, inside.sum())
    slides = tangential >= (1.0 - 1e-6) * friction * elastic
    row = {
        "contacts": float(inside.sum()), "boundary_contacts": float(boundary.sum()),
        "sliding": slides.sum() / total, "normal_force_mean": normal.sum() / total,
        "normal_force_largest": normal.max(initial=0.0),
        "tangential_force_mean": tangential.sum() / total,
        "tangential_force_largest": tangential.max(initial=0.0),
        "overlap_mean": overlap.sum() / total,
        "overlap_largest": overlap.max(initial=0.0), "pressure": -np.trace(sigma) / 3.0,
    }  # fmt: skip
    plain, weighed = n.T @ n / total, (n * normal[:, None]).T @ n / (normal.sum() or 1.0)
    for i, j in itertools.product(range(3), repeat=2):
        row["stress_" + "xyz"[i] + "xyz"[j]] = sigma[i, j]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)):
        row["fabric_contact_" + "xyz"[i] + "xyz"[j]] = plain[i, j]
        row["fabric_force_" + "xyz"[i] + "xyz"[j]] = weighed[i, j]
    return row


def judge_list(case: Case, step: object, lower: np.ndarray, upper: np.ndarray) -> None:
    """Compare the file of single contacts with those of the field file."""
    inside = ((step.contacts["point"] >= lower) & (step.contacts["point"] < upper)).all(1)
    with h5py.File(case.folder / "bed_contacts_core.h5") as file:
        last = file["steps"][sorted(file["steps"])[-1]]
        for name in ("ids", "point", "normal", "force", "stiffness", "overlap"):
            same = np.array_equal(last[name][...], step.contacts[name][inside])
            case.metric(f"single contacts: {name} as in the field file", float(same), 1.0, 0.0)


def judge_bits(case: Case) -> None:
    """Run on two threads, on two ranks, from a checkpoint; measure afterwards."""
    names = ["bed_contacts_core.csv", "bed_contacts_all.csv", "bed_measure_core.csv"]
    kept = {name: (case.folder / name).read_text() for name in names}
    with h5py.File(case.folder / "bed_contacts_all.h5") as file:
        first = {k: v[...] for k, v in file["steps"][sorted(file["steps"])[-1]].items()}
    chosen = sorted(case.folder.glob("bed.chk*.h5"), key=lambda p: p.stat().st_mtime)[0]
    shutil.copy(chosen, case.folder / "middle.chk.h5")
    shutil.copy(case.folder / "bed.h5", case.folder / "one.h5")
    case.run("talus-dem", "bed.nml", "--measure=one.h5", "--output=after")
    for name in names:
        off = history_difference(case.folder / name, case.folder / "after" / name)
        case.below(f"afterwards: {name}, difference", off, 0.0)
    case.run("talus-dem", "bed.nml", "--threads=2")
    case.same_histories("two threads", kept, ROUNDING)
    case.run("talus-dem", "bed.nml", "--threads=1", ranks=2)
    case.same_histories("two ranks", kept, ROUNDING)
    with h5py.File(case.folder / "bed_contacts_all.h5") as file:
        last = {k: v[...] for k, v in file["steps"][sorted(file["steps"])[-1]].items()}
    off = max_of(difference(last[k], v) for k, v in first.items())
    case.below("two ranks: single contacts, difference", off, 0.0)
    case.run("talus-dem", "bed.nml", "--threads=1", "--restart=middle.chk.h5")
    case.same_histories("restart", kept, ROUNDING)


def draw(case: Case, rows: dict[str, np.ndarray]) -> None:
    """Draw forces of the box over time, and the single contacts at the end."""
    fig, axes = case.figure(ncols=2, figsize=(10.0, 3.8))
    for name in ("normal_force_mean", "normal_force_largest", "tangential_force_mean"):
        axes[0].plot(rows["time"], rows[name] * 1e3, "o-", label=name.replace("_", " "))
    axes[0].set(xlabel="time [s]", ylabel="force [mN]")
    axes[0].legend()
    with h5py.File(case.folder / "bed_contacts_core.h5") as file:
        last = file["steps"][sorted(file["steps"])[-1]]
        point, force = last["point"][...], np.linalg.norm(last["force"][...], axis=1)
        slides = last["sliding"][...] == 1
    size = 4.0 + 60.0 * force / force.max()
    for some, label in ((~slides, "sticks"), (slides, "slides")):
        axes[1].scatter(*(point[some][:, [0, 2]].T * 1e3), s=size[some], label=label)
    axes[1].set(xlabel="x [mm]", ylabel="z [mm]", title="contacts of the box, size: force")
    axes[1].legend()
    case.save(fig)
