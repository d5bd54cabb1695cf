"""Measure Fortran procedures: lines, arguments, levels of nesting; find variables of modules.

The functions take code as `code_of` returns it: lower case, without comments and strings.
"""

import re
from dataclasses import dataclass

LIMITS = {"lines": 60, "arguments": 7, "levels": 3, "module-variable": 0}

START = re.compile(
    r"^\s*(?!end\b)(?:[\w()=*, ]+\s)?(?P<kind>subroutine|function)\s+(?P<name>\w+)\s*"
    r"(?P<rest>\(.*|$)"
)
END = re.compile(r"^\s*end\s*(subroutine|function|program|procedure)?\s*(\w+)?\s*$")
INTERFACE = re.compile(r"^\s*(abstract\s+)?interface\b")
OPENS = re.compile(
    r"^\s*(\w+\s*:\s*)?(do\b(?!\s*=)|if\s*\(.*\)\s*then\s*$|select\s+(case|type|rank)\b"
    r"|where\s*\([^=]*\)\s*$|associate\s*\(|block\s*$|forall\s*\(.*\)\s*$)"
)
CLOSES = re.compile(r"^\s*end\s*(do|if|select|where|associate|block|forall)\b")
TYPE_OPENS = re.compile(r"^\s*type\b(?!\s*\()")
DECLARATION = re.compile(
    r"^\s*(real|integer|logical|character|complex|type|class|double\s+precision)\b"
)


@dataclass
class Procedure:
    """A procedure and its measures."""

    name: str
    line: int
    lines: int
    arguments: int
    nesting: int


def code_of(lines: list[str]) -> list[str]:
    """Return the lines in lower case without comments, and with the insides of strings blanked."""
    bare, quote = [], ""
    for line in lines:
        kept = []
        for letter in line:
            if quote:
                quote = "" if letter == quote else quote
                kept.append(letter if not quote else " ")
            elif letter in "'\"":
                quote = letter
                kept.append(letter)
            elif letter == "!":
                break
            else:
                kept.append(letter)
        text = "".join(kept)
        if quote and not text.rstrip().endswith("&") and not line.rstrip().endswith("&"):
            quote = ""
        bare.append(text.lower())
    return bare


def joined(code: list[str]) -> list[tuple[int, int, str]]:
    """Return (first line, last line, statement) with continued lines put together."""
    statements: list[tuple[int, int, str]] = []
    first, text = 0, ""
    for number, line in enumerate(code, 1):
        part = line.strip()
        if text and not part:
            continue
        first = number if not text else first
        text += part.removeprefix("&")
        if text.endswith("&"):
            text = text[:-1]
            continue
        if text:
            statements.append((first, number, text))
        text = ""
    return statements


def count_arguments(rest: str) -> int:
    """Return the number of dummy arguments in `(a, b, c) ...`."""
    inside = re.match(r"\(([^()]*)\)", rest.strip())
    return len([name for name in inside.group(1).split(",") if name.strip()]) if inside else 0


def procedures(code: list[str]) -> list[Procedure]:
    """Return all procedures with a body; interfaces of foreign ones do not count."""
    found: list[Procedure] = []
    stack: list[Procedure] = []
    depth = deepest = 0
    interface = False
    for first, last, text in joined(code):
        if INTERFACE.match(text):
            interface = True
        elif re.match(r"^\s*end\s*interface\b", text):
            interface = False
        if interface:
            continue
        if start := START.match(text):
            arguments = count_arguments(start["rest"])
            stack.append(Procedure(start["name"], first, 0, arguments, 0))
            depth = deepest = 0
        elif re.match(r"^\s*end\s*(subroutine|function)\b", text) and stack:
            done = stack.pop()
            done.lines = last - done.line + 1
            done.nesting = deepest
            found.append(done)
            depth = deepest = 0
        elif CLOSES.match(text):
            depth -= 1
        elif OPENS.match(text):
            depth += 1
            deepest = max(deepest, depth)
    return found


def module_variables(code: list[str]) -> list[tuple[int, str]]:
    """Return (line, name) of the variables that a module declares, without parameters."""
    found = []
    in_type = interface = False
    for first, _, text in joined(code):
        if re.match(r"^\s*contains\b", text) and not in_type:
            break
        if re.match(r"^\s*end\s*type\b", text):
            in_type = False
            continue
        if re.match(r"^\s*end\s*interface\b", text):
            interface = False
            continue
        if INTERFACE.match(text):
            interface = True
        elif TYPE_OPENS.match(text):
            in_type = True
        if in_type or interface or "::" not in text or not DECLARATION.match(text):
            continue
        left, right = text.split("::", 1)
        if "parameter" in left:
            continue
        name = re.match(r"\s*(\w+)", right)
        found.append((first, name.group(1) if name else "?"))
    return found


def breaches(code: list[str]) -> list[tuple[int, str, str, int]]:
    """Return (line, name, rule, value) of what is above a limit."""
    found = []
    for it in procedures(code):
        measured = {"lines": it.lines, "arguments": it.arguments, "levels": it.nesting}
        found += [
            (it.line, it.name, rule, value)
            for rule, value in measured.items()
            if value > LIMITS[rule]
        ]
    if any(re.match(r"^\s*module\s+\w+\s*$", line) for line in code):
        found += [(line, name, "module-variable", 1) for line, name in module_variables(code)]
    return found
