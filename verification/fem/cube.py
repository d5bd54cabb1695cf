"""What cases of yielding cubes share: the mesh, decks from templates, ledger, restart, ranks."""

import shutil

import numpy as np
from solid import distorted_cube, save

from talus.compare import difference, extent, max_of, same_arrays
from talus.mesh import Mesh, boundary_faces
from talus.verification import Case, field_steps, read_history

WORKS = ("load", "support", "strain", "plastic")


def write_cube(case: Case, file: str, kind: str = "hex8") -> Mesh:
    """Write the distorted cube with its six faces."""
    mesh = distorted_cube(2, kind)
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    for k, c in enumerate("xyz"):
        for side in (0, 1):
            on = [q for q in faces if np.isclose(mesh.x[q][:, k], side).all()]
            mesh.facets[f"{c}{side}"] = np.array(on)
    save(mesh, case.folder / file)
    return mesh


def write_deck(case: Case, name: str, template: str, words: dict[str, str]) -> str:
    """Fill a template; return the stem of the deck."""
    text = (case.folder / template).read_text()
    for word, value in ({"NAME": name} | words).items():
        text = text.replace(word, value)
    stem = name.replace(" ", "_")
    (case.folder / f"{stem}.nml").write_text(text)
    return stem


def judge_ledger(case: Case, name: str, stem: str, growth_limit: float,
                 limit: float = 1e-8) -> dict[str, np.ndarray]:  # fmt: skip
    """Judge closure and growth of the dissipation over the largest work; return the ledger."""
    energy = read_history(case.folder / f"{stem}_energy.csv")
    work = max_of(abs(energy[k]).max() for k in WORKS)
    off = float(abs(energy["closure"]).max() / work)
    case.below(f"{name}: ledger, error / largest", off, limit)
    growth = float(np.diff(energy["plastic"]).min() / work)
    case.above(f"{name}: least growth of the dissipation / largest", growth, growth_limit)
    return energy


def judge_restart(case: Case, stem: str, threads: int = 1) -> None:
    """Judge the bits of a run that goes on from the checkpoint half-way."""
    whole = field_steps(case.folder / f"{stem}.h5")
    kept = {p: p.read_bytes() for p in case.folder.glob(f"{stem}_*.csv") if "point" not in p.name}
    shutil.copy(case.folder / f"{stem}.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", f"{stem}.nml", "--restart=half.chk.h5", f"--threads={threads}")
    again = field_steps(case.folder / f"{stem}.h5")
    same = len(kept) > 0 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    more = f" on {threads} threads" if threads > 1 else ""
    case.metric(f"{stem}: restart{more} repeats every bit", float(same), 1.0, 0)


def judge_ranks(case: Case, stem: str, other: str) -> None:
    """Judge fields of a run on one rank and of another on several."""
    one, more = (field_steps(case.folder / f"{s}.h5") for s in (stem, other))
    case.metric(f"{stem}: outputs on ranks / on one", len(more) / len(one), 1.0, 0)
    off = max_of(
        difference(a.solid[key], b.solid[key]) / max_of(extent(s.solid[key]) for s in one)
        for a, b in zip(one, more, strict=True)
        for key in ("u", "stress", "state_points")
    )
    case.below(f"{stem}: ranks, difference / largest", float(off), 1e-10)
