"""A bed of tiles of spheres under pressure of which a zone is opened: input of several cases."""

import os
from pathlib import Path

import numpy as np

from talus.cli import main
from talus.mesh import box, write_mesh
from talus.packing import Packing, read_packing, write_h5
from talus.verification import Case, field_steps, read_history

COPIES, EDGE, DIAMETER, STRESS = (5, 3, 3), 0.012, 1.9e-3, 20.0e3  # [m], [m], [Pa]
FORCE = 1e-6  # of the largest one, by which forces may differ and below which contacts may open
CENTRE = np.array([0.0146, 0.018, 0.018])
DECKS = Path(__file__).parent / "opened_zone"  # of grains and solid


def make_bed(case: Case) -> None:
    """Make the tile and find the forces of the whole bed (still.h5)."""
    make_tile(case)
    whole_bed(case)


def judge(case: Case, found: dict) -> None:
    """Nothing moves, energy and momentum are kept, contacts are those of the whole bed."""
    case.below("largest way of a grain, of a diameter", found["moved"], 1e-4)
    case.below("kinetic energy, of the elastic", found["kinetic"], 1e-6)
    case.below("change of energy in an exchange, less what a conversion brought, relative",
               found["closure"], 1e-9)  # fmt: skip
    case.below("momentum brought, of all grains at the speed of the elastic energy",
               found["momentum"], 1e-6)  # fmt: skip
    case.below("forces against those of the tile, of the largest", found["forces"], FORCE)
    case.metric("contacts of free grains that the tile has, or has not", found["others"], 0.0, 0.0)
    case.metric("stress of the opened zone / of the same grains in the tile", found["stress"], 1.0,
                1e-6)  # fmt: skip


def make_tile(case: Case) -> None:
    """Make the tile (tile.h5)."""
    here = os.getcwd()
    os.chdir(case.folder)
    words = "--count 280 --axes 1e-3 1e-3 1e-3 --spread 0.1 --young 2.9e8 --making-friction 0.2"
    made = main(["pack", "tile", *words.split(), "--stress", str(STRESS), "--edge", str(EDGE),
                 "--least-edges", "6", "-o", "tile.h5"])  # fmt: skip
    os.chdir(here)
    case.metric("the tile is made", float(made), 0.0, 0.0)


def zone_opened(case: Case, name: str, friction: bool = True, law: str = "") -> dict:
    """Run with the tile or without the tangential forces of its contacts; return what is judged.

    The case's folder holds tile.h5 and still.h5 (see `make_bed`) and coupled.nml. A law stands in
    place of the elastic one in the deck of the solid, which then has the stress of the tile.
    """
    folder, whole = prepare_zone(case, name, friction)
    if law:
        put_law(folder / "solid.nml", law)
    case.run("talus-couple", f"{name}/coupled.nml")
    return look_at(case, folder, whole)


def prepare_zone(case: Case, name: str, friction: bool = True) -> tuple[Path, Packing]:
    """Write the input of a run; return its folder, and the whole bed."""
    folder = case.folder / name
    folder.mkdir()
    tile = read_packing(case.folder / "tile.h5")
    if not friction:
        tile.tangential = 0.0 * tile.tangential
    write_h5(folder / "tile.h5", tile)
    whole = tile.repeated(COPIES)
    near = (np.abs(whole.x - CENTRE) < [0.02, 0.012, 0.012]).all(1)
    bed = whole.take(np.flatnonzero(near))
    bed.cell = bed.corner = bed.shift = None
    write_h5(folder / "awake.h5", bed)
    write_mesh(folder / "bed.h5", box(np.zeros(3), EDGE * np.array(COPIES), (12, 7, 7)))
    for deck in ("coupled", "grains", "solid"):
        source = case.folder if deck == "coupled" else DECKS
        (folder / f"{deck}.nml").write_text((source / f"{deck}.nml").read_text())
    return folder, whole


def look_at(case: Case, folder: Path, whole: Packing) -> dict:
    """Return what is judged of a run beside the whole bed."""
    rows = read_history(folder / "coupled_conversions.csv")
    audit = read_history(folder / "coupled_audit.csv")
    last = field_steps(folder / "grains.h5")[-1]
    place = dict(zip(whole.id.tolist(), whole.x, strict=True))
    start = np.array([place[i] for i in last.grains["id"].tolist()])
    way = np.linalg.norm(last.grains["x"] - start, axis=1)
    energy = audit["total_energy"] - audit["conversion_energy"]
    mass = 2650.0 * np.pi / 6.0 * DIAMETER**3 * len(last.grains["id"])
    scale = np.sqrt(2.0 * mass * audit["grains_elastic"][-1])  # [kg m/s]
    return {
        "conversions": len(rows["time"]) - 1, "woken": rows["woken"].sum(), "rows": rows,
        "moved": way.max() / DIAMETER, "time": audit["time"],
        "kinetic": audit["grains_kinetic"].max() / audit["grains_elastic"][-1],
        "curve": audit["grains_kinetic"] / audit["grains_elastic"], "grains": last.grains,
        "closure": np.abs(np.diff(energy)).max() / energy[-1],
        "momentum": rows["momentum"].max() / scale,
    } | contacts_of(case, last)  # fmt: skip


def put_law(deck: Path, law: str) -> None:
    """Give the deck of a solid a law with a state, and the tile's pressure as its stress."""
    text = deck.read_text()
    start, end = text.index("law = "), text.index(", density")
    text = text[:start] + law + text[end:]
    if "young" in law or "swelling_index" in law:
        text = text.replace(", young = 4.0e7, poisson = 0.25", "")
    row = ", ".join([f"{-STRESS}"] * 3 + ["0.0"] * 3)
    deck.write_text(text + f"&initial_stress group = 'all', value = {row} /\n")


def contacts_of(case: Case, last: object) -> dict:
    """Compare contacts, forces and stress of free grains with those of the whole bed."""
    still = field_steps(case.folder / "still.h5")[0]
    grains = last.grains
    free = set(grains["id"][grains["kind"] == 0].tolist())
    known, found = (forces_of(step.contacts, free) for step in (still, last))
    place = dict(zip(grains["id"].tolist(), grains["x"], strict=True))
    largest = max(np.abs(f).max() for f in known.values())
    both = set(known) & set(found)
    stress = [sum(((a in free) + (b in free)) * f[(a, b)] @ (place[b] - place[a]) for a, b in both)
              for f in (found, known)]  # fmt: skip
    others = [np.abs((known | found)[pair]).max() for pair in set(known) ^ set(found)]
    return {
        "forces": max(np.abs(found[pair] - known[pair]).max() for pair in both) / largest,
        "others": float(sum(force > FORCE * largest for force in others)),
        "stress": stress[0] / stress[1],
    }  # fmt: skip


def forces_of(contacts: dict, free: set[int]) -> dict[tuple[int, int], np.ndarray]:
    """Return the force of each contact of a free grain."""
    pairs = zip(contacts["ids"].tolist(), contacts["force"], strict=True)
    return {tuple(ids): force for ids, force in pairs if free & set(ids)}


def whole_bed(case: Case) -> None:
    """Find the forces of the whole bed."""
    whole = read_packing(case.folder / "tile.h5").repeated(COPIES)
    whole.cell = whole.corner = whole.shift = None
    write_h5(case.folder / "whole.h5", whole)
    text = (DECKS / "grains.nml").read_text().replace("awake.h5", "whole.h5")
    text = text.replace("gravity", "t_end = 4.0e-6, gravity")
    rows = [line for line in text.splitlines() if not line.startswith("&tile")]
    (case.folder / "still.nml").write_text("\n".join(rows) + "\n")
    case.run("talus-dem", "still.nml")
