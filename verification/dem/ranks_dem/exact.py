"""Grains on several ranks against the run on one."""

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np

from talus.compare import difference as apart
from talus.compare import extent, max_of
from talus.verification import Case, launcher, read_history, write_packing

SAME = 1.0e-12
RUNS = {"flow": (2, 3), "body": (2, 3), "servo": (2, 4), "cloud": (2, 4), "skin": (2, 3, 4)}


def lattice(shape: tuple[int, int, int], pitch: float, low: float) -> np.ndarray:
    """Return the points of a cubic lattice [m]."""
    axes = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    return np.column_stack([a.ravel() for a in axes]) * pitch + low


def write_packings(case: Case) -> None:
    """Write the grains of the runs; ids do not follow space."""
    rng = np.random.default_rng(3)
    x = lattice((6, 6, 8), 2.27e-3, 1.5e-3) + rng.uniform(-3e-5, 3e-5, (288, 3))
    x[:, 2] -= 0.3e-3
    axes = np.tile([1.15e-3, 1.1e-3, 1.0e-3], (288, 1))
    axes[::3] = 1.1e-3
    quat = rng.normal(size=(289, 4))
    quat /= np.linalg.norm(quat, axis=1)[:, None]
    kind = np.zeros(289, dtype=np.int32)
    kind[::40] = 1
    kind[288] = 2
    ids = rng.permutation(289) + 1
    x = np.vstack([x, [[8.0e-3, 8.0e-3, 21.5e-3]]])
    v = np.vstack([rng.normal(scale=0.05, size=(288, 3)), [[0.0, 0.0, 0.0]]])
    v[kind == 1] = 0.0
    write_packing(
        case.folder / "pack_flow.h5", x, np.vstack([axes, [[3.0e-3] * 3]]), quat=quat, kind=kind,
        ids=ids, groups={"tool": ids[288:]}, v=v,
    )  # fmt: skip
    x = lattice((4, 4, 4), 2.03e-3, 1.05e-3) + rng.uniform(-1e-5, 1e-5, (64, 3))
    write_packing(
        case.folder / "pack_servo.h5", x, np.full((64, 3), 1.0e-3), ids=rng.permutation(64) + 1
    )
    x = np.vstack([lattice((3, 3, 3), 2.5e-3, 0.0), lattice((3, 3, 3), 2.5e-3, 8.5e-3)])
    v = np.repeat([[0.8, 0.9, 1.0], [-0.9, -1.0, -0.7]], 27, axis=0)
    axes = np.tile([1.2e-3, 1.0e-3, 0.9e-3], (54, 1))
    write_packing(case.folder / "pack_cloud.h5", x, axes, ids=rng.permutation(54) + 1, v=v)
    x = lattice((6, 6, 3), 3.35e-3, -8.4e-3) + rng.uniform(-1e-4, 1e-4, (108, 3))
    x[:, 2] += 9.8e-3
    axes = np.full((108, 3), 1.5e-3)
    axes[::2] = [1.6e-3, 1.4e-3, 1.2e-3]
    v = rng.normal(scale=0.2, size=x.shape)
    write_packing(case.folder / "pack_skin.h5", x, axes, ids=rng.permutation(108) + 1, v=v)
    write_sheet(case.folder / "skin.stl", 10, 22.0e-3)


def write_sheet(path: Path, sides: int, edge: float) -> None:
    """Write a square of triangles that hangs through, as binary STL."""
    along = edge * np.linspace(-0.5, 0.5, sides + 1)
    node = np.stack(np.meshgrid(along, along, [-1.0e-3], indexing="ij"), -1)[:, :, 0]
    node[1:-1, 1:-1, 2] -= 1.0e-3
    a, b, c, d = node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:]
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(2 * sides**2, record)
    rows["corner"] = np.concatenate([np.stack([a, b, d], 2), np.stack([a, d, c], 2)]).reshape(
        -1, 3, 3
    )
    path.write_bytes(b"skin".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


def results(case: Case, stem: str) -> dict[str, np.ndarray]:
    """Return all fields of all steps, all columns of all histories but the closure error."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(case.folder / f"{stem}.h5") as file:
        file["steps"].visititems(
            lambda name, item: found.update({name: item[()]})
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fi" else None
        )  # fmt: skip
    for name in ("energy", "walls", "driven", "servo", "surfaces", "bodies"):
        path = case.folder / f"{stem}_{name}.csv"
        if path.exists():
            rows = read_history(path)
            found.update({f"{name}/{k}": v for k, v in rows.items() if "closure" not in k})
    return found


def difference(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> float:
    """Return the largest difference over the largest value of its kind."""
    if {k: v.shape for k, v in a.items()} != {k: v.shape for k, v in b.items()}:
        return np.inf
    scale: dict[str, float] = {}
    for key, values in a.items():
        scale[unit(key)] = max_of(scale.get(unit(key), 1e-300), extent(values))
    return max_of(apart(a[k], b[k]) / scale[unit(k)] for k in a)


def unit(key: str) -> str:
    """Return what a result is measured by: energies and forces by the largest of all."""
    first, _, last = key.rpartition("/")
    if first == "energy" and last not in ("time", "contacts", "max_overlap", "dt"):
        return "energy"
    if last.startswith(("force", "moment", "velocity", "spin", "turn")):
        return f"{first} {last.split('_')[0]}"
    return last if first.startswith("0") else key


def momentum(case: Case, stem: str) -> np.ndarray:
    """Return the momentum over mass and density of equal grains at each field, over its scale."""
    with h5py.File(case.folder / f"{stem}.h5") as file:
        v = [file[f"steps/{step}/grains/v"][()] for step in sorted(file["steps"])]
    return np.array([u.sum(0) for u in v]) / abs(v[0]).sum()


def judge_run(case: Case, name: str) -> list[float]:
    """Judge runs on several ranks; return the differences."""
    text = (case.folder / f"{name}.nml").read_text()
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    one = results(case, name)
    contacts = max(v.shape[0] for k, v in one.items() if k.endswith("contacts/ids"))
    case.above(f"{name}: most contacts in a field", float(contacts), 5.0)
    off = []
    for ranks in RUNS[name]:
        stem = f"{name}_{ranks}"
        (case.folder / f"{stem}.nml").write_text(text)
        case.run("talus-dem", f"{stem}.nml", "--threads=1", ranks=ranks)
        off.append(difference(one, results(case, stem)))
        case.below(f"{name}: {ranks} ranks, difference / largest", off[-1], SAME)
    shared = json.loads((case.folder / f"{stem}_summary.json").read_text())["ranks"]
    case.metric(f"{name}: ranks that the summary names", float(shared["count"]), float(ranks), 0)
    case.above(f"{name}: grains known to two ranks", float(shared["most_mirrors"]), 0.0)
    if name == "skin":
        for stem in ("skin", "skin_4"):
            energy = read_history(case.folder / f"{stem}_energy.csv")
            worst = float(energy["relative_closure"].max())
            case.below(f"{stem}: ledger", worst, 1e-4)
    return off


def judge_restart(case: Case, name: str, first: int, then: int) -> None:
    """Judge a run that goes on from half-way with another number of ranks."""
    stem = f"{name}_{first}" if first else name
    whole = results(case, stem)
    half = case.folder / f"{stem}_half.h5"
    if not half.exists():  # what goes on from it writes checkpoints of its own
        shutil.copy(next(case.folder.glob(f"{stem}.chk.1*.h5")), half)
    case.run("talus-dem", f"{stem}.nml", "--threads=1", f"--restart={half.name}", ranks=then)
    off = difference(whole, results(case, stem))
    title = f"{name}: {first or 1} ranks, then {then or 1}"
    case.below(f"{title}: difference / largest", off, SAME)


def judge_empty(case: Case) -> None:
    """Judge a run on more ranks than it has grains."""
    deck = (case.folder / "cloud.nml").read_text().replace("0.006", "2.0e-4")
    x = np.array([[0.0, 0.0, 0.0], [2.39e-3, 0.0, 0.0]])
    write_packing(case.folder / "pack_pair.h5", x, np.full((2, 3), 1.2e-3))
    for stem, ranks in (("pair", 0), ("pair_5", 5)):
        (case.folder / f"{stem}.nml").write_text(deck.replace("pack_cloud.h5", "pack_pair.h5"))
        case.run("talus-dem", f"{stem}.nml", "--threads=1", ranks=ranks)
    off = difference(results(case, "pair"), results(case, "pair_5"))
    case.below("two grains on 5 ranks: difference / largest", off, SAME)


def judge_death(case: Case) -> None:
    """Judge what is left when a rank is killed."""
    deck = (case.folder / "flow.nml").read_text().replace("t_end = 0.016", "t_end = 10.0")
    (case.folder / "killed.nml").write_text(
        deck.replace("every_time = 0.008, keep", "every_time = 0.001, keep")
    )
    command = [*launcher(3), str(case.bin("talus-dem")), "killed.nml"]
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    run = subprocess.Popen(
        command, cwd=case.folder, env=environment, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    ranks: list[int] = []
    while len(ranks) < 3 or not (case.folder / "killed.chk.h5").exists():
        time.sleep(0.05)
        ranks = children(run.pid)
    os.kill(ranks[-1], signal.SIGKILL)
    case.above("a rank is killed: exit code", float(run.wait(timeout=60.0)), 0.5)
    time.sleep(0.5)
    left = [pid for pid in ranks if is_alive(pid)]
    case.metric("a rank is killed: ranks that stay behind", float(len(left)), 0.0, 0)
    text = (case.folder / "killed.nml").read_text().replace("t_end = 10.0", "t_end = 0.03")
    (case.folder / "killed.nml").write_text(text)
    case.run("talus-dem", "killed.nml", "--threads=1", "--restart=auto", ranks=2)
    time_s = json.loads((case.folder / "killed_summary.json").read_text())["time_s"]
    case.above("a rank is killed: time that its last checkpoint leads to [s]", time_s, 0.03)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in found.read_text().split()] if found.exists() else []


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def run(case: Case) -> None:
    """Judge all runs, restarts and faults; plot the differences and the momentum."""
    write_packings(case)
    fig, (left, right) = case.figure(ncols=2, figsize=(9.0, 4.0))
    for place, name in enumerate(RUNS):
        off = judge_run(case, name)
        for ranks, value in zip(RUNS[name], off, strict=True):
            left.semilogy(ranks, max(value, 1e-17), "osd^v"[place], mfc="none", color=f"C{place}",
                          label=name if ranks == 2 else None)  # fmt: skip
    left.axhline(SAME, color="k", lw=1, label="limit")
    left.set(xlabel="ranks", ylabel="difference to one rank / largest [-]")
    left.set_xticks([2, 3, 4])
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    for stem in ("cloud", "cloud_2", "cloud_4"):
        change = momentum(case, stem)
        change = abs(change - change[0]).max(1)
        case.below(f"{stem}: change of momentum / sum of |m v|", float(change.max()), SAME)
        right.semilogy(range(len(change)), np.maximum(change, 1e-18), "-o", mfc="none", label=stem)
    right.axhline(SAME, color="k", lw=1)
    right.set(xlabel="field", ylabel="change of momentum / sum of |m v| [-]")
    right.legend()
    for name in ("flow", "skin"):
        judge_restart(case, name, 2, 0)
        judge_restart(case, name, 0, 2)
        judge_restart(case, name, 2, 3)
    judge_empty(case)
    judge_death(case)
    case.save(fig)
