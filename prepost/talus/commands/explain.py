"""`talus explain`: a group or key of a deck, or an error code, in words."""

import argparse
import re
import textwrap
from functools import cache

from talus import reference
from talus.faults import FaultError
from talus.reference import ROOT, Group

LIMITS = {"min": ">=", "max": "<=", "above": ">", "below": "<"}
MOST_CASES = 6
MOST_PAGES = 4


def register(commands: argparse._SubParsersAction) -> None:
    """Add `explain`."""
    new = commands.add_parser("explain", help="explain a deck key, a group or an error code")
    new.add_argument("name", help="KEY, GROUP, GROUP.KEY or error code")
    new.set_defaults(run=explain)


def paragraph(text: str) -> list[str]:
    """Return `text` as indented lines."""
    return textwrap.wrap(" ".join(text.split()), 92, initial_indent="  ", subsequent_indent="  ")


def joined(value: object) -> str:
    """Return a value or a list of values as text."""
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def choice_text(rules: dict) -> str:
    """Return `kind = newmark or hht` for the choices that a key belongs to."""
    parts = []
    for key, values in rules.items():
        values = values if isinstance(values, list) else [values]
        parts.append(f"{key} = {' or '.join(map(str, values))}")
    return " and ".join(parts)


def key_facts(key: dict) -> list[str]:
    """Return type, unit, default, range and choices of a key, one a line."""
    facts = [("type", key["type"] + (f"({key['size']})" if "size" in key else ""))]
    facts += [("unit", key["unit"])] if key.get("unit") else []
    if key.get("required"):
        facts.append(("default", "none, must be given"))
    elif "default" in key:
        facts.append(("default", joined(key["default"]) or "''"))
    limits = [f"{sign} {key[name]}" for name, sign in LIMITS.items() if name in key]
    facts += [("range", " and ".join(limits))] if limits else []
    facts += [("choices", joined(key["choices"]))] if "choices" in key else []
    facts += [("words", joined(list(key["words"])))] if "words" in key else []
    facts += [("only with", choice_text(key["of"]))] if isinstance(key.get("of"), dict) else []
    facts += [(n, joined(key[n])) for n in ("needs", "excludes") if n in key]
    return [f"  {name:10s} {text}" for name, text in facts]


@cache
def decks() -> tuple[tuple[str, str, str], ...]:
    """Return program, folder and text of each deck of the verification cases and examples."""
    found = []
    for path in (p for f in ("verification", "examples") for p in (ROOT / f).rglob("*.nml")):
        text = path.read_text("utf-8")
        program = "talus-dem"
        if re.search(r"^\s*&program\b", text, re.MULTILINE):
            program = "talus-couple"
        elif re.search(r"^\s*&section\b", text, re.MULTILINE):
            program = "talus-fem"
        found.append((program, str(path.parent.relative_to(ROOT)), text))
    return tuple(found)


def users(program: str, group: str, key: str) -> list[str]:
    """Return the verification cases and examples whose decks give the key in the group."""
    given = re.compile(rf"&{group}\b(?:'[^'\n]*'|[^/'])*\b{key}\s*=", re.IGNORECASE)
    return sorted({folder for p, folder, text in decks() if p == program and given.search(text)})


@cache
def manual() -> dict[str, str]:
    """Return the text of every page of the manual."""
    return {p.name: p.read_text("utf-8") for p in sorted((ROOT / "manual").glob("*.md"))}


def pages(group: str, key: str) -> list[str]:
    """Return the manual's pages that name the group and, alone or in a deck's line, the key."""
    named = re.compile(rf"`{key}`|`{key} =|&{group}\b[^`/]*\b{key}\s*=|`&{group} {key}`")
    owner = re.compile(rf"&{group}\b")
    return [f"manual/{name}" for name, text in manual().items()
            if owner.search(text) and named.search(text)]  # fmt: skip


def listed(names: list[str], most: int) -> str:
    """Return the first of the names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def of_key(group: Group, name: str) -> list[str]:
    """Return the explanation of one key."""
    key = group.table["keys"][name]
    lines = [f"{group.program}: {name} of &{group.name}", *paragraph(key["doc"]), *key_facts(key)]
    cases = users(group.program, group.name, name)
    lines += [f"  {'used by':10s} {listed(cases, MOST_CASES)}"] if cases else []
    where = pages(group.name, name)
    return lines + ([f"  {'manual':10s} {listed(where, MOST_PAGES)}"] if where else [])


def of_group(group: Group) -> list[str]:
    """Return the explanation of a group and the names of its keys."""
    lines = [f"{group.program}: &{group.name}", *paragraph(group.table.get("doc", ""))]
    lines += paragraph("keys: " + ", ".join(group.table["keys"]))
    example = group.table.get("example", "")
    return lines + [f"  {line}" for line in example.strip().splitlines()]


def of_code(code: str) -> list[str]:
    """Return title and explanation of an error code, and a deck that shows it."""
    entry = reference.codes()[code]
    lines = [f"{code}: {entry['title']}", *paragraph(entry["explain"])]
    shown = [
        p.parent
        for p in sorted((ROOT / "tests" / "errors").glob("*/expect.toml"))
        if code in p.read_text("utf-8")
    ]
    return lines + ([f"  {'example':10s} {shown[0].relative_to(ROOT)}"] if shown else [])


def found(name: str) -> list[list[str]]:
    """Return the explanations of all that bears the name."""
    if name.upper() in reference.codes():
        return [of_code(name.upper())]
    word = name.lower().lstrip("&")
    group_name, dot, key_name = word.partition(".")
    every = reference.groups()
    if dot:
        return [
            of_key(g, key_name)
            for g in every
            if g.name == group_name and key_name in g.table["keys"]
        ]
    texts = [of_group(g) for g in every if g.name == word]
    return texts + [of_key(g, word) for g in every if word in g.table["keys"]]


def explain(options: argparse.Namespace) -> int:
    """Print what is known of the name."""
    texts = found(options.name)
    if not texts:
        near = reference.nearest(options.name)
        hint = f"did you mean {', '.join(near)}?" if near else "a key, a group or a code as E501"
        raise FaultError("E600", f"nothing is called '{options.name}'", hint)
    print("\n\n".join("\n".join(text) for text in texts))
    return 0
