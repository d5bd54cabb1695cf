"""Open a zone that lies over the border of a dense and a loose tile."""

from pathlib import Path

import numpy as np
from tile_zone import CENTRE, COPIES, DECKS, DIAMETER, EDGE, STRESS

from talus.cli import main
from talus.mesh import box, write_mesh
from talus.packing import read_packing, write_h5
from talus.tile_stamp import Stamp, read_stamp
from talus.verification import Case, Step, field_steps, read_history

GRAINS = "--count 280 --axes 1e-3 1e-3 1e-3 --spread 0.1 --young 2.9e8 --least-edges 6"
TILES = {"dense": "--making-friction 0.05 --seed 1", "loose": "--making-friction 0.5 --seed 2"}
CELLS, BORDER = (12, 7, 7), 0.5 * EDGE * COPIES[0]  # of the mesh, and between the tiles [m]
BAND = 1.5 * DIAMETER  # beside the border, in which grains of both may wake [m]
EXCHANGE = 1.0e-5  # interval of the deck [s]
DENSITY = 2650.0  # of the grains [kg/m3]


def run(case: Case) -> None:
    """Make two tiles, open the zone, judge who woke, masses, energy and stress."""
    stamps = [made(case, name, words) for name, words in TILES.items()]
    prepare(case, stamps)
    case.run("talus-couple", "coupled.nml")
    rows = read_history(case.folder / "coupled_conversions.csv")
    last = field_steps(case.folder / "grains.h5")[-1]
    judge_grains(case, rows, last, stamps)
    judge_energy(case, rows)
    judge_stress(case, last, stamps)
    draw(case, last)


def made(case: Case, name: str, words: str) -> Stamp:
    """Make a tile; return its stamp."""
    path = case.folder / f"{name}.h5"
    words = f"pack tile {GRAINS} --stress {STRESS} --edge {EDGE} {words} -o {path}"
    if main(words.split()) != 0:
        raise RuntimeError(f"{path} was not made")
    return read_stamp(path)


def prepare(case: Case, stamps: list[Stamp]) -> None:
    """Write the mesh with a group a half, the grains that are awake at first, the decks."""
    mesh = box(np.zeros(3), EDGE * np.array(COPIES), CELLS)
    left = mesh.x[mesh.hex8].mean(axis=1)[:, 0] < BORDER
    mesh.volumes |= {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    write_mesh(case.folder / "bed.h5", mesh)
    whole = read_packing(case.folder / "dense.h5").repeated(COPIES)
    half = 2.5 * EDGE * COPIES[1] / CELLS[1]  # five elements
    near = (np.abs(whole.x - CENTRE)[:, 1:] < half).all(axis=1) & (whole.x[:, 0] < BORDER)
    awake = whole.take(np.flatnonzero(near))
    awake.cell = awake.corner = awake.shift = None
    write_h5(case.folder / "awake.h5", awake)
    text = (DECKS / "grains.nml").read_text().splitlines()
    k = next(k for k, row in enumerate(text) if row.startswith("&tile"))
    row = text[k].replace(" /", ", plastic_strain = 0.0 /")
    text[k : k + 1] = [row.replace("tile.h5", f"{name}.h5") for name in TILES]
    (case.folder / "grains.nml").write_text("\n".join(text) + "\n")
    solid = (DECKS / "solid.nml").read_text().splitlines()
    for word in ("&material", "&section"):
        k = next(k for k, row in enumerate(solid) if row.startswith(word))
        solid[k : k + 1] = [
            solid[k].replace("'soil'", f"'{side}'").replace("'all'", f"'{side}'").replace(
                "1590.0", repr(float(DENSITY * stamp.solid_fraction)))
            for side, stamp in zip(("left", "right"), stamps, strict=True)
        ]  # fmt: skip
    (case.folder / "solid.nml").write_text("\n".join(solid) + "\n")


def tiles_of(folder: Path, ids: np.ndarray) -> np.ndarray:
    """Whether grains (n) are of the loose tile, by their ids."""
    return ids > read_packing(folder / "dense.h5").count * int(np.prod(COPIES))


def judge_grains(case: Case, rows: dict, last: Step, stamps: list[Stamp]) -> None:
    """Each half wakes its own tile but for the band, and has its mass."""
    x, loose = last.grains["x"], tiles_of(case.folder, last.grains["id"])
    right = x[:, 0] > BORDER
    off = np.abs(x[:, 0] - BORDER) > BAND + 0.1 * DIAMETER
    case.metric("grains off the band that are of the other half's tile",
                float((loose != right)[off].sum()), 0.0, 0.0)  # fmt: skip
    case.above("grains of the right half off the band", float((right & off).sum()), 300.0)
    case.above("grains of the other tile that woke in the band", rows["guests"].sum(), 10.0)
    change = rows["guests"].sum() - rows["lost"].sum()
    case.metric("grains of the band, gained less lost, of all in it", change / (~off).sum(), 0.0,
                0.03)  # fmt: skip
    density = [stamp.solid_fraction for stamp in stamps]  # gap_mass is over the mean of the solid
    case.metric("mass of the ghosts at first / of the dense continuum in their elements",
                (1.0 + rows["gap_mass"][0]) * np.mean(density) / density[0], 1.0, 0.03)  # fmt: skip
    case.below("overlapped volume of a seam, of the grains that wake", rows["seam_overlap"].max(),
               0.02)  # fmt: skip


def judge_energy(case: Case, rows: dict) -> None:
    """Energy less what conversions brought and grains have dissipated is kept.

    What is dissipated as grains come to rest in a conversion is in what this has brought.
    """
    audit = read_history(case.folder / "coupled_audit.csv")
    change = np.diff(audit["total_energy"] - audit["conversion_energy"])
    lost = sum(np.diff(audit[f"grains_{name}"])
               for name in ("friction", "contact_damping", "background_damping"))  # fmt: skip
    after = audit["time"][1:, None] - rows["time"]
    within = ((after > 0.0) & (after < 1.5 * EXCHANGE)).any(axis=1)
    change = np.abs(change + np.where(within, 0.0, lost))
    case.below("change of energy in an exchange less what was brought and dissipated, relative",
               change.max() / audit["total_energy"][-1], 1e-3)  # fmt: skip
    case.below("kinetic energy of the grains, of the elastic",
               (audit["grains_kinetic"] / audit["grains_elastic"]).max(), 0.02)  # fmt: skip


def judge_stress(case: Case, last: Step, stamps: list[Stamp]) -> None:
    """Pressure of free grains beside the border and off it, over that of the tiles."""
    found = profile(last)
    near = np.abs(found["x"] - BORDER) < BAND + 0.5 * DIAMETER
    wanted = float(np.mean([np.trace(stamp.stress) / 3.0 for stamp in stamps]))
    case.metric("pressure of free grains at the seam / the tiles'",
                pressure(found, near) / wanted, 1.0, 0.25)  # fmt: skip
    case.metric("pressure of free grains left of it / the tiles'",
                pressure(found, ~near & (found["x"] < BORDER)) / wanted, 1.0, 0.25)  # fmt: skip
    case.below("overlap of free grains / the radius", float(found["overlap"].max()) / DIAMETER * 2,
               0.05)  # fmt: skip


def profile(last: Step) -> dict[str, np.ndarray]:
    """Places x of free grains, the sums of force times branch of each, volumes, overlaps."""
    grains, contacts = last.grains, last.contacts
    row = {int(i): k for k, i in enumerate(grains["id"])}
    pairs = np.array([[row.get(int(a), -1), row.get(int(b), -1)] for a, b in contacts["ids"]])
    both = (pairs >= 0).all(axis=1)
    pairs, force = pairs[both], contacts["force"][both]
    branch = grains["x"][pairs[:, 1]] - grains["x"][pairs[:, 0]]
    half = 0.5 * (force * branch).sum(axis=1)
    sums = np.zeros(len(grains["id"]))
    np.add.at(sums, pairs[:, 0], half)
    np.add.at(sums, pairs[:, 1], half)
    free = grains["kind"] == 0
    of_free = free[pairs].all(axis=1)
    volume = 4.0 / 3.0 * np.pi * grains["axes"].prod(axis=1)
    return {
        "x": grains["x"][free, 0], "sums": sums[free], "volume": volume[free],
        "overlap": contacts["overlap"][both][of_free],
    }  # fmt: skip


def pressure(found: dict[str, np.ndarray], chosen: np.ndarray) -> float:
    """Pressure of chosen grains, at a solid fraction of 0.6 [Pa]."""
    return float(0.6 * found["sums"][chosen].sum() / found["volume"][chosen].sum() / 3.0)


def draw(case: Case, last: Step) -> None:
    """Grains of both tiles in a section; pressure along the bed."""
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(11, 4))
    grains = last.grains
    middle = np.abs(grains["x"][:, 1] - CENTRE[1]) < DIAMETER
    x, loose = 1e3 * grains["x"][middle], tiles_of(case.folder, grains["id"][middle])
    free = grains["kind"][middle] == 0
    for of_loose, name, color in ((False, "dense", "C0"), (True, "loose", "C1")):
        for of_free, fill in ((True, color), (False, "none")):
            chosen = (loose == of_loose) & (free == of_free)
            label = f"{name}, {'free' if of_free else 'ghosts'}"
            ax.scatter(x[chosen, 0], x[chosen, 2], s=40, fc=fill, ec=color, lw=0.8, label=label)
    ax.axvline(1e3 * BORDER, color="black", lw=0.8)
    ax.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal")
    ax.legend(fontsize=7)
    found = profile(last)
    places = np.arange(10e-3, 40e-3, 2e-3)
    near = [np.abs(found["x"] - place) < 2e-3 for place in places]
    values = [pressure(found, those) if those.any() else np.nan for those in near]
    ax2.plot(1e3 * places, 1e-3 * np.array(values), "o-", label="free grains")
    ax2.axhline(1e-3 * STRESS, color="black", lw=0.8, label="tiles")
    ax2.axvline(1e3 * BORDER, color="black", lw=0.8)
    ax2.set(xlabel="x [mm]", ylabel="pressure [kPa]", ylim=(0.0, None))
    ax2.legend(fontsize=7)
    case.save(fig)
