"""What the deck of a solid prescribes: displacements of its groups over time."""

from pathlib import Path

import numpy as np

from talus.deck_json import deck_as_json

Curve = tuple[np.ndarray, np.ndarray]  # times [s], values


def groups_of(deck: dict, name: str) -> list[dict]:
    """Return all groups of one name of a deck as JSON."""
    found = deck.get(name, [])
    return found if isinstance(found, list) else [found]


def motions(deck: Path) -> dict[str, Curve]:
    """Return times [s] and displacements [m] by 'group component' as in `*_reactions.csv`.

    Several motions of one component are left out, as are those without a whole curve and all of a
    deck that is not there.
    """
    if not deck.is_file():
        return {}
    read = deck_as_json(deck.read_text(errors="replace"))
    curves = {c.get("id"): c for c in groups_of(read, "curve")}
    found: dict[str, Curve] = {}
    several = set()
    for motion in groups_of(read, "motion"):
        name = f"{motion.get('group')} {motion.get('component')}"
        curve = curves.get(motion.get("curve"))
        times, values = (np.ravel((curve or {}).get(key, [])) for key in ("times", "values"))
        if not 0 < times.size == values.size:
            continue
        several |= {name} & found.keys()
        found[name] = times, motion.get("scale", 1.0) * values
    return {name: curve for name, curve in found.items() if name not in several}
