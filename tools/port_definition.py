"""What port.toml defines: fields, members, scalars; what is wrong with it."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "common/port/port.toml"
NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z]+)?$")
NUMBERS = ("kind", "status", "verb", "flag", "cell")  # tables whose entries have a number
SIDES = ("both", "grains", "solid")
FIELD_WORDS = {"name", "kind", "size", "of", "shape", "unit", "optional", "when", "side", "doc"}
MADE = "made by tools/port.py from common/port/port.toml: change that file, then `make port`"
Port = dict[str, list[dict]]


def fields_of(port: Port) -> Iterator[tuple[str, dict]]:
    """Yield (message, field) of every field outside sets: 'HELLO request', 'DESCRIBE mesh'."""
    for verb in port["verb"]:
        for direction in ("request", "reply"):
            for field in verb[direction]:
                yield f"{verb['name']} {direction}", field
    for what in port["what"]:
        for field in what["fields"]:
            yield f"{what['verb']} {what['name']}", field


def members_of(port: Port) -> Iterator[tuple[str, dict]]:
    """Yield (message, field) of every field of sets: 'grains prescribe request'."""
    for member in port["member"]:
        for direction in ("request", "reply"):
            for field in member[direction]:
                yield f"{member['side']} {member['role']} {direction}", field


def faults_of(port: Port) -> list[str]:
    """Return what is wrong with the definitions."""
    faults = []
    for table in NUMBERS:
        seen = [entry["number"] for entry in port[table]]
        if len(set(seen)) != len(seen):
            faults.append(f"{table}: a number occurs twice")
    for table in ("kind", "status", "role", "capability", "scope", "scalar", "flag", "cell"):
        seen = [entry["name"] for entry in port[table]]
        faults += [f"{table} {n}: no name" for n in seen if not NAME.match(n)]
        faults += [f"{table} {n}: occurs twice" for n in set(seen) if seen.count(n) > 1]
    if [verb["number"] for verb in port["verb"]] != list(range(1, len(port["verb"]) + 1)):
        faults.append("verb: numbers must run from 1 without gaps")
    kinds = {kind["name"] for kind in port["kind"]}
    names: dict[str, set[str]] = {}
    for message, field in [*fields_of(port), *members_of(port)]:
        place = f"{message}, {field['name']}"
        names.setdefault(message, set())
        if field["name"] in names[message]:
            faults.append(f"{place}: occurs twice")
        names[message].add(field["name"])
        faults += [f"{place}: unknown word {w}" for w in sorted(set(field) - FIELD_WORDS)]
        if not NAME.match(field["name"]) or len(field["name"]) > port["protocol"]["name_length"]:
            faults.append(f"{place}: no name")
        if field.get("kind", "real") not in kinds:
            faults.append(f"{place}: kind {field['kind']} is unknown")
        if field.get("of", "set") not in port["counts"]:
            faults.append(f"{place}: of = {field['of']} is not among counts")
        if field.get("side", "both") not in SIDES:
            faults.append(f"{place}: side {field['side']} is unknown")
        if not field.get("doc"):
            faults.append(f"{place}: doc is missing")
    words = {entry["name"] for entry in port["role"]}
    faults += [f"member: role {m['role']} is unknown" for m in port["member"]
               if m["role"] not in words]  # fmt: skip
    return faults


def constant(name: str) -> str:
    """Return the name of a constant for a field: 'error.code' gives error_code."""
    return name.replace(".", "_")


def field_names(port: Port) -> list[str]:
    """Return the names of all fields, sorted."""
    found = {field["name"] for _, field in [*fields_of(port), *members_of(port)]}
    return sorted(found | {entry["name"] for entry in port["fault"]})


def member_names(port: Port) -> list[str]:
    """Return the names of all fields of sets, sorted."""
    return sorted({field["name"] for _, field in members_of(port)})


def meaning(port: Port, name: str, source: Callable) -> str:
    """Return the places of a field, for the comment beside its constant."""
    places: list[str] = []
    for message, field in source(port):
        if field["name"] == name:
            words = message.split()
            place = " ".join(words[:2] if words[0] in SIDES else words[:1])
            if words[0] in ("DESCRIBE", "SET") and words[1] not in ("request", "reply"):
                place = " ".join(words)
            if place not in places:
                places.append(place)
    if len(places) > 3:
        return f"{places[0]} and {len(places) - 1} more"
    return ", ".join(places)


def scalar_places(port: Port) -> list[tuple[dict, int]]:
    """Return every scalar with its place, counted from 1."""
    found, place = [], 1
    for scalar in port["scalar"]:
        found.append((scalar, place))
        place += scalar.get("size", 1)
    return found


def scalar_count(port: Port) -> int:
    """Return the number of values of the field scalars."""
    return sum(scalar.get("size", 1) for scalar in port["scalar"])
