"""Fortran key tables from the definitions of a program (deck_definitions)."""

import textwrap

from deck_definitions import HUGE, PROGRAMS, Group, Key, Program


def quoted(text: str) -> str:
    """Return a Fortran string constant."""
    return "'" + text.replace("'", "''") + "'"


def real(value: float) -> str:
    """Return a Fortran real constant of kind wp."""
    text = repr(float(value))
    return (text if "." in text or "e" in text else text + ".0") + "_wp"


def call(head: str, doc: str, tail: str, indent: str = "    ") -> list[str]:
    """Return a Fortran call whose long text is cut over lines of at most 100 columns."""
    one = f"{indent}{head}{quoted(doc)}{tail}"
    if len(one) <= 96:
        return [one]
    lines = [f"{indent}{head}&"]
    pieces = textwrap.wrap(doc, 80, drop_whitespace=False, break_on_hyphens=False)
    for number, piece in enumerate(pieces):
        last = number == len(pieces) - 1
        lines.append(
            f"{indent}  {'' if number == 0 else '//'}{quoted(piece)}{tail if last else ' &'}"
        )
    return lines


def preset(key: Key) -> str:
    """Return the default of a key as text, values apart by |."""
    values = []
    for value in key.default or []:
        if isinstance(value, bool):
            values.append(".true." if value else ".false.")
        else:
            values.append(value if isinstance(value, str) else repr(value))
    return "|".join(values)


def key_lines(key: Key) -> list[str]:
    """Return the calls that define one key."""
    lines = call(
        f"call table%add_key({quoted(key.name)}, {quoted(key.kind)}, {quoted(key.unit)}, ",
        key.doc,
        ")",
    )
    if key.required:
        lines.append("    call table%need()")
    if (key.least, key.most) != (1, 1):
        most = "huge(1_i4)" if key.most == HUGE else f"{key.most}_i4"
        lines.append(f"    call table%sized({key.least}_i4, {most})")
    if key.default is not None:
        lines += call("call table%preset(", preset(key), ")")
    if key.bounds:
        limits = ", ".join(f"{word}={real(value)}" for word, value in key.bounds.items())
        lines.append(f"    call table%bounds({limits})")
    if key.magnitude:
        least, most = map(real, key.magnitude)
        lines.append(f"    call table%magnitude({least}, {most})")
    if key.choices:
        lines += call("call table%allow(", "|".join(key.choices), ")")
    if key.words:
        values = ", ".join(real(value) for value in key.words.values())
        lines += call("call table%words(", "|".join(key.words), f", [{values}])")
    return lines + rule_lines(key)


def condition_lines(head: str, conditions: dict[str, list[str]]) -> list[str]:
    """Return the calls that define conditions."""
    return [
        line
        for chooser, values in conditions.items()
        for line in call(f"call table%{head}{quoted(chooser)}, ", "|".join(values), ")")
    ]


def rule_lines(key: Key) -> list[str]:
    """Return the calls that say how a key depends on others, and what it was called."""
    lines = condition_lines("only_with(", key.of) + condition_lines("need_with(", key.need_if)
    for choice, wanted in key.choices_of.items():
        lines += condition_lines(f"choice_with({quoted(choice)}, ", wanted)
    for word, names in (("needs", key.needs), ("excludes", key.excludes), ("was", key.was)):
        if names:
            lines += call(f"call table%{word}(", "|".join(names), ")")
    if key.choices_were:
        old, new = "|".join(key.choices_were), "|".join(key.choices_were.values())
        lines += call(f"call table%choices_were({quoted(old)}, ", new, ")")
    return lines


def group_rule_lines(group: Group) -> list[str]:
    """Return the calls that say when a group has a meaning, and what it was called."""
    lines = condition_lines("group_with(", group.of)
    if group.was:
        lines += call("call table%group_was(", "|".join(group.was), ")")
    for names in group.one_of:
        lines += call("call table%one_of(", "|".join(names), ")")
    for names in group.some_of:
        lines += call("call table%one_of(", "|".join(names), ", at_least=.true.)")
    return lines


def group_lines(group: Group) -> list[str]:
    """Return the subroutines of one group, each with at most about 60 lines."""
    parts: list[list[str]] = [[]]
    for key in group.keys:
        lines = key_lines(key)
        if len(parts[-1]) + len(lines) > 44:
            parts.append([])
        parts[-1] += lines
    tail = ", repeats=.true." if group.repeat else ""
    tail += ", required=.true.)" if group.required else ")"
    head = call(f"call table%add_group({quoted(group.name)}, {len(group.keys)}, ", group.doc, tail)
    head += group_rule_lines(group)
    text = []
    for number, lines in enumerate(parts):
        name = f"group_{group.name}" + ("" if number == 0 else f"_{number + 1}")
        text += [
            "",
            f"  subroutine {name}(table)",
            "    type(key_table_type), intent(inout) :: table",
        ]
        text += (head if number == 0 else []) + lines
        if number < len(parts) - 1:
            text.append(f"    call group_{group.name}_{number + 2}(table)")
        text.append(f"  end subroutine {name}")
    return text


def fortran(program: Program) -> str:
    """Return the module of a program's key table."""
    prefix = PROGRAMS[program.folder]
    text = [f"!> Key table of {program.name}: generated by tools/keys.py, do not edit. Sources:"]
    text += [f"!! {program.folder}/deck.toml and common/deck.toml; then `make keys`."]
    text += [f"module {prefix}_deck_keys"]
    body = [line for group in program.groups for line in group_lines(group)]
    kinds = [kind for kind in ("wp", "i4") if any(f"_{kind}" in line for line in body)]
    if kinds:
        text.append(f"  use talus_kinds, only: {', '.join(kinds)}")
    text += ["  use talus_deck_table, only: key_table_type", "  implicit none", "  private"]
    text += [f"  public :: {prefix}_deck_table", "", "contains", ""]
    text += [
        f"  !> All groups and keys of a deck of {program.name}.",
        f"  subroutine {prefix}_deck_table(table)",
    ]
    text += ["    type(key_table_type), intent(inout) :: table"]
    text += [f"    call table%init({quoted(program.name)}, {len(program.groups)})"]
    text += [f"    call group_{group.name}(table)" for group in program.groups]
    text += [f"  end subroutine {prefix}_deck_table", *body, f"end module {prefix}_deck_keys", ""]
    return "\n".join(text)
