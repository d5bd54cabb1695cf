"""Fortran modules of the exchange port from port.toml (port_definition)."""

import textwrap

from port_definition import (
    MADE,
    Port,
    constant,
    field_names,
    fields_of,
    meaning,
    member_names,
    members_of,
    scalar_count,
    scalar_places,
)


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
