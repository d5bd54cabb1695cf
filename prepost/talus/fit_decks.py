"""The deck where a fit begins: constants of its first &material, read and replaced."""

import re
from pathlib import Path

from talus.faults import FaultError

MATERIAL = re.compile(r"&material\b(.*?)(?<!\S)/", re.I | re.S)


def number_pattern(name: str) -> re.Pattern:
    """Match a constant of one number in a group: its key with `=`, and the number."""
    return re.compile(rf"(?<![\w])({name}\s*=\s*)([-+]?[\d.]+(?:[eEdD][-+]?\d+)?)", re.I)


def read_deck(deck: Path) -> str:
    """Return the text of a deck."""
    try:
        return deck.read_text()
    except OSError as fault:
        raise FaultError(
            "E560", f"cannot read the deck: {fault.strerror}", place=str(deck)
        ) from fault


def read_material(deck: Path) -> str:
    """Return the first &material of a deck, without comments."""
    text = read_deck(deck)
    found = MATERIAL.search("\n".join(line.split("!")[0] for line in text.splitlines()))
    if not found:
        hint = "its constants are where the fit begins"
        raise FaultError("E560", "the deck has no &material", hint, str(deck))
    return found.group(1)


def constant_of(material: str, name: str) -> float | None:
    """Return a constant of one number, or None."""
    found = number_pattern(re.escape(name)).search(material)
    return float(re.sub("[dD]", "e", found.group(2))) if found else None


def start_value(material: str, name: str, deck: Path) -> float:
    """Return a constant of the material, where the fit begins."""
    found = constant_of(material, name)
    if found is None:
        hint = "constants to be fitted need a number to begin with: in the deck, or NAME=START"
        raise FaultError("E560", f"&material has no number '{name}'", hint, str(deck))
    return found


def with_constants(material: str, constants: dict[str, float]) -> str:
    """Put constants into the text of a material; what is not there is added."""
    for name, value in constants.items():
        pattern = number_pattern(re.escape(name))
        if pattern.search(material):
            material = pattern.sub(lambda m, v=value: f"{m.group(1)}{v!r}", material)
        else:
            material = f"{material.rstrip().rstrip(',')}, {name} = {value!r}"
    return material


def without_constants(material: str, names: tuple[str, ...]) -> str:
    """Take constants of one number out of the text of a material."""
    for name in names:
        own = re.compile(number_pattern(re.escape(name)).pattern + r"[ \t]*,?[ \t]*", re.I)
        material = own.sub("", material)
    return material


def fitted_deck(deck: Path, constants: dict[str, float], drop: tuple[str, ...] = ()) -> str:
    """Return the text of a deck with constants in its first &material, comments kept.

    Constants in `drop` leave it; what it does not have is added at its end.
    """
    lines = read_deck(deck).splitlines(keepends=True)
    bare = "".join(line.split("!")[0].rstrip("\n") + "\n" for line in lines)
    found = MATERIAL.search(bare)
    first = bare[: found.start()].count("\n")
    last = bare[: found.end()].count("\n")
    left = dict(constants)
    for k in range(first, last + 1):
        text, mark, comment = lines[k].partition("!")
        if drop:
            text = re.sub(r"[ \t]+(?=\n)", "", without_constants(text, drop))
        for name in list(left):
            pattern = number_pattern(re.escape(name))
            if pattern.search(text):
                text = pattern.sub(lambda m, v=left[name]: f"{m[1]}{v:.6g}", text, count=1)
                del left[name]
        if k == last and left:
            head, slash, rest = text.rpartition("/")
            bare = head.rstrip().rstrip(",")
            more = ", ".join(f"{name} = {value:.6g}" for name, value in left.items())
            text = f"{bare + ', ' if bare else head}{more} {slash}{rest}"
        lines[k] = text + mark + comment
    return "".join(lines)
