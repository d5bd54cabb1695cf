"""Words of a study file: faults that name the nearest word, and values of a wanted type."""

import difflib
from collections.abc import Iterable

from talus.faults import FaultError


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest known word, or with all of them."""
    known = list(known)
    if near := difflib.get_close_matches(str(word), known, 1, 0.5):
        return f"did you mean '{near[0]}'?"
    return f"there are: {', '.join(known)}" if known else "there are none"


def check_words(table: dict, known: Iterable[str], place: str) -> None:
    """Refuse (E580) a word that the table cannot have."""
    for word in table:
        if word not in set(known):
            raise FaultError("E580", f"unknown word '{word}'", nearest(word, known), place)


def take(table: dict, name: str, kind: type | tuple, place: str, default: object = None) -> object:
    """Return a value of a wanted type; without default it must be there (E580)."""
    if name not in table:
        if default is None:
            raise FaultError("E580", f"'{name}' is missing", "see manual, Studies", place)
        return default
    value = table[name]
    kinds = kind if isinstance(kind, tuple) else (kind,)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        wanted = " or ".join(one.__name__ for one in kinds)
        raise FaultError("E580", f"{name} = {value!r} is no {wanted}", "", place)
    return value
