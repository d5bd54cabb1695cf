"""C header and Python module of the exchange port from port.toml (port_definition)."""

import textwrap

from port_definition import MADE, Port, constant, field_names, scalar_count, scalar_places
from port_tables import size_text


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


WIDTH = 100  #: columns of a line
SHORT = 80  #: characters of the entries of a table that stands in one line


def py_table(name: str, doc: str, entries: list[tuple[str, object]]) -> list[str]:
    """Return a dictionary: texts one entry a line, numbers as many as fit."""
    lines = [f"# {doc}", f"{name} = {{"]
    if all(isinstance(value, int) for _, value in entries):
        short = ", ".join(f'"{key}": {value}' for key, value in entries)
        if len(short) < SHORT:
            return [lines[0], f"{name} = {{{short}}}", ""]
        body = " ".join(f'"{key}":_{value},' for key, value in entries)
        return [*lines, *(f"    {line}" for line in wrapped(body)), "}", ""]
    for key, value in entries:
        text = f'"{value}"' if isinstance(value, str) else repr(value)
        lines.append(f'    "{key}": {text},')
    return [*lines, "}", ""]


def wrapped(body: str) -> list[str]:
    """Return lines of entries; `:_` marks a blank at which none is broken."""
    lines = textwrap.wrap(body, 92, break_long_words=False, break_on_hyphens=False)
    return [line.replace(":_", ": ") for line in lines]


def py_field(field: dict) -> str:
    """Return the entry of a field in the table of messages."""
    values = [field["name"], field.get("kind", "real"), size_text(field), field.get("side", "both")]
    text = ", ".join(f'"{value}"' for value in values)
    return f"({text}, {not field.get('optional', False)})"


def py_messages(name: str, doc: str, messages: list[tuple[str, list[dict]]]) -> list[str]:
    """Return a dictionary of messages, one field a line where a line is too short for all."""
    lines = [f"# {doc}", f"{name} = {{"]
    for key, fields in messages:
        if not fields:
            lines.append(f'    "{key}": (),')
            continue
        line = f'    "{key}": ({", ".join(py_field(field) for field in fields)},),'
        if len(line) <= WIDTH:
            lines.append(line)
            continue
        lines += [f'    "{key}": (', *[f"        {py_field(field)}," for field in fields], "    ),"]
    return [*lines, "}", ""]


def python_module(port: Port) -> str:
    """Return prepost/talus/port_names.py."""
    protocol = port["protocol"]
    whats = {what["name"]: None for what in port["what"]}
    lines = [
        '"""Names and numbers of the exchange port (manual/port.md).',
        "",
        f"{MADE[0].upper()}{MADE[1:]}.",
        '"""',
        "",
        "# fmt: off",
        f'MAGIC = b"{protocol["magic"]}"',
        f"PROTOCOL = {protocol['version']}",
        f"HEADER_WORDS, FIELD_WORDS = {protocol['header_words']}, {protocol['field_words']}",
        f"NAME_LENGTH, SCALAR_COUNT = {protocol['name_length']}, {scalar_count(port)}",
        "",
    ]
    for table, title in (
        ("verb", "verbs"),
        ("kind", "kinds of fields"),
        ("status", "status of a reply, and exit codes"),
        ("cell", "kinds of elements and facets"),
        ("flag", "health flags"),
    ):
        entries = [(entry["name"], entry["number"]) for entry in port[table]]
        name = {"status": "STATUS"}.get(table, f"{table.upper()}S")
        lines += py_table(name, title, entries)
    header = [(e["name"], k) for k, e in enumerate(port["header"]) if e["name"]]
    lines += py_table("HEADER", "words of the header, from 0", header)
    lines += py_table(
        "SCALARS",
        "first place of each scalar, from 0",
        [(s["name"], place - 1) for s, place in scalar_places(port)],
    )
    lines += py_table(
        "SCALAR_UNITS", "unit of each scalar", [(s["name"], s["unit"]) for s in port["scalar"]]
    )
    for table, title in (
        ("role", "roles of sets"),
        ("capability", "words of HELLO's capabilities"),
        ("scope", "scopes of FORCE"),
    ):
        name = {"capability": "CAPABILITIES"}.get(table, f"{table.upper()}S")
        lines += py_table(name, title, [(e["name"], "") for e in port[table]])
        lines = collapse(lines, name)
    lines += [f"WHATS = {py_tuple(list(whats))}", ""]
    lines += py_constants(
        "Field", "Names of fields; of sets the part behind the dot.", field_names(port)
    )
    return "\n".join(lines).rstrip() + "\n"


def python_messages(port: Port) -> str:
    """Return prepost/talus/port_messages.py."""
    requests = [(v["name"], v["request"]) for v in port["verb"]]
    requests += [(f"SET {w['name']}", w["fields"]) for w in port["what"] if w["verb"] == "SET"]
    replies = [(v["name"], v["reply"]) for v in port["verb"]]
    replies += [(f"DESCRIBE {w['name']}", w["fields"]) for w in port["what"]
                if w["verb"] == "DESCRIBE"]  # fmt: skip
    lines = ['"""Fields of the messages of the exchange port (manual/port.md).', ""]
    lines += [f"{MADE[0].upper()}{MADE[1:]}.", '"""', "", "# fmt: off"]
    doc = "(name, kind, shape, side, required) of the fields of every {}; sets: SET_{}"
    lines += py_messages("REQUESTS", doc.format("request", "REQUESTS"), requests)
    lines += py_messages("REPLIES", doc.format("reply", "REPLIES"), replies)
    for direction in ("request", "reply"):
        plural = {"request": "REQUESTS", "reply": "REPLIES"}[direction]
        lines += py_messages(
            f"SET_{plural}",
            f"fields of sets in a {direction}: 'side role'",
            [(f"{m['side']} {m['role']}", m[direction]) for m in port["member"]],
        )
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
