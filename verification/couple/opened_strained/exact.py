"""Open a zone of a bed that was strained before, with and without the replay of its history."""

import numpy as np
from tile_zone import CENTRE, COPIES, EDGE, make_tile

from talus.mesh import box, write_mesh
from talus.packing import Packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

RAMP = 8.0e-3  # [s]
AXES = "xyz"


def run(case: Case) -> None:
    """Make the tile; strain the bed, open the zone, strain the tile alike; compare."""
    make_tile(case)
    found = {}
    for strain in (1e-3, 1e-2):
        chord = moduli(case, strain)
        for birth in ("replay", "tile"):
            found[strain, birth] = opened(case, strain, birth, chord)
    own = found[1e-3, "replay"]
    case.above("0.1 %: replays", float(own["rows"]["replays"].sum()), 5.0)
    case.metric("0.1 %: pressure / that of the tile that went the same way", own["pressure"],
                1.0, 0.03)  # fmt: skip
    case.below("0.1 %: stress against it, of the pressure", own["stress"], 0.03)
    case.below("0.1 %: contacts a grain against it, relative", own["contacts"], 0.01)
    case.below("0.1 %: gap of the law's stress, of the tile's pressure",
               own["rows"]["gap_stress"].max(), 0.1)  # fmt: skip
    case.below("0.1 %: friction in 0.1 ms after conversions, of the elastic energy",
               own["friction"], 2e-3)  # fmt: skip
    large, bare = found[1e-2, "replay"], found[1e-2, "tile"]
    case.above("1 %: the gap tells that a linear law does not fit",
               large["rows"]["gap_stress"].max(), 0.2)  # fmt: skip
    case.below("1 %: friction after conversions, with replay / without",
               large["friction"] / bare["friction"], 0.85)  # fmt: skip
    draw(case, found)


def cell_run(case: Case, name: str, rates: dict[str, float]) -> tuple[dict, object]:
    """Strain the tile in a cell of its own; return the history of the cell and the last state."""
    folder = case.folder / name
    folder.mkdir()
    rows = [f"&cell_rate component = '{at}', rate = {rate}, curve = 'push' /"
            for at, rate in rates.items()]  # fmt: skip
    text = (case.folder / "tile.nml").read_text()
    (folder / "tile.nml").write_text(text + "\n".join(rows) + "\n")
    case.run("talus-dem", f"{name}/tile.nml")
    return read_history(folder / "tile_cell.csv"), field_steps(folder / "tile.h5")[-1]


def moduli(case: Case, strain: float) -> dict[str, float]:
    """Return the moduli of the chord at a strain, from an element test of the tile."""
    rows, _ = cell_run(case, f"chord_{strain}", {"xx": np.log(1.0 - strain) / RAMP})
    change = [rows[f"stress_{a}{a}"][-1] - rows[f"stress_{a}{a}"][0] for a in AXES]
    ratio = 0.5 * (change[1] + change[2]) / change[0]
    poisson = ratio / (1.0 + ratio)
    along = -change[0] / strain
    young = along * (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson)
    return {"YOUNG": young, "POISSON": poisson}


def opened(case: Case, strain: float, birth: str, chord: dict[str, float]) -> dict:
    """Strain the bed, open the zone; compare what is free with the tile that went the same way."""
    folder = case.folder / f"{birth}_{strain}"
    folder.mkdir()
    tile = read_packing(case.folder / "tile.h5")
    write_h5(folder / "tile.h5", tile)
    whole = tile.repeated(COPIES)
    near = (np.abs(whole.x - CENTRE) < [0.02, 0.012, 0.012]).all(1)
    bed = whole.take(np.flatnonzero(near))
    bed.cell = bed.corner = bed.shift = None
    write_h5(folder / "awake.h5", bed)
    write_mesh(folder / "bed.h5", box(np.zeros(3), EDGE * np.array(COPIES), (12, 7, 7)))
    times = np.linspace(0.0, RAMP, 41)
    s = times / RAMP
    values = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    names = {"BIRTH": birth, "SCALE": -strain * EDGE * COPIES[0], **chord,
             "TIMES": ", ".join(str(t) for t in [*times, 1.0]),
             "VALUES": ", ".join(str(v) for v in [*values, 1.0])}  # fmt: skip
    for deck in ("coupled", "grains", "solid"):
        text = (case.folder / f"{deck}.nml").read_text()
        for name, value in names.items():
            text = text.replace(name, str(value))
        (folder / f"{deck}.nml").write_text(text)
    case.run("talus-couple", f"{folder.name}/coupled.nml")
    rows = read_history(folder / "coupled_conversions.csv")
    audit = read_history(folder / "coupled_audit.csv")
    lost = np.interp(rows["time"][1:] + 1e-4, audit["time"], audit["grains_friction"])
    lost -= np.interp(rows["time"][1:], audit["time"], audit["grains_friction"])
    last = field_steps(folder / "grains.h5")[-1]
    share = lost.sum() / audit["grains_elastic"][-1]
    start = dict(zip(whole.id.tolist(), whole.x, strict=True))
    judged = compared(case, last, tile, start, folder.name)
    return {"rows": rows, "friction": share, "audit": audit} | judged


def compared(case: Case, step: object, tile: Packing, start: dict, name: str) -> dict:
    """Return stress and contacts of free grains that touch free ones alone, against the tile's.

    The tile goes along the mean strain of these grains; compared is the sum over the same rows.
    """
    grains, ids = step.grains, step.contacts["ids"].tolist()
    free = set(grains["id"][grains["kind"] == 0].tolist())
    inner = set(free)
    for a, b in ids:
        if a not in free or b not in free:
            inner -= {a, b}
    place = dict(zip(grains["id"].tolist(), grains["x"], strict=True))
    old, now = (np.array([at[i] for i in inner]) for at in (start, place))
    deform = np.linalg.lstsq(np.c_[old, np.ones(len(old))], now, rcond=None)[0][:3].T
    stretch = 0.5 * (deform + deform.T)
    rates = {a + a: np.log(stretch[i, i]) / RAMP for i, a in enumerate(AXES)}
    _, truth = cell_run(case, f"{name}_truth", rates)
    count = len(tile.x)
    known = by_grain(truth, np.diag(np.diag(stretch)) @ tile.cell)
    mine = by_grain(step, None)
    none = (np.zeros((3, 3)), 0)
    own, other = ([at.get(key(i), none) for i in inner]
                  for at, key in ((mine, lambda i: i),
                                  (known, lambda i: (i - 1) % count + 1)))  # fmt: skip
    a, b = (sum(stress for stress, _ in rows) for rows in (own, other))
    z = [sum(n for _, n in rows) / len(rows) for rows in (own, other)]
    return {"pressure": np.trace(a) / np.trace(b), "contacts": abs(z[0] / z[1] - 1.0), "z": z,
            "stress": np.abs(a - b).max() / abs(np.trace(b) / 3.0), "pair": (a, b),
            "strain": np.diag(stretch) - 1.0, "inner": len(inner)}  # fmt: skip


def by_grain(step: object, cell: np.ndarray | None) -> dict:
    """Return volume times stress of each grain, and its contacts; in a cell over its faces."""
    grains, contacts = step.grains, step.contacts
    place = dict(zip(grains["id"].tolist(), grains["x"], strict=True))
    found = {}
    rows = zip(contacts["ids"].tolist(), contacts["force"], contacts["point"], strict=True)
    for pair, force, point in rows:
        for grain, sign in zip(pair, (-1.0, 1.0), strict=True):
            arm = point - place[grain]
            if cell is not None:
                whole = np.linalg.solve(cell, arm)
                arm = cell @ (whole - np.rint(whole))
            stress, n = found.get(grain, (np.zeros((3, 3)), 0))
            found[grain] = (stress + sign * np.outer(arm, force), n + 1)
    return found


def draw(case: Case, found: dict) -> None:
    """Draw stresses against the tile's, replays and gaps, kinetic energy."""
    fig, (ax, ax2, ax3) = case.figure(ncols=3, figsize=(13, 4))
    for k, (key, own) in enumerate(found.items()):
        a, b = own["pair"]
        scale = np.trace(b) / 3.0
        label = f"{100 * key[0]:.1f} %, {key[1]}"
        ax.plot([0, 1, 2], np.diag(a) / scale, "osd^"[k], label=label)
        ax.plot([0, 1, 2], np.diag(b) / scale, "k_", ms=18)
        rows = own["rows"]
        if key[1] == "replay":
            ax2.plot(1e3 * rows["time"], rows["gap_stress"], "o-", label=label)
        audit = own["audit"]
        ax3.semilogy(1e3 * audit["time"], audit["grains_kinetic"] / audit["grains_elastic"],
                     label=label)  # fmt: skip
    ax.set(xticks=[0, 1, 2], xticklabels=["xx", "yy", "zz"],
           ylabel="stress of the zone / mean of the tile (bars)")  # fmt: skip
    ax2.set(xlabel="time [ms]", ylabel="gap of the stress / tile's pressure at rest")
    ax3.set(xlabel="time [ms]", ylabel="kinetic / elastic energy of the grains")
    for axis in (ax, ax2, ax3):
        axis.legend()
    case.save(fig)
