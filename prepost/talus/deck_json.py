"""A deck of the programs as JSON, in the form that the schema describes (talus.schema)."""

import re

from talus.study.deck_text import read_blocks, words_of


def value_of(word: str) -> object:
    """Return a value of a deck: text, logical, whole number or real."""
    if word[:1] in "'\"" and word:
        return word[1:-1].replace(word[0] * 2, word[0])
    if re.fullmatch(r"\.?(t|f|true|false)\.?", word, flags=re.I):
        return word.lstrip(".").lower().startswith("t")
    if re.fullmatch(r"[+-]?\d+", word):
        return int(word)
    try:
        return float(re.sub("[dD]", "e", word))
    except ValueError:
        return word


def deck_as_json(text: str) -> dict:
    """Return a deck in the form of the schema."""
    found: dict[str, list] = {}
    for block in read_blocks(text):
        group = {}
        for entry in block.entries:
            values = [value for word in words_of(text, entry) for value in repeated(word)]
            group[entry.name] = values[0] if len(values) == 1 else values
        found.setdefault(block.name, []).append(group)
    return {name: many[0] if len(many) == 1 else many for name, many in found.items()}


def repeated(word: str) -> list:
    """Return the values of a word of a deck, `3*0.0` three times."""
    times = re.match(r"(\d+)\*(?=\S)", word)
    value = value_of(word[times.end() :] if times else word)
    return [value] * (int(times[1]) if times else 1)
