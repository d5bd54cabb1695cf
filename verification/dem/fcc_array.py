"""A face-centred cubic array of spheres in a periodic cell, for the cases that shorten it."""

import re

import numpy as np

from talus.verification import Case, write_packing

RADIUS, CELLS, OVERLAP = 1.0e-3, 3, 1.6e-7  # [m], [-], [m]


def write_array(case: Case) -> str:
    """Write the packing fcc.h5 and give the sizes of its cell as a deck wants them [m]."""
    side = 2.0 * RADIUS - OVERLAP
    edges = side * np.array([1.0, 1.0, np.sqrt(2.0)])
    corners = np.stack(np.meshgrid(*[np.arange(CELLS)] * 3, indexing="ij"), -1).reshape(-1, 3)
    x = edges * np.concatenate([corners + 0.25, corners + 0.75])
    write_packing(case.folder / "fcc.h5", x, np.full((len(x), 3), RADIUS))
    return ", ".join(f"{CELLS * edge:.17g}" for edge in edges)


def write_deck(case: Case, name: str, words: dict[str, str]) -> None:
    """Write name.nml, the case's deck with these words in it replaced."""
    text = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        text = re.sub(rf"\b{word}\b", value, text)
    (case.folder / f"{name}.nml").write_text(text)
