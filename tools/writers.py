"""List the modules that write each component of the great types; at most two shall.

A component is written by an assignment to it or to part of it (`x%a%b(i) = ...` writes `b`), by
allocate, deallocate and move_alloc. Names of associate constructs are followed, and parts are found
through the types of components. Actual arguments do not count: who is called writes. Prints
`module type%component: writers`, closes with the number above the limit; with --check it prints
only those and exits with 1 if there are any.
"""

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from style_procedures import code_of, joined

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("common", "dem", "fem", "couple")
LIMIT = 2
# modules whose types are looked at: each type and its parts
WATCHED = (
    "cpl_overlap",
    "cpl_overlap_forces",
    "cpl_overlap_motion",
    "cpl_overlap_state",
    "cpl_interface",
    "cpl_interface_state",
    "cpl_parts",
    "cpl_relax",
    "fem_body_state",
    "fem_body",
    "fem_parts",
    "dem_surface_state",
)

USE = re.compile(r"^use\s*(?:,\s*\w+\s*)?(?:::)?\s*(\w+)\s*(?:,\s*only\s*:\s*(.*))?$")
TYPE = re.compile(r"^type\s*(?:,\s*([^:]*))?(?:::)?\s*(\w+)$")
OF_TYPE = re.compile(r"^(?:type|class)\s*\(\s*(\w+)\s*\)(.*?)::(.*)$")
DECLARED = re.compile(r"^(?:real|integer|logical|character|complex)\b(.*?)::(.*)$")
PROCEDURE = re.compile(r"^(?!end\b)(?:[\w()=*, ]+\s)?(?:subroutine|function)\s+\w+")
ENDS = re.compile(r"^end\s*(subroutine|function|program|module|type|associate|block|interface)\b")
GUARD = re.compile(r"^(?:\w+\s*:\s*)?(?:else\s*)?(?:if|where|forall)\s*(?=\()")
CALLED = re.compile(r"\b(?:de)?allocate\s*\(|\bcall\s+move_alloc\s*\(")

TypeName = tuple[str, str]  # module, name


def outside(text: str, mark: str) -> list[str]:
    """Split at a mark that is in no brackets."""
    parts, depth, last = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if letter == mark and depth == 0:
            parts.append(text[last:place])
            last = place + 1
    return [*parts, text[last:]]


def after_bracket(text: str) -> int:
    """Return where the bracket that opens the text has closed."""
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return place + 1
    return len(text)


def bare(text: str) -> str:
    """Return a reference without subscripts and blanks."""
    kept, depth = [], 0
    for letter in text:
        depth += letter in "(["
        if depth == 0 and not letter.isspace():
            kept.append(letter)
        depth -= letter in ")]"
    return "".join(kept)


def names(text: str) -> list[str]:
    """Return the names of a declaration's right side."""
    return [m[0] for part in outside(text, ",") if (m := re.match(r"\w+", part.strip()))]


@dataclass
class Type:
    """A derived type: its parent and the types of its components ('' of intrinsic ones)."""

    parent: str = ""
    components: dict[str, str] = field(default_factory=dict)


@dataclass
class Module:
    """A module: statements, what it takes from others, and its types."""

    name: str
    statements: list[str]
    uses: dict[str, TypeName] = field(default_factory=dict)
    types: dict[str, Type] = field(default_factory=dict)


def read_module(path: Path) -> Module:
    """Read the types and the uses of a module."""
    code = code_of(path.read_text().splitlines())
    module = Module(path.stem, [re.sub(r"\s+", " ", text) for _, _, text in joined(code)])
    current: Type | None = None
    for text in module.statements:
        if use := USE.match(text):
            for item in (use[2] or "").split(","):
                local, _, original = item.partition("=>")
                module.uses[local.strip()] = (use[1], (original or local).strip())
        elif re.match(r"^end ?type\b", text):
            current = None
        elif (opens := TYPE.match(text)) and "=" not in text:
            parent = re.search(r"extends\s*\(\s*(\w+)", opens[1] or "")
            current = module.types[opens[2]] = Type(parent[1] if parent else "")
        elif current is not None and (found := OF_TYPE.match(text)):
            current.components |= dict.fromkeys(names(found[3]), found[1])
        elif current is not None and (found := DECLARED.match(text)):
            current.components |= dict.fromkeys(names(found[2]), "")
    return module


def targets(text: str) -> Iterator[str]:
    """Yield the references that a statement writes."""
    while guard := GUARD.match(text):
        rest = text[guard.end() :]
        text = rest[after_bracket(rest) :].strip()
    for called in CALLED.finditer(text):
        rest = text[called.end() - 1 :]
        for argument in outside(rest[1 : after_bracket(rest) - 1], ","):
            if len(outside(argument, "=")) == 1:  # not source=
                yield bare(argument.split("::")[-1])
    left = outside(text, "=")
    if len(left) > 1 and "call " not in left[0] and re.fullmatch(r"[\w%]+", bare(left[0])):
        yield bare(left[0])


class Scanner:
    """Finds the types of references and collects who writes what."""

    def __init__(self, modules: list[Module]) -> None:
        """Take the modules that are known."""
        self.modules = {module.name: module for module in modules}
        self.writers: dict[tuple[str, str, str], set[str]] = {}

    def find_type(self, module: str, name: str) -> TypeName | None:
        """Return where a type that a module names is declared."""
        known = self.modules.get(module)
        if known is None or not name:
            return None
        if name in known.types:
            return module, name
        return self.find_type(*known.uses[name]) if name in known.uses else None

    def component(self, of: TypeName | None, name: str) -> tuple[TypeName, str] | None:
        """Return the type that declares a component, its own or a parent, and the name."""
        while of is not None:
            kind = self.modules[of[0]].types[of[1]]
            if name in kind.components:
                return of, name
            if name == kind.parent:
                return of, name
            of = self.find_type(of[0], kind.parent)
        return None

    def follow(self, reference: str, scopes: list[dict[str, TypeName | None]]) -> tuple:
        """Return (type of a reference, component that it ends in); either may be None."""
        first, *rest = reference.split("%")
        of: TypeName | None = None
        last = None
        for scope in reversed(scopes):
            if first in scope:
                of, last = scope[first]
                break
        for name in rest:
            last = self.component(of, name)
            if last is None:
                return None, None
            place, _ = last
            kind = self.modules[place[0]].types[place[1]]
            of = self.find_type(place[0], kind.components.get(name, kind.parent))
        return of, last

    def scan(self, module: Module) -> None:
        """Collect what a module writes."""
        scopes: list[dict] = [{}]
        in_type = in_interface = False
        for text in module.statements:
            ends = ENDS.match(text)
            if re.match(r"^(abstract )?interface\b", text):
                in_interface = True
            elif ends and ends[1] in ("type", "interface"):
                in_type = in_interface = False
            elif in_type or in_interface:
                continue
            elif TYPE.match(text) and "=" not in text:
                in_type = True
            elif ends and ends[1] in ("subroutine", "function", "associate", "block"):
                scopes.pop()
            elif PROCEDURE.match(text) or re.match(r"^(\w+ ?: ?)?block$", text):
                scopes.append({})
            elif opens := re.match(r"^(?:\w+ ?: ?)?associate ?\((.*)\)$", text):
                scopes.append(self.associated(opens[1], scopes))
            elif found := OF_TYPE.match(text):
                of = self.find_type(module.name, found[1])
                scopes[-1] |= dict.fromkeys(names(found[3]), (of, None))
            elif found := DECLARED.match(text):
                scopes[-1] |= dict.fromkeys(names(found[2]), (None, None))
            else:
                for target in targets(text):
                    _, written = self.follow(target, scopes)
                    if written is not None:
                        (place, kind), name = written
                        self.writers.setdefault((place, kind, name), set()).add(module.name)

    def associated(self, text: str, scopes: list[dict]) -> dict:
        """Return the names of an associate construct."""
        inner = {}
        for part in outside(text, ","):
            name, _, target = part.partition("=>")
            reference = bare(target)
            plain = re.fullmatch(r"[\w%]+", reference)
            inner[name.strip()] = self.follow(reference, scopes) if plain else (None, None)
        return inner


def read_writers(root: Path) -> dict[tuple[str, str, str], set[str]]:
    """Return (module, type, component) -> modules that write it, for all types of the suite."""
    paths = [path for folder in FOLDERS for path in sorted((root / folder).rglob("*.f90"))]
    modules = [read_module(path) for path in paths]
    scanner = Scanner(modules)
    for module in modules:
        scanner.scan(module)
    return scanner.writers


def check(root: Path) -> list[str]:
    """Return the components of the great types that more modules write than the limit."""
    return [
        f"{module}: {kind}%{name} is written by {len(by)} modules: {', '.join(sorted(by))}"
        for (module, kind, name), by in sorted(read_writers(root).items())
        if module in WATCHED and len(by) > LIMIT
    ]


def main() -> int:
    """Print who writes what; with --check return 1 if a component has too many writers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--check", action="store_true", help="only what is above the limit")
    parser.add_argument("--all", action="store_true", help="types of all modules")
    options = parser.parse_args()
    root = options.root.resolve()
    if not options.check:
        for (module, kind, name), by in sorted(read_writers(root).items()):
            if options.all or module in WATCHED:
                print(f"{module} {kind}%{name}: {len(by)} {' '.join(sorted(by))}")
    found = check(root)
    if options.check and found:
        print("\n".join(found))
    print(f"{len(found)} components have more than {LIMIT} writers")
    return int(options.check and bool(found))


if __name__ == "__main__":
    sys.exit(main())
