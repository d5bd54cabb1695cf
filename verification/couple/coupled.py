"""What the cases of coupled runs share: boxes of hexahedra, decks with places to fill, audits,
and the comparison of two runs bit for bit."""

from pathlib import Path

import numpy as np

from talus.compare import difference, extent, max_of, same_arrays
from talus.mesh import box, write_mesh
from talus.verification import Case, field_steps, history_difference, read_history

ROUNDED = 1.0e-9  # of runs that go on on ranks


def write_box(
    path: Path, lower: list[float], upper: list[float], cells: tuple[int, int, int]
) -> None:
    """Write a box as mesh.h5 with facet and node groups x0 ... z1 and the volume 'all' [m]."""
    write_mesh(path, box(np.array(lower), np.array(upper), cells))


def write_deck(case: Case, name: str, base: str, /, **values: object) -> str:
    """Copy a deck with @key@ replaced by values; return the new name."""
    text = (case.folder / base).read_text()
    for key, value in values.items():
        text = text.replace(f"@{key}@", str(value))
    (case.folder / name).write_text(text)
    return name


def audit_of(case: Case, stem: str) -> dict[str, np.ndarray]:
    """Read <stem>_audit.csv of a coupled run."""
    return read_history(case.folder / f"{stem}_audit.csv")


def fields_that_differ(first: Path, second: Path) -> int:
    """Count the datasets of two field files that are not equal bit for bit, and missing steps."""
    a, b = field_steps(first), field_steps(second)
    count = abs(len(a) - len(b))
    for s, t in zip(a, b, strict=False):
        for p, q in ((s.grains, t.grains), (s.contacts, t.contacts), (s.solid, t.solid)):
            names = p.keys() | q.keys()
            count += sum(
                not (key in p and key in q and same_arrays({key: p[key]}, {key: q[key]}))
                for key in names
            )
    return count


def fields_off(first: Path, second: Path) -> float:
    """Return the largest difference of two field files, each dataset over its largest value."""
    a, b = field_steps(first), field_steps(second)
    off = 0.0 if len(a) == len(b) else np.inf
    for s, t in zip(a, b, strict=False):
        for p, q in ((s.grains, t.grains), (s.contacts, t.contacts), (s.solid, t.solid)):
            if p.keys() != q.keys():
                return np.inf
            for key in p:
                scale = max_of(extent(p[key]), 1e-300)
                off = max_of(off, difference(p[key], q[key]) / scale)
    return off


def compare_runs(case: Case, label: str, first: str, second: str) -> None:
    """Judge that two runs, named by the heads of their files, wrote the same.

    With grains on ranks what the ghosts feel is a sum of parts, which goes on in another order
    after a restart: then differences must stay round-off.
    """
    if case.ranks:
        compare_rounded(case, label, first, second)
        return
    for name in ("audit.csv", "grains_energy.csv", "solid_energy.csv", "solid_reactions.csv"):
        a, b = (case.folder / f"{head}_{name}" for head in (first, second))
        differs = float(a.read_bytes() != b.read_bytes())
        case.metric(f"{label}{name} differs", differs, 0.0, 0.0, "bytes")
    for side in ("grains", "solid"):
        a, b = (case.folder / f"{head}_{side}.h5" for head in (first, second))
        case.metric(f"{label}fields of the {side} that differ", fields_that_differ(a, b), 0, 0)


def compare_rounded(case: Case, label: str, first: str, second: str) -> None:
    """Judge the same to ROUNDED, of the largest value of a unit or dataset."""
    for name in ("audit.csv", "grains_energy.csv", "solid_energy.csv", "solid_reactions.csv"):
        off = history_difference(*(case.folder / f"{head}_{name}" for head in (first, second)))
        case.below(f"{label}{name}, difference on ranks", off, ROUNDED)
    for side in ("grains", "solid"):
        off = fields_off(*(case.folder / f"{head}_{side}.h5" for head in (first, second)))
        case.below(f"{label}fields of the {side}, difference on ranks", off, ROUNDED)
