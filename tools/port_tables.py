"""Tables of manual/port.md from port.toml (port_definition)."""

import re

from port_definition import Port, scalar_places

MARK = re.compile(r"(<!-- port\.toml: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


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
