"""What the cases of coupled runs share: boxes of hexahedra, grains between ghosts and planes, decks."""

from pathlib import Path

import numpy as np

from talus.mesh import box, write_mesh
from talus.verification import Case, read_history


def write_box(path: Path, lower: list[float], upper: list[float], cells: tuple[int, int, int]) -> None:
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
