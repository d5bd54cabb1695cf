"""Groups and keys of decks as deck.toml defines them: read, merged, checked.

The format is described at the top of common/deck.toml. Standard library only.
"""

import math
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = {"dem": "dem", "fem": "fem", "couple": "cpl"}  # folder: prefix of its modules
KINDS = ("real", "integer", "logical", "string", "file")
GROUP_WORDS = {"doc", "repeat", "required", "example", "keys", "of", "one_of", "some_of", "was"}
KEY_WORDS = {"type", "doc", "size", "unit", "default", "required", "choices", "words"}
KEY_WORDS |= {"of", "needs", "excludes", "was", "choices_of", "choices_were"}
BOUNDS = ("min", "max", "above", "below")
HEADER_WORDS = {"program", "name", "doc", "include", "example"}
NAME = re.compile(r"[a-z][a-z0-9_]{0,30}$")
HUGE = 2147483647


@dataclass
class Key:
    """One key of a group, as in deck.toml."""

    name: str
    kind: str
    doc: str
    least: int = 1
    most: int = 1
    unit: str = ""
    magnitude: tuple[float, float] | None = None
    default: list | None = None
    required: bool = False
    bounds: dict[str, float] = field(default_factory=dict)
    choices: list[str] = field(default_factory=list)
    words: dict[str, float] = field(default_factory=dict)
    of: dict[str, list[str]] = field(default_factory=dict)
    need_if: dict[str, list[str]] = field(default_factory=dict)
    needs: list[str] = field(default_factory=list)
    excludes: list[str] = field(default_factory=list)
    was: list[str] = field(default_factory=list)
    choices_of: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    choices_were: dict[str, str] = field(default_factory=dict)


@dataclass
class Group:
    """One group of a deck."""

    name: str
    doc: str
    repeat: bool
    required: bool
    example: str
    keys: list[Key]
    shared: bool
    of: dict[str, list[str]] = field(default_factory=dict)
    one_of: list[list[str]] = field(default_factory=list)
    some_of: list[list[str]] = field(default_factory=list)
    was: list[str] = field(default_factory=list)

    def find(self, name: str) -> Key | None:
        """Return a key of the group."""
        return next((key for key in self.keys if key.name == name), None)


@dataclass
class Program:
    """All groups of a program."""

    name: str
    folder: str
    doc: str
    example: str
    groups: list[Group]


class Faults:
    """Collect what is wrong with the definitions."""

    def __init__(self) -> None:
        """Start without faults."""
        self.lines: list[str] = []

    def add(self, place: str, text: str) -> None:
        """Add a fault."""
        self.lines.append(f"{place}: {text}")


def load(path: Path, faults: Faults) -> dict:
    """Return a TOML file as a dictionary, empty when it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        faults.add(str(path.relative_to(ROOT)), str(error))
        return {}


def clean(text: str) -> str:
    """Join the lines of a text."""
    return " ".join(str(text).split())


def is_number(value: object) -> bool:
    """Return whether a TOML value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def read_size(entry: dict, place: str, faults: Faults) -> tuple[int, int]:
    """Return the least and the largest number of values."""
    size = entry.get("size", 1)
    if size == "n":
        return 1, HUGE
    if isinstance(size, int) and not isinstance(size, bool) and size >= 1:
        return size, size
    if isinstance(size, list) and len(size) == 2:
        least, most = size[0], HUGE if size[1] == "n" else size[1]
        if isinstance(least, int) and isinstance(most, int) and 1 <= least <= most:
            return least, most
    faults.add(place, f'size = {size!r} is not 1, 3, "n" or [least, most]')
    return 1, 1


def read_magnitudes(faults: Faults) -> dict[str, tuple[float, float]]:
    """Return the least and the largest magnitude of each unit."""
    table = load(ROOT / "common/units.toml", faults).get("magnitudes", {})
    for unit, powers in table.items():
        if not (isinstance(powers, list) and len(powers) == 2 and powers[0] < powers[1]):
            faults.add(f"common/units.toml: {unit!r}", f"{powers!r} is not [least, most]")
    return {unit: (float(f"1e{low}"), float(f"1e{high}")) for unit, (low, high) in table.items()}


def limit_magnitude(key: Key, place: str, magnitudes: dict, faults: Faults) -> None:
    """Give a real key the magnitudes of its unit, but where it has a bound of its own."""
    if key.kind != "real":
        return
    if key.unit not in magnitudes:
        faults.add(place, f"unit = {key.unit!r} has no magnitudes in common/units.toml")
        return
    least, most = magnitudes[key.unit]
    if key.bounds.get("above") != 0.0:
        least = 0.0
    if {"max", "below"} & set(key.bounds):
        most = max(abs(bound) for bound in key.bounds.values())
    key.magnitude = (least, most)
    for item in [*(key.default or []), *key.bounds.values()]:
        if is_number(item) and not (abs(item) <= most and (abs(item) >= least or not item)):
            faults.add(place, f"{item} is beyond the magnitudes of '{key.unit}'")


def read_names(value: object, place: str, faults: Faults) -> list[str]:
    """Return one name or a list of names as a list."""
    names = value if isinstance(value, list) else [value]
    if all(isinstance(name, str) and name and "|" not in name for name in names):
        return list(names)
    faults.add(place, f"{value!r} is no name and no list of names")
    return []


def read_conditions(value: object, place: str, faults: Faults) -> dict[str, list[str]]:
    """Return `{ chooser = ["choice", ...], ... }` with a list for each choosing key."""
    if not isinstance(value, dict):
        faults.add(place, f'{value!r} is not {{ kind = ["choice", ...] }}')
        return {}
    return {chooser: read_names(values, place, faults) for chooser, values in value.items()}


def read_relations(key: Key, entry: dict, place: str, faults: Faults) -> None:
    """Read how a key depends on other keys, and its former names."""
    required = entry.get("required", False)
    if isinstance(required, dict):
        key.need_if = read_conditions(required, place, faults)
    else:
        key.required = bool(required)
    key.of = read_conditions(entry.get("of", {}), place, faults)
    for word in ("needs", "excludes", "was"):
        setattr(key, word, read_names(entry.get(word, []), place, faults))
    for choice, wanted in entry.get("choices_of", {}).items():
        key.choices_of[choice] = read_conditions(wanted, place, faults)
    for old, new in entry.get("choices_were", {}).items():
        key.choices_were[old] = "".join(read_names(new, place, faults))


def fits(value: object, key: Key) -> bool:
    """Return whether one default value has the type of its key, its bounds and its choices."""
    if key.kind in ("string", "file"):
        return isinstance(value, str) and (not key.choices or value in key.choices)
    if key.kind == "logical":
        return isinstance(value, bool)
    if isinstance(value, str):
        return value in key.words
    if not is_number(value) or (key.kind == "integer" and not isinstance(value, int)):
        return False
    number = float(value)  # type: ignore[arg-type]
    low = number >= key.bounds.get("min", -math.inf) and number > key.bounds.get("above", -math.inf)
    return (
        low
        and number <= key.bounds.get("max", math.inf)
        and number < key.bounds.get("below", math.inf)
    )


def read_default(entry: dict, key: Key, place: str, faults: Faults) -> list | None:
    """Return the default as a list of values, None without one."""
    if "default" not in entry:
        return None
    value = entry["default"]
    values = value if isinstance(value, list) else [value]
    if not values:
        return None
    if key.required or key.need_if:
        faults.add(place, "a required key has no default")
    if not key.least <= len(values) <= key.most:
        faults.add(place, f"default has {len(values)} values, size differs")
    for item in values:
        if not fits(item, key) or (isinstance(item, str) and re.search(r"[|\n]", item)):
            faults.add(place, f"default {item!r} does not fit type, bounds or choices")
    return values


def read_key(name: str, entry: dict, place: str, faults: Faults) -> Key | None:
    """Return one key after checking its definition."""
    if not isinstance(entry, dict):
        faults.add(place, "a key is a table: name = { type = ..., doc = ... }")
        return None
    for word in sorted(set(entry) - KEY_WORDS - set(BOUNDS)):
        faults.add(
            place,
            f"unknown word '{word}' (known: {', '.join(sorted(KEY_WORDS))}, {', '.join(BOUNDS)})",
        )
    if not NAME.match(name):
        faults.add(place, "a name is lower case, starts with a letter, has at most 31 letters")
    if entry.get("type") not in KINDS:
        faults.add(place, f"type = {entry.get('type')!r} is not one of {', '.join(KINDS)}")
        return None
    if not clean(entry.get("doc", "")):
        faults.add(place, "doc is missing")
    least, most = read_size(entry, place, faults)
    key = Key(
        name, entry["type"], clean(entry.get("doc", "")), least, most, clean(entry.get("unit", ""))
    )
    read_relations(key, entry, place, faults)
    key.bounds = {word: entry[word] for word in BOUNDS if word in entry}
    key.choices = list(entry.get("choices", []))
    key.words = dict(entry.get("words", {}))
    check_limits(key, place, faults)
    key.default = read_default(entry, key, place, faults)
    return key


def check_limits(key: Key, place: str, faults: Faults) -> None:
    """Check bounds, choices and words of a key against its type."""
    if key.bounds and key.kind not in ("real", "integer"):
        faults.add(place, "bounds are for numbers")
    if {"min", "above"} <= set(key.bounds) or {"max", "below"} <= set(key.bounds):
        faults.add(place, "give one of min and above, one of max and below")
    if not all(is_number(value) for value in key.bounds.values()):
        faults.add(place, "a bound is a number")
    if key.choices and (
        key.kind != "string" or not all(isinstance(c, str) and "|" not in c for c in key.choices)
    ):
        faults.add(place, "choices are strings, for a string")
    if key.words and (
        key.kind != "real" or not all(is_number(value) for value in key.words.values())
    ):
        faults.add(place, "words = { word = number } are for a real key")


def merge(base: dict, change: dict) -> dict:
    """Return an included group with the changes and further keys of a program."""
    merged = {**base, **{word: value for word, value in change.items() if word != "keys"}}
    keys = {name: dict(entry) for name, entry in base.get("keys", {}).items()}
    for name, entry in change.get("keys", {}).items():
        keys[name] = change_key(keys.get(name, {}), entry) if isinstance(entry, dict) else entry
    merged["keys"] = keys
    return merged


def change_key(base: dict, change: dict) -> dict:
    """Return an included key as a program changes it; a new bound replaces the one on its side."""
    kept = dict(base)
    for side in (("min", "above"), ("max", "below")):
        if set(side) & set(change):
            for word in side:
                kept.pop(word, None)
    return {**kept, **change}


def read_group(name: str, entry: dict, shared: bool, place: str, faults: Faults) -> Group:
    """Return one group after checking its definition."""
    for word in sorted(set(entry) - GROUP_WORDS):
        faults.add(
            place,
            f"unknown word '{word}' (known: {', '.join(sorted(GROUP_WORDS))}; "
            f"keys belong in [{name}.keys])",
        )
    if not NAME.match(name):
        faults.add(place, "a name is lower case, starts with a letter, has at most 31 letters")
    if not clean(entry.get("doc", "")):
        faults.add(place, "doc is missing")
    keys = []
    table = entry.get("keys", {})
    for key_name, key_entry in table.items() if isinstance(table, dict) else []:
        key = read_key(key_name, key_entry, f"{place}.{key_name}", faults)
        if key:
            keys.append(key)
    if not keys:
        faults.add(place, f"no keys: they belong in [{name}.keys]")
    example = str(entry.get("example", "")).strip()
    group = Group(name, clean(entry.get("doc", "")), bool(entry.get("repeat", False)),
                  bool(entry.get("required", False)), example, keys, shared)  # fmt: skip
    group.of = read_conditions(entry.get("of", {}), place, faults)
    group.was = read_names(entry.get("was", []), place, faults)
    for word in ("one_of", "some_of"):
        sets = entry.get(word, [])
        if not isinstance(sets, list) or not all(isinstance(item, list) for item in sets):
            faults.add(place, f'{word} = {sets!r} is not [["key", "key"], ...]')
            continue
        setattr(group, word, [read_names(item, place, faults) for item in sets])
    return group


def read_program(folder: str, common: dict, faults: Faults) -> Program | None:
    """Return the groups of a program: those it includes, then its own."""
    path = ROOT / folder / "deck.toml"
    if not path.exists():
        return None
    data = load(path, faults)
    if not data:
        return None
    place = f"{folder}/deck.toml"
    title = data.get("name", data.get("program"))  # name: where a group is called program
    if not isinstance(title, str):
        faults.add(place, 'program = "talus-..." is missing at the top')
    groups = []
    include = data.get("include", [])
    for name in include:
        if name not in common:
            faults.add(
                place,
                f"include: common/deck.toml has no group '{name}' (it has {', '.join(common)})",
            )
            continue
        change = data.get(name, {})
        groups.append(
            read_group(name, merge(common[name], change), not change, f"{place}: {name}", faults)
        )
    for name, entry in data.items():
        if name in include or (name in HEADER_WORDS and not isinstance(entry, dict)):
            continue
        if isinstance(entry, dict):
            if name in common:
                faults.add(
                    place,
                    f"group '{name}' is in common/deck.toml too: include it, then change it",
                )
            groups.append(read_group(name, entry, False, f"{place}: {name}", faults))
        else:
            faults.add(
                place,
                f"unknown word '{name}' at the top (known: {', '.join(sorted(HEADER_WORDS))})",
            )
    program = Program(str(title), folder, str(data.get("doc", "")).strip(),
                      str(data.get("example", "")).strip(), groups)  # fmt: skip
    check_relations(program, place, faults)
    magnitudes = read_magnitudes(faults)
    for group in groups:
        for key in group.keys:
            limit_magnitude(key, f"{place}: {group.name}.{key.name}", magnitudes, faults)
    return program


def check_relations(program: Program, place: str, faults: Faults) -> None:
    """Check that rules name keys and choices that there are, and former names none that is used."""
    used = {group.name for group in program.groups}
    for group in program.groups:
        at = f"{place}: {group.name}"
        check_conditions(program, group, "", group.of, at, faults)
        check_names(group.was, used, at, faults)
        for names in [*group.one_of, *group.some_of]:
            check_set(group, names, at, faults)
        known = {key.name for key in group.keys}
        for key in group.keys:
            here = f"{at}.{key.name}"
            check_names(key.was, known, here, faults)
            check_key_rules(program, group, key, here, faults)


def check_names(was: list[str], used: set[str], place: str, faults: Faults) -> None:
    """Check former names: in lower case, none that is in use or occurs twice."""
    for name in was:
        if not NAME.match(name):
            faults.add(place, f"was = {name!r} is no name")
        if name in used:
            faults.add(place, f"was = '{name}' is in use: a name means one thing")
        used.add(name)


def check_set(group: Group, names: list[str], place: str, faults: Faults) -> None:
    """Check one of the lists of one_of and some_of."""
    if len(set(names)) < 2 or len(set(names)) != len(names):
        faults.add(place, f"one_of and some_of take two or more keys, not {names}")
    for name in names:
        key = group.find(name)
        if not key:
            faults.add(place, f"one_of and some_of: there is no key '{name}'")
        elif key.required:
            faults.add(place, f"one_of and some_of: '{name}' is required in any case")


def check_key_rules(program: Program, group: Group, key: Key, place: str, faults: Faults) -> None:
    """Check the rules of one key."""
    check_conditions(program, group, key.name, key.of, place, faults)
    check_conditions(program, group, key.name, key.need_if, place, faults)
    for chooser, values in key.need_if.items():
        outside = sorted(set(values) - set(key.of.get(chooser, values)))
        if outside:
            faults.add(place, f"required with {outside[0]!r}, to which it does not belong (of)")
    for name in [*key.needs, *key.excludes]:
        other = group.find(name)
        if not other or other is key:
            faults.add(place, f"needs, excludes: there is no other key '{name}' in &{group.name}")
        elif name in key.excludes and key.name in other.excludes:
            faults.add(place, f"'{name}' excludes this key already: say it once")
    for choice, wanted in key.choices_of.items():
        if choice not in key.choices:
            faults.add(place, f"choices_of: '{choice}' is none of the choices")
        check_conditions(program, group, key.name, wanted, place, faults)
    for old, new in key.choices_were.items():
        if new not in key.choices or old in key.choices:
            faults.add(place, f"choices_were: '{old}' is one of the choices, or '{new}' is none")


def check_conditions(
    program: Program, group: Group, name: str, conditions: dict[str, list[str]],
    place: str, faults: Faults,
) -> None:  # fmt: skip
    """Check that a condition names a choosing key and some of its choices."""
    for chooser, values in conditions.items():
        head, _, tail = chooser.rpartition(".")
        holder = next((g for g in program.groups if g.name == head), None) if head else group
        key = holder.find(tail) if holder else None
        if not key or (not head and (tail == name or not name)):
            faults.add(place, f"there is no choosing key '{chooser}'")
        elif not key.choices or key.most > 1:
            faults.add(place, f"'{chooser}' is no choosing key: a string with choices, one value")
        elif head and holder and holder.repeat:
            faults.add(place, f"'{chooser}' cannot choose here: &{head} may occur several times")
        else:
            for value in values or ["nothing"]:
                if value not in key.choices:
                    faults.add(place, f"'{value}' is none of the choices of '{chooser}'")
            if set(values) == set(key.choices):
                faults.add(place, f"all choices of '{chooser}' are named: that is no condition")
