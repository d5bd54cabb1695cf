"""Open a zone of a bed with a micropolar surround, at rest and while all turns about z."""

from pathlib import Path

import h5py
import numpy as np
from tile_zone import COPIES, EDGE, judge, look_at, make_bed, prepare_zone

from talus.mesh import read_mesh
from talus.packing import Packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

LAW = ("law = 'micropolar', density = 1590.0, micro_inertia = 3.6e-7, lambda = 1.6e7, mu = 1.2e7, "
       "kappa = 8.0e6, alpha = 0.0, beta = 0.0, gamma = 30.0")  # fmt: skip
RATE = 0.5  # [rad/s]
GHOST = 3  # kind of grains
HELD = 3  # contacts of a grain that cannot keep its own spin
MIDDLE = 0.5 * EDGE * np.array(COPIES)  # of the bed [m]


def run(case: Case) -> None:
    """Make the tile, open the zone twice, compare with rest and with the rigid rotation."""
    make_bed(case)
    folder, whole = prepare_zone(case, "rest")
    put_solid(folder / "solid.nml", turning=False)
    case.run("talus-couple", "rest/coupled.nml")
    judge(case, look_at(case, folder, whole))
    folder, whole = prepare_zone(case, "turning")
    put_solid(folder / "solid.nml", turning=True)
    put_motion(folder / "awake.h5")
    case.run("talus-couple", "turning/coupled.nml")
    audit = (folder / "coupled_audit.csv").read_bytes()
    found = rigid(case, folder, whole)
    case.above("grains that woke", float(found["woken"].sum()), 1500.0)
    case.below("way of grains against the rotation, of the largest", found["way"], 0.02)
    case.below("spin of held free grains against the rotation, rms", found["spin"], 0.02)
    case.below("spin of those that woke", found["fresh"], 0.02)
    case.below("spin of ghosts, largest", found["ghosts"], 0.02)
    case.below("micro-rotation of nodes against the angle, largest", found["phi"], 0.02)
    case.below("its rate", found["rate"], 0.02)
    case.below("how much faster all turns", found["faster"], 0.05)
    draw(case, found)
    case.run("talus-couple", "turning/coupled.nml", "--restart=turning/coupled.2.manifest")
    same = (folder / "coupled_audit.csv").read_bytes() == audit
    case.metric("a restart between conversions has other bits", float(not same), 0.0, 0.0)


def put_solid(deck: Path, turning: bool) -> None:
    """Give the deck of the solid the micropolar law, and the motion at the start."""
    text = deck.read_text()
    start, end = text.index("law = "), text.index(" /", text.index("law = "))
    text = (text[:start] + LAW + text[end:]).replace("hex8_bbar", "hex8/hex8")
    if turning:
        text = "\n".join(row for row in text.splitlines() if not row.startswith("&support")) + "\n"
        at = ", ".join(str(x) for x in MIDDLE)
        for component, slope in (("x", f"0.0, {-RATE}, 0.0"), ("y", f"{RATE}, 0.0, 0.0")):
            text += f"&initial group = 'all', component = '{component}', value = 0.0, "
            text += f"gradient = {slope}, origin = {at} /\n"
        text += f"&initial group = 'all', component = 'rz', value = {RATE} /\n"
    deck.write_text(text)


def put_motion(packing: Path) -> None:
    """Give the grains that are awake the motion at the start."""
    bed = read_packing(packing)
    bed.v = np.cross([0.0, 0.0, RATE], bed.x - MIDDLE)
    bed.omega = np.tile([0.0, 0.0, RATE], (bed.count, 1))
    write_h5(packing, bed)


def rigid(case: Case, folder: Path, whole: Packing) -> dict:
    """Compare the last state with the rigid rotation that its far corners make.

    They turn a little faster than at the start: dead loads that press a body which turns help it.
    """
    steps = field_steps(folder / "grains.h5")
    first, last = steps[0].grains, steps[-1].grains
    solid = field_steps(folder / "solid.h5")[-1].solid
    angle, rate = by_corners(read_mesh(folder / "bed.h5").x, solid)
    place = dict(zip(whole.id.tolist(), whole.x, strict=True))
    start = np.array([place[i] for i in last["id"].tolist()]) - MIDDLE
    c, s = np.cos(angle), np.sin(angle)
    way = start @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T - start
    off = np.linalg.norm(last["x"] - MIDDLE - start - way, axis=1)
    spin = np.linalg.norm(last["omega"] - [0.0, 0.0, rate], axis=1) / rate
    ids = steps[-1].contacts["ids"].clip(0).ravel()
    touching = np.bincount(ids, minlength=last["id"].max() + 1)
    free = (last["kind"] == 0) & (touching[last["id"]] >= HELD)
    fresh = ~np.isin(last["id"], first["id"])
    with h5py.File(sorted(folder.glob("coupled.x*.chk.h5"))[-1]) as file:
        there = nodes_of(folder, file["adapt/part"][:] >= 0)
    phi, turning = solid["phi"][there, 2] / angle, solid["phi_rate"][there, 2] / rate
    return {
        "woken": read_history(folder / "coupled_conversions.csv")["woken"],
        "way": off.max() / np.linalg.norm(way, axis=1).max(), "faster": rate / RATE - 1.0,
        "spin": np.sqrt(np.mean(spin[free] ** 2)), "fresh": np.sqrt(np.mean(spin[fresh] ** 2)),
        "ghosts": spin[last["kind"] == GHOST].max(), "phi": np.abs(phi - 1.0).max(), "phis": phi,
        "rate": np.abs(turning - 1.0).max(), "grains": last, "spins": last["omega"][:, 2] / rate,
    }  # fmt: skip


def by_corners(x: np.ndarray, solid: dict) -> tuple[float, float]:
    """Return angle [rad] and rate [rad/s] about z of the corners of the bed, by least squares."""
    far = (np.abs(x - MIDDLE) > 0.99 * MIDDLE).all(1)
    arm = x[far] - MIDDLE
    along = np.cross([0.0, 0.0, 1.0], arm)
    return tuple(float((solid[key][far] * along).sum() / (along**2).sum()) for key in ("u", "v"))


def nodes_of(folder: Path, chosen: np.ndarray) -> np.ndarray:
    """Return which nodes belong to chosen elements."""
    mesh = read_mesh(folder / "bed.h5")
    there = np.zeros(len(mesh.x), dtype=bool)
    there[mesh.cells["hex8"][chosen]] = True
    return there


def draw(case: Case, found: dict) -> None:
    """Draw spins of grains and micro-rotations of nodes."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(11, 4))
    g = found["grains"]
    for kind, label in ((0, "free"), (3, "ghosts")):
        those = g["kind"] == kind
        ax.plot(1e3 * g["x"][those, 0], found["spins"][those], ".", ms=3, label=label)
    ax.axhline(1.0, color="k", lw=0.8)
    ax.set(xlabel="x [mm]", ylabel="spin about z / that of the body [-]")
    ax.legend()
    ax2.hist(found["phis"], bins=40)
    ax2.axvline(1.0, color="k", lw=0.8)
    ax2.set(xlabel="micro-rotation of nodes / angle of the body [-]", ylabel="nodes")
    case.save(fig)
