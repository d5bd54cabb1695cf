"""Deck reference of the manual from the definitions of a program (deck_definitions)."""

from deck_definitions import HUGE, Group, Key, Program


def range_text(key: Key) -> str:
    """Return bounds, choices and words of a key."""
    signs = {"min": "≥", "max": "≤", "above": ">", "below": "<"}
    parts = [f"{signs[word]} {value:g}" for word, value in key.bounds.items()]
    if key.choices:
        parts.append(", ".join(f"`'{choice}'`" for choice in key.choices))
    if key.words:
        parts.append("or " + ", ".join(f"`'{word}'`" for word in key.words))
    return ", ".join(parts)


def size_text(key: Key) -> str:
    """Return the type of a key with its size."""
    if key.most == HUGE:
        return (
            f"{key.kind}, list" if key.least == 1 else f"{key.kind}, list of at least {key.least}"
        )
    if key.most > key.least:
        return f"{key.kind}, {key.least} to {key.most}"
    return key.kind if key.most == 1 else f"{key.kind}, {key.most}"


def deck_text(value: object) -> str:
    """Return a value as written in a deck."""
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, bool):
        return ".true." if value else ".false."
    return repr(value)


def conditions_text(conditions: dict[str, list[str]]) -> str:
    """Return conditions for the manual."""
    parts = []
    for chooser, values in conditions.items():
        group, _, key = chooser.rpartition(".")
        quotes = ", ".join(f"`'{value}'`" for value in values)
        parts.append(f"`{key}` = {quotes}" + (f" of `&{group}`" if group else ""))
    return " and ".join(parts)


def names_text(names: list[str]) -> str:
    """Return names of keys for the manual."""
    return ", ".join(f"`{name}`" for name in names)


def rule_text(key: Key) -> str:
    """Return how a key depends on others, for the manual."""
    parts = []
    if key.of:
        parts.append(f"Only with {conditions_text(key.of)}.")
    if key.need_if:
        parts.append(f"Required with {conditions_text(key.need_if)}.")
    if key.needs:
        parts.append(f"Needs {names_text(key.needs)}.")
    if key.excludes:
        parts.append(f"Not beside {names_text(key.excludes)}.")
    for choice, wanted in key.choices_of.items():
        parts.append(f"`'{choice}'` only with {conditions_text(wanted)}.")
    if key.was:
        parts.append(f"Once called {names_text(key.was)}.")
    return " ".join(parts)


def group_rule_text(group: Group) -> str:
    """Return which keys of a group go together, for the manual."""
    parts = []
    if group.of:
        parts.append(f"Only with {conditions_text(group.of)}.")
    parts += [f"Exactly one of {names_text(names)}." for names in group.one_of]
    parts += [f"At least one of {names_text(names)}." for names in group.some_of]
    if group.was:
        parts.append("Once called " + ", ".join(f"`&{name}`" for name in group.was) + ".")
    return " ".join(parts)


def default_text(key: Key) -> str:
    """Return the default of a key as written in a deck."""
    if key.required:
        return "**required**"
    if key.default is None:
        return ""
    return f"`{', '.join(deck_text(value) for value in key.default)}`"


def cell(text: str) -> str:
    """Return a text that is safe in a cell of a Markdown table."""
    return text.replace("|", "\\|")


def group_page(group: Group) -> list[str]:
    """Return the section of one group: what it does, keys, example."""
    said = ["required" if group.required else "optional"]
    said.append("may occur several times" if group.repeat else "at most once")
    said = [f"*{', '.join(said).capitalize()}.*", *filter(None, [group_rule_text(group)])]
    lines = [f"## &{group.name}", "", group.doc, "", " ".join(said), ""]
    lines += ["| key | type | unit | default | range | meaning |", "|---|---|---|---|---|---|"]
    for key in group.keys:
        cells = [
            f"`{key.name}`",
            size_text(key),
            key.unit,
            default_text(key),
            range_text(key),
            f"{key.doc} *{rule_text(key)}*" if rule_text(key) else key.doc,
        ]
        lines.append("| " + " | ".join(cell(text) for text in cells) + " |")
    if group.example:
        lines += ["", "```fortran", group.example, "```"]
    return [*lines, ""]


def magnitude_page(program: Program) -> list[str]:
    """Return the section that says how large and how small numbers may be, by their unit."""
    found = {
        key.unit: key.magnitude[1]
        for group in program.groups
        for key in group.keys
        if key.magnitude and not {"max", "below"} & set(key.bounds)
    }
    least = {
        key.unit: key.magnitude[0]
        for group in program.groups
        for key in group.keys
        if key.magnitude and key.magnitude[0] > 0.0
    }
    lines = ["## Magnitudes", "", "Real values larger than these, and values that must be positive"]
    lines += ["but are smaller, are refused (D016), where the tables above give no bound on that"]
    lines += ["side.", "", "| unit | smallest positive | largest |", "|---|---|---|"]
    for unit in sorted(found):
        small = f"{least[unit]:g}" if unit in least else ""
        lines.append(f"| {unit or 'none'} | {small} | {found[unit]:g} |")
    return [*lines, ""]


def page(program: Program) -> str:
    """Return the page of one program."""
    lines = [f"# Deck of {program.name}", ""]
    if program.doc:
        lines += [program.doc, ""]
    lines += [
        "Groups may be in any order as `&group key = value, value, ... /`; `!` starts a comment;"
    ]
    lines += [
        "strings are quoted; units are SI; file names are relative to the deck. Every fault of a"
    ]
    lines += [
        f"deck is reported in one go, with its place. `{program.name} --keys` prints this table."
    ]
    if program.example:
        lines += ["", "```fortran", program.example, "```"]
    lines += ["", "| group | |", "|---|---|"]
    lines += [f"| `&{group.name}` | {cell(group.doc)} |" for group in program.groups]
    lines.append("")
    for group in program.groups:
        lines += group_page(group)
    lines += magnitude_page(program)
    return "\n".join(lines)
