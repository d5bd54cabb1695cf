"""Turn common/port/port.toml into Fortran, C and Python names and the tables of manual/port.md.

Usage: port.py            write what has changed
       port.py --check    say whether all is up to date, and which Fortran file types a name of a
                          field by hand (exit 1 if any does)
The format of port.toml is described at its top. Standard library only.
"""

import argparse
import re
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "common/port/port.toml"
NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z]+)?$")
NUMBERS = ("kind", "status", "verb", "flag", "cell")  # tables whose entries have a number
SIDES = ("both", "grains", "solid")
FIELD_WORDS = {"name", "kind", "size", "of", "shape", "unit", "optional", "when", "side", "doc"}
HAND = re.compile(
    r"(?:request|reply|ask)%(?:put|get|take|put_int|get_int|take_int|put_text|get_text|has)"
    r"\((?:[\w%()]+//)?'(?!\.')[^']"
)
MARK = re.compile(r"(<!-- port\.toml: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
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


# --- Fortran -----------------------------------------------------------------------------------


def public_lines(names: list[str]) -> list[str]:
    """Return `public ::` statements of at most 100 columns."""
    lines, line = [], "  public ::"
    for name in names:
        if len(line) + len(name) > 96:
            lines.append(line.rstrip(","))
            line = "  public ::"
        line += f" {name},"
    return [*lines, line.rstrip(",")]


def declared(text: str, doc: str) -> list[str]:
    """Return a declaration with its comment beside or before it."""
    if not doc:
        return [f"  {text}"]
    if len(f"  {text}  !! {doc}") <= 100:
        return [f"  {text}  !! {doc}"]
    return [f"  !> {line}" if k == 0 else f"  !! {line}"
            for k, line in enumerate(textwrap.wrap(doc, 94))] + [f"  {text}"]  # fmt: skip


def text_array(name: str, values: list[str], count: str) -> list[str]:
    """Return a parameter array of texts."""
    width = max(len(value) for value in values)
    head = f"  character(len={width}), parameter :: {name}({count}) = [character(len={width}) :: &"
    body = textwrap.wrap(", ".join(f"'{value}'" for value in values), 92)
    return [head, *[f"    {line} &" for line in body[:-1]], f"    {body[-1]}]"]


def fortran_verbs(port: Port) -> str:
    """Return the module talus_verbs."""
    verbs = port["verb"]
    names = [f"verb_{verb['name'].lower()}" for verb in verbs]
    lines = [
        "!> Verbs of the exchange port: one number each, the same on every side (manual/port.md).",
        "!!",
        f"!! {MADE}.",
        "module talus_verbs",
        "  use talus_kinds, only: i4",
        "  implicit none",
        "  private",
        *public_lines([*names, "verb_first", "verb_last", "verb_name"]),
        "",
    ]
    for verb, name in zip(verbs, names, strict=True):
        lines += declared(f"integer(i4), parameter :: {name} = {verb['number']}", verb["doc"])
    lines += [
        "",
        f"  integer(i4), parameter :: verb_first = {names[0]}, verb_last = {names[-1]}",
        *text_array("names", [verb["name"] for verb in verbs], "verb_first:verb_last"),
        "",
        "contains",
        "",
        "  !> Name of a verb as users read it; 'verb N' for a number that is none.",
        "  pure function verb_name(verb) result(name)",
        "    integer(i4), intent(in) :: verb",
        "    character(len=:), allocatable :: name",
        "    character(len=16) :: number",
        "",
        "    if (verb >= verb_first .and. verb <= verb_last) then",
        "      name = trim(names(verb))",
        "    else",
        "      write (number, '(i0)') verb",
        "      name = 'verb '//trim(number)",
        "    end if",
        "  end function verb_name",
        "end module talus_verbs",
    ]
    return "\n".join(lines) + "\n"


def fortran_scalars(port: Port) -> str:
    """Return the module talus_scalars."""
    places = scalar_places(port)
    flags = [f"flag_{flag['name']}" for flag in port["flag"]]
    names = [f"scalar_{scalar['name']}" for scalar, _ in places]
    lines = [
        "!> Scalars that every step reply carries, in one fixed order: field 'scalars',",
        "!! real(scalar_count). Work and spent energies in J count from the start of the run.",
        "!!",
        f"!! {MADE}.",
        "module talus_scalars",
        "  use talus_kinds, only: i4",
        "  implicit none",
        "  private",
        *public_lines([*names, "scalar_count", *flags]),
        "",
    ]
    for (scalar, place), name in zip(places, names, strict=True):
        size = scalar.get("size", 1)
        doc = f"{scalar['doc']} [{scalar['unit']}]"
        if size > 1:
            doc = f"first of {size}: {doc}"
        lines += declared(f"integer(i4), parameter :: {name} = {place}", doc)
    lines += [f"  integer(i4), parameter :: scalar_count = {scalar_count(port)}", ""]
    for flag, name in zip(port["flag"], flags, strict=True):
        lines += declared(f"integer(i4), parameter :: {name} = {flag['number']}", flag["doc"])
    return "\n".join([*lines, "end module talus_scalars"]) + "\n"


def texts(prefix: str, values: list[tuple[str, str, str]]) -> list[str]:
    """Return parameters of text: (name, value, doc)."""
    lines = []
    for name, value, doc in values:
        text = f"character(len=*), parameter :: {prefix}_{name} = '{value}'"
        lines += declared(text, doc)
    return lines


def fortran_names(port: Port) -> str:
    """Return the module talus_port_names."""
    protocol, roles = port["protocol"], port["role"]
    whats = list(dict.fromkeys(what["name"] for what in port["what"]))
    groups = {
        "field": [(constant(n), n, meaning(port, n, fields_of)) for n in field_names(port)],
        "dot": [(n, f".{n}", meaning(port, n, members_of)) for n in member_names(port)],
        "what": [(n, n, ", ".join(w["verb"] for w in port["what"] if w["name"] == n))
                 for n in whats],
        "scope": [(entry["name"], entry["name"], "") for entry in port["scope"]],
        "can": [(entry["name"], entry["name"], entry["doc"]) for entry in port["capability"]],
    }  # fmt: skip
    titles = {
        "field": "Fields; those of sets alone have no comment here.",
        "dot": "Fields of a set, to follow its name: '<set>.<name>'.",
        "what": "Values of the field `what` of DESCRIBE and SET.",
        "scope": "Values of the field `scope` of FORCE.",
        "can": "Words of HELLO's capabilities.",
    }
    names = ["protocol_version", "name_length", "header_words", "description_words"]
    names += [f"kind_{kind['name']}" for kind in port["kind"]]
    names += [f"role_{role['name']}" for role in roles] + ["role_count", "role_name", "role_number"]
    for prefix, entries in groups.items():
        names += [f"{prefix}_{name}" for name, _, _ in entries]
    lines = [
        "!> Names of the exchange port: fields, roles, scopes, capabilities (manual/port.md).",
        "!!",
        f"!! {MADE}.",
        "module talus_port_names",
        "  use talus_kinds, only: i4",
        "  implicit none",
        "  private",
        *public_lines(names),
        "",
        f"  integer(i4), parameter :: protocol_version = {protocol['version']}",
        f"  integer(i4), parameter :: name_length = {protocol['name_length']}",
        f"  integer(i4), parameter :: header_words = {protocol['header_words']}",
        f"  integer(i4), parameter :: description_words = {protocol['field_words']}",
        "",
        *[line for kind in port["kind"] for line in declared(
            f"integer(i4), parameter :: kind_{kind['name']} = {kind['number']}", kind["doc"])],
        "",
        "  ! Roles of sets; a message has their names, role_name(role_load).",
        *[line for k, role in enumerate(roles, 1) for line in declared(
            f"integer(i4), parameter :: role_{role['name']} = {k}", role["doc"])],
        f"  integer(i4), parameter :: role_count = {len(roles)}",
        *text_array("role_names", [role["name"] for role in roles], "role_count"),
    ]  # fmt: skip
    for prefix, entries in groups.items():
        lines += ["", f"  ! {titles[prefix]}", *texts(prefix, entries)]
    lines += [
        "",
        "contains",
        "",
        "  !> Name of a role as messages have it.",
        "  pure function role_name(role) result(name)",
        "    integer(i4), intent(in) :: role",
        "    character(len=:), allocatable :: name",
        "    name = trim(role_names(role))",
        "  end function role_name",
        "",
        "  !> Number of a role, 0 for a name that is none.",
        "  pure integer(i4) function role_number(name)",
        "    character(len=*), intent(in) :: name",
        "    role_number = findloc(role_names == name, .true., 1)",
        "  end function role_number",
        "end module talus_port_names",
    ]
    return "\n".join(lines) + "\n"


# --- C -----------------------------------------------------------------------------------------


def c_enum(title: str, prefix: str, entries: list[tuple[str, int, str]]) -> list[str]:
    """Return an enumeration: (name, number, doc)."""
    lines = [f"/* {title} */", f"enum talus_{prefix.lower()} {{"]
    for name, number, doc in entries:
        comment = f" /* {doc} */" if doc else ""
        lines.append(f"  TALUS_{prefix}_{name.upper()} = {number},{comment}")
    return [*lines, "};", ""]


def c_texts(title: str, prefix: str, names: list[str]) -> list[str]:
    """Return macros of texts."""
    lines = [f"/* {title} */"]
    lines += [f'#define TALUS_{prefix}_{constant(name).upper()} "{name}"' for name in names]
    return [*lines, ""]


def c_header(port: Port) -> str:
    """Return talus_port_names.h."""
    protocol = port["protocol"]
    lines = [
        "/* Names and numbers of the exchange port (manual/port.md), C11.",
        f"   {MADE}. */",
        "#ifndef TALUS_PORT_NAMES_H",
        "#define TALUS_PORT_NAMES_H",
        "",
        f'#define TALUS_PORT_MAGIC "{protocol["magic"]}"',
        f"#define TALUS_PORT_PROTOCOL {protocol['version']}",
        f"#define TALUS_PORT_HEADER_WORDS {protocol['header_words']}",
        f"#define TALUS_PORT_FIELD_WORDS {protocol['field_words']}",
        f"#define TALUS_PORT_NAME_LENGTH {protocol['name_length']}",
        f"#define TALUS_PORT_SCALARS {scalar_count(port)}",
        "",
    ]
    for title, table in (("kinds of fields", "kind"), ("status of a reply", "status"),
                         ("verbs", "verb"), ("kinds of elements and facets", "cell"),
                         ("health flags, summed in the scalar flags", "flag")):  # fmt: skip
        entries = [(e["name"], e["number"], e.get("doc", "")) for e in port[table]]
        lines += c_enum(title, table.upper(), entries)
    words = [(e["name"], k, e["doc"]) for k, e in enumerate(port["header"]) if e["name"]]
    lines += c_enum("words of the header, from 0", "HEADER", words)
    scalars = [(s["name"], place - 1, f"{s['doc']} [{s['unit']}]")
               for s, place in scalar_places(port)]  # fmt: skip
    lines += c_enum("places in the field scalars, from 0", "SCALAR", scalars)
    for title, prefix, names in (
        ("roles of sets", "ROLE", [e["name"] for e in port["role"]]),
        ("words of HELLO's capabilities", "CAN", [e["name"] for e in port["capability"]]),
        ("scopes of FORCE", "SCOPE", [e["name"] for e in port["scope"]]),
        ("what of DESCRIBE and SET", "WHAT",
         list(dict.fromkeys(e["name"] for e in port["what"]))),
        ("fields; those of sets follow the name of the set and a dot", "FIELD",
         field_names(port)),
    ):  # fmt: skip
        lines += c_texts(title, prefix, names)
    return "\n".join([*lines, "#endif"]) + "\n"


# --- Python ------------------------------------------------------------------------------------


def py_table(name: str, doc: str, entries: list[tuple[str, object]]) -> list[str]:
    """Return a dictionary, one entry a line."""
    lines = [f"# {doc}", f"{name} = {{"]
    for key, value in entries:
        text = f'"{value}"' if isinstance(value, str) else repr(value)
        lines.append(f'    "{key}": {text},')
    return [*lines, "}", ""]


def py_field(field: dict) -> str:
    """Return the entry of a field in the table of messages."""
    values = [field["name"], field.get("kind", "real"), size_text(field), field.get("side", "both")]
    text = ", ".join(f'"{value}"' for value in values)
    return f"({text}, {not field.get('optional', False)})"


def py_messages(name: str, doc: str, messages: list[tuple[str, list[dict]]]) -> list[str]:
    """Return a dictionary of messages, one field a line."""
    lines = [f"# {doc}", f"{name} = {{"]
    for key, fields in messages:
        if not fields:
            lines.append(f'    "{key}": (),')
            continue
        lines += [f'    "{key}": (', *[f"        {py_field(field)}," for field in fields], "    ),"]
    return [*lines, "}", ""]


def python_module(port: Port) -> str:
    """Return prepost/talus/port_names.py."""
    protocol = port["protocol"]
    whats = {what["name"]: None for what in port["what"]}
    requests = [(v["name"], v["request"]) for v in port["verb"]]
    requests += [(f"SET {w['name']}", w["fields"]) for w in port["what"] if w["verb"] == "SET"]
    replies = [(v["name"], v["reply"]) for v in port["verb"]]
    replies += [(f"DESCRIBE {w['name']}", w["fields"]) for w in port["what"]
                if w["verb"] == "DESCRIBE"]  # fmt: skip
    lines = [
        '"""Names and numbers of the exchange port (manual/port.md).',
        "",
        f"{MADE[0].upper()}{MADE[1:]}.",
        '"""',
        "",
        "# fmt: off",
        f'MAGIC = b"{protocol["magic"]}"',
        f"PROTOCOL = {protocol['version']}",
        f"HEADER_WORDS = {protocol['header_words']}",
        f"FIELD_WORDS = {protocol['field_words']}",
        f"NAME_LENGTH = {protocol['name_length']}",
        f"SCALAR_COUNT = {scalar_count(port)}",
        "",
    ]
    for table, title in (("verb", "verbs"), ("kind", "kinds of fields"),
                         ("status", "status of a reply, and exit codes"),
                         ("cell", "kinds of elements and facets"), ("flag", "health flags")):
        entries = [(entry["name"], entry["number"]) for entry in port[table]]
        name = {"status": "STATUS"}.get(table, f"{table.upper()}S")
        lines += py_table(name, title, entries)
    header = [(e["name"], k) for k, e in enumerate(port["header"]) if e["name"]]
    lines += py_table("HEADER", "words of the header, from 0", header)
    lines += py_table("SCALARS", "first place of each scalar, from 0",
                      [(s["name"], place - 1) for s, place in scalar_places(port)])
    lines += py_table("SCALAR_UNITS", "unit of each scalar",
                      [(s["name"], s["unit"]) for s in port["scalar"]])
    for table, title in (("role", "roles of sets"), ("capability", "words of HELLO's capabilities"),
                         ("scope", "scopes of FORCE")):
        name = {"capability": "CAPABILITIES"}.get(table, f"{table.upper()}S")
        lines += py_table(name, title, [(e["name"], "") for e in port[table]])
        lines = collapse(lines, name)
    lines += [f"WHATS = {py_tuple(list(whats))}", ""]
    lines += py_constants("Field", "Names of fields; of sets the part behind the dot.",
                          field_names(port))
    doc = "(name, kind, shape, side, required) of the fields of every {}; sets: SET_{}"
    lines += py_messages("REQUESTS", doc.format("request", "REQUESTS"), requests)
    lines += py_messages("REPLIES", doc.format("reply", "REPLIES"), replies)
    for direction in ("request", "reply"):
        plural = {"request": "REQUESTS", "reply": "REPLIES"}[direction]
        lines += py_messages(f"SET_{plural}", f"fields of sets in a {direction}: 'side role'",
                             [(f"{m['side']} {m['role']}", m[direction]) for m in port["member"]])
    return "\n".join(lines).rstrip() + "\n"


def py_tuple(values: list[str]) -> str:
    """Return a tuple of texts over several lines."""
    body = textwrap.wrap(", ".join(f'"{value}"' for value in values) + ",", 92)
    return "\n".join(["(", *[f"    {line}" for line in body], ")"])


def collapse(lines: list[str], name: str) -> list[str]:
    """Replace the dictionary that ends the lines by a tuple of its keys."""
    first = lines.index(f"{name} = {{")
    keys = [line.split('"')[1] for line in lines[first + 1 :] if line.startswith("    ")]
    return [*lines[:first], f"{name} = {py_tuple(keys)}", ""]


def py_constants(name: str, doc: str, values: list[str]) -> list[str]:
    """Return a class of texts."""
    lines = ["", f"class {name}:", f'    """{doc}"""', ""]
    lines += [f'    {constant(value).upper()} = "{value}"' for value in values]
    return [*lines, "", ""]


# --- manual ------------------------------------------------------------------------------------


def size_text(field: dict) -> str:
    """Return the shape of a field as users read it: (3, nodes)."""
    if field.get("kind") == "text":
        return "text"
    if "shape" in field:
        return field["shape"]
    size, of = field.get("size", 1), field.get("of")
    if not of:
        return "(1)"
    return f"({of})" if size == 1 else f"({size}, {of})"


def shape_text(field: dict) -> str:
    """Return shape with the mark of integers."""
    return f"{'i' if field.get('kind') == 'integer' else ''}{size_text(field)}"


def doc_text(field: dict, side: str = "both") -> str:
    """Return the meaning of a field with side and condition."""
    parts = []
    if field.get("side", side) != side:
        parts.append(field["side"])
    if field.get("optional"):
        parts.append("optional")
    if field.get("when"):
        parts.append(field["when"])
    head = f"*{', '.join(parts)}:* " if parts else ""
    return head + field["doc"]


def table(titles: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def field_rows(head: list[str], fields: list[dict], side: str) -> list[list[str]]:
    """Return rows of a table of fields; the head is in the first one only."""
    rows = []
    for field in fields:
        rows.append([*head, f"`{field['name']}`", shape_text(field), field.get("unit", ""),
                     doc_text(field, side)])  # fmt: skip
        head = [""] * len(head)
    return rows


def manual_tables(port: Port) -> dict[str, str]:
    """Return the tables of the manual's page by their mark."""
    shape = ["field", "shape", "unit", "meaning"]
    messages = []
    for verb in port["verb"]:
        for direction in ("request", "reply"):
            head = [verb["name"], direction]
            messages += field_rows(head, verb[direction], verb["side"])
    describe, assign = [], []
    for what in port["what"]:
        rows = field_rows([what["name"], what["side"]], what["fields"], what["side"])
        (describe if what["verb"] == "DESCRIBE" else assign).extend(rows)
    sets = []
    for member in port["member"]:
        for direction in ("request", "reply"):
            head = [member["side"], member["role"], direction]
            sets += field_rows(head, member[direction], member["side"])
    scalars = []
    for scalar, place in scalar_places(port):
        last = place + scalar.get("size", 1) - 1
        number = str(place) if last == place else f"{place}–{last}"
        scalars.append([number, scalar["name"], scalar["unit"], scalar["doc"]])
    named = {key: [[f"`{e['name']}`", e.get("side", ""), e["doc"]] for e in port[key]]
             for key in ("role", "scope")}  # fmt: skip
    return {
        "header": table(["word", "name", "header"],
                        [[e["word"], e["name"], e["doc"]] for e in port["header"]]),
        "kinds": table(["kind", "number", "data"],
                       [[e["name"], str(e["number"]), e["doc"]] for e in port["kind"]]),
        "status": table(["status", "meaning"],
                        [[str(e["number"]), e["doc"]] for e in port["status"]]),
        "faults": table(["field", "meaning"],
                        [[f"`{e['name']}`", e["doc"]] for e in port["fault"]]),
        "verbs": table(["verb", "number", "answered by", "what it does"],
                       [[e["name"], str(e["number"]), e["side"], e["doc"]]
                        for e in port["verb"]]),
        "messages": table(["verb", "in", *shape], messages),
        "capabilities": table(["word", "the solver answers"],
                              [[f"`{e['name']}`", e["doc"]] for e in port["capability"]]),
        "roles": table(["role", "side", "meaning"], named["role"]),
        "scopes": table(["scope", "side", "what counts"], named["scope"]),
        "describe": table(["what", "side", *shape], describe),
        "set": table(["what", "side", *shape], assign),
        "sets": table(["side", "role", "in", *shape], sets),
        "scalars": table(["place", "scalar", "unit", "meaning"], scalars),
        "flags": table(["flag", "meaning"],
                       [[str(e["number"]), e["doc"]] for e in port["flag"]]),
        "cells": table(["kind", "number"],
                       [[e["name"], str(e["number"])] for e in port["cell"]]),
        "counts": table(["count", "entities"],
                        [[name, doc] for name, doc in port["counts"].items()]),
    }  # fmt: skip


def manual_page(port: Port, text: str, faults: list[str]) -> str:
    """Return the page with the tables between its marks; a table without a mark is a fault."""
    tables = manual_tables(port)
    marks = [mark[1] for mark in MARK.findall(text)]
    faults += [f"manual/port.md: no table {mark}" for mark in marks if mark not in tables]
    faults += [f"manual/port.md: no mark for {name}" for name in tables if name not in marks]
    return MARK.sub(lambda m: f"{m[1]}\n{tables.get(m[2], '')}\n{m[3]}", text)


def hand_typed() -> list[str]:
    """Return the places where Fortran code types the name of a field by hand."""
    found = []
    for part in ("common", "dem", "fem", "couple"):
        for path in sorted((ROOT / part).rglob("*.f90")):
            for number, line in enumerate(path.read_text().splitlines(), 1):
                if HAND.search(line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    return found


def main() -> int:
    """Write or check all that follows from port.toml; return 1 when something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    port = tomllib.loads(SOURCE.read_text(encoding="utf-8"))
    faults = faults_of(port)
    manual = ROOT / "manual/port.md"
    made = {} if faults else {
        ROOT / "common/port/talus_verbs.f90": fortran_verbs(port),
        ROOT / "common/port/talus_scalars.f90": fortran_scalars(port),
        ROOT / "common/port/talus_port_names.f90": fortran_names(port),
        ROOT / "common/port/talus_port_names.h": c_header(port),
        ROOT / "prepost/talus/port_names.py": python_module(port),
        manual: manual_page(port, manual.read_text(encoding="utf-8"), faults),
    }  # fmt: skip
    for path, text in made.items():
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if options.check:
            faults.append(f"{path.relative_to(ROOT)} is out of date: run `make port`")
        else:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
    if options.check:
        faults += [f"{place} (take the name from talus_port_names)" for place in hand_typed()]
    print("\n".join(f"port.toml: {fault}" for fault in faults), end="\n" if faults else "")
    if options.check:
        print(f"{max(1, len(made)) - min(len(made), len(faults))} passed, {len(faults)} failed")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
