"""JSON Schema of the decks of a program, from the deck.toml tables.

A deck as JSON is what f90nml makes of one: a group is an object, a group that stands several
times a list of them; one value stands alone, several are a list.
"""

from talus import reference
from talus.faults import FaultError

DRAFT = "https://json-schema.org/draft/2020-12/schema"
TYPES = {"real": "number", "integer": "integer", "logical": "boolean"}
BOUNDS = {"min": "minimum", "max": "maximum", "above": "exclusiveMinimum",
          "below": "exclusiveMaximum"}  # fmt: skip
PROGRAMS = tuple(f"talus-{name}" for name in reference.PROGRAMS)


def hover(key: dict) -> str:
    """Return text, type, unit, default, range and choices of a key in a few lines."""
    size = key.get("size", 1)
    size = " to ".join(map(str, size)) if isinstance(size, list) else size
    shape = "" if size == 1 else f"({size})"
    facts = [key["type"] + shape + (f" [{key['unit']}]" if key.get("unit") else "")]
    if key.get("required") is True:
        facts.append("required")
    elif key.get("default", "") != "":
        facts.append(f"default {plain(key['default'])}")
    signs = {"min": "≥", "max": "≤", "above": ">", "below": "<"}
    facts += [f"{sign} {key[name]}" for name, sign in signs.items() if name in key]
    facts += [f"one of {plain(key['choices'])}"] if "choices" in key else []
    return f"{' '.join(key['doc'].split())}\n{', '.join(facts)}"


def plain(value: object) -> str:
    """Return a value or a list of values as text."""
    return ", ".join(map(plain, value)) if isinstance(value, list) else str(value)


def one_value(key: dict) -> dict:
    """Return the schema of a single value of a key."""
    found = {"type": TYPES.get(key["type"], "string")}
    found |= {word: key[name] for name, word in BOUNDS.items() if name in key}
    if "choices" in key:
        found["enum"] = key["choices"]
    return {"anyOf": [found, {"enum": list(key["words"])}]} if "words" in key else found


def of_key(key: dict) -> dict:
    """Return the schema of a key: one value, or a list of the right length."""
    one, size = one_value(key), key.get("size", 1)
    about = {"description": hover(key)}
    if "default" in key:
        about["default"] = key["default"]
    if size == 1:
        return about | one
    least, most = size if isinstance(size, list) else (size, size)
    many = {"type": "array", "items": one}
    many |= {} if size == "n" else {"minItems": least, "maxItems": most}
    return about | ({"anyOf": [one, many]} if size == "n" or least == 1 else many)


def belongs(name: str, key: dict, keys: dict) -> list[dict]:
    """Return the rules of `of` of a key that name choosing keys of its own group."""
    rules = []
    for other, choices in key["of"].items() if isinstance(key.get("of"), dict) else ():
        if other not in keys:
            continue
        then = {"properties": {other: {"enum": choices}}}
        if keys[other].get("default") not in choices:
            then["required"] = [other]
        rules.append({"if": {"required": [name]}, "then": then})
    return rules


def rules_of(table: dict) -> list[dict]:
    """Return what a group asks of its keys together: needs, excludes, one_of, some_of and of."""
    keys, rules = table["keys"], []
    for name, key in keys.items():
        rules += [{"not": {"required": [name, other]}} for other in key.get("excludes", [])]
        rules += belongs(name, key, keys)
    for word, rule in (("one_of", "oneOf"), ("some_of", "anyOf")):
        for names in table.get(word, []):
            if not any("of" in keys[name] for name in names):
                rules.append({rule: [{"required": [name]} for name in names]})
    return rules


def of_group(table: dict) -> dict:
    """Return the schema of one group."""
    keys = table["keys"]
    found = {
        "type": "object",
        "description": " ".join(table.get("doc", "").split()),
        "properties": {name: of_key(key) for name, key in keys.items()},
        "additionalProperties": False,
    }
    required = [n for n, k in keys.items() if k.get("required") is True and "of" not in k]
    found |= {"required": required} if required else {}
    needs = {name: key["needs"] for name, key in keys.items() if "needs" in key}
    found |= {"dependentRequired": needs} if needs else {}
    rules = rules_of(table)
    return found | ({"allOf": rules} if rules else {})


def check_tables() -> None:
    """Refuse (E635) to work without the tables of the sources."""
    if not reference.groups():
        hint = "make install has put the files into share/talus/editors"
        raise FaultError("E635", "the deck.toml tables of the sources are not here", hint)


def of_program(program: str) -> dict:
    """Return the schema of the decks of a program; E635 without the tables of the sources."""
    check_tables()
    groups = [g for g in reference.groups() if g.program == program]
    properties, defs, required = {}, {}, []
    for group in groups:
        defs[group.name] = of_group(group.table)
        one = {"$ref": f"#/$defs/{group.name}"}
        many = {"type": "array", "items": one, "minItems": 1}
        properties[group.name] = {"anyOf": [one, many]} if group.table.get("repeat") else one
        required += [group.name] if group.table.get("required") else []
    return {
        "$schema": DRAFT, "title": f"deck of {program}", "type": "object",
        "properties": properties, "required": required, "additionalProperties": False,
        "$defs": defs,
    }  # fmt: skip
