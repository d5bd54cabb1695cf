"""The definitions of decks and errors: groups, keys and codes, read from their TOML tables."""

import difflib
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PROGRAMS = ("dem", "fem", "couple")
FOLDERS = ("common", *PROGRAMS, "prepost")
INSTALLED = Path(__file__).resolve().parent / "tables"  # of an installed suite
TABLES = INSTALLED if INSTALLED.is_dir() else ROOT
HEAD = ("program", "name", "doc", "include", "example")


@dataclass(frozen=True)
class Group:
    """A group of a deck: its program, name and table with the table of each key under `keys`."""

    program: str
    name: str
    table: dict


def read_table(path: Path) -> dict:
    """Return the tables of a TOML file; an empty one where it is not installed."""
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def merged(first: dict, second: dict) -> dict:
    """Return the shared group `first` with what a program changes or adds in `second`."""
    result = {**first, **second}
    result["keys"] = {name: dict(key) for name, key in first.get("keys", {}).items()}
    for name, key in second.get("keys", {}).items():
        result["keys"][name] = {**result["keys"].get(name, {}), **key}
    return result


@cache
def groups() -> tuple[Group, ...]:
    """Return all groups of the decks of all programs."""
    shared = read_table(TABLES / "common" / "deck.toml")
    found = []
    for folder in PROGRAMS:
        deck = read_table(TABLES / folder / "deck.toml")
        own = {n: t for n, t in deck.items() if n not in HEAD or isinstance(t, dict)}
        for name in dict.fromkeys([*deck.get("include", []), *own]):
            table = merged(shared.get(name, {}), own.get(name, {}))
            found.append(Group(f"talus-{folder}", name, table))
    return tuple(found)


@cache
def codes() -> dict[str, dict]:
    """Return title and explanation of every error code."""
    tables = [read_table(TABLES / folder / "errors.toml") for folder in FOLDERS]
    return {code: entry for table in tables for code, entry in table.items()}


def names() -> list[str]:
    """Return all that can be explained: groups, keys, group.key and codes."""
    every = [g.name for g in groups()]
    every += [key for g in groups() for key in g.table["keys"]]
    every += [f"{g.name}.{key}" for g in groups() for key in g.table["keys"]]
    return sorted({*every, *codes()})


def nearest(word: str) -> list[str]:
    """Return up to four names that are spelt like `word`."""
    return difflib.get_close_matches(word, names(), n=4, cutoff=0.6)
