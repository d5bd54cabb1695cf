"""Keys that the solvers know, asked of the solvers themselves (--keys --json), and their ranges."""

import functools
import json
import subprocess

from talus.faults import FaultError
from talus.programs import find_program
from talus.study.faults import nearest
from talus.study.parameters import Parameter, Target

BOUNDS = {
    "min": ("at least", lambda v, b: v >= b),
    "max": ("at most", lambda v, b: v <= b),
    "above": ("above", lambda v, b: v > b),
    "below": ("below", lambda v, b: v < b),
}


@functools.cache
def keys_of(program: str) -> dict[str, dict[str, dict]]:
    """Return the groups of a program, each with its keys by name."""
    done = subprocess.run([str(find_program(program)), "--keys", "--json"],
                          capture_output=True, text=True)  # fmt: skip
    try:
        groups = json.loads(done.stdout)["groups"]
    except (ValueError, KeyError) as fault:
        text = f"{program} --keys gave no readable answer"
        raise FaultError("E533", text, done.stderr[-300:], exit_code=4) from fault
    return {group["name"]: {key["name"]: key for key in group["keys"]} for group in groups}


def find_key(program: str, target: Target, place: str) -> dict:
    """Return what the program knows of a key, or raise E581 with the nearest name."""
    groups = keys_of(program)
    if target.group not in groups:
        hint = nearest(target.group, groups)
        raise FaultError("E581", f"{program} has no group '{target.group}'", hint, place)
    keys = groups[target.group]
    if target.key not in keys:
        hint = nearest(target.key, keys)
        raise FaultError("E581", f"&{target.group} has no key '{target.key}'", hint, place)
    return keys[target.key]


def check_value(key: dict, value: object, place: str) -> None:
    """Refuse (E582) a value that the key cannot have."""
    name, kind = key["name"], key["type"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    right = {
        "real": number or value in key.get("words", {}),
        "logical": isinstance(value, bool),
        "integer": number and value == int(value),
    }.get(kind, isinstance(value, str))
    if not right:
        raise FaultError("E582", f"{name} = {value!r} is no {kind}", "", place)
    if key.get("choices") and value not in key["choices"]:
        hint = nearest(str(value), key["choices"])
        raise FaultError("E582", f"{name} cannot be {value!r}", hint, place)
    if not number:
        return
    unit = f" {key['unit']}" if key.get("unit") else ""
    for word, (text, holds) in BOUNDS.items():
        if word in key and not holds(value, float(key[word])):
            say = f"{name} = {value:g}{unit} is out of its range"
            raise FaultError("E582", say, f"it must be {text} {float(key[word]):g}{unit}", place)


def check_parameter(parameter: Parameter, key: dict, values: list, place: str) -> None:
    """Check every value that a parameter takes in the plan."""
    for value in dict.fromkeys(values):
        check_value(key, value, f"{place} ({parameter.name})")
