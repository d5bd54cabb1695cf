"""The reference of the Python package: signatures and docstrings of all modules, as a page.

Sources are read, not imported, so that it needs none of the package's libraries.
"""

import ast
import html
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "prepost" / "talus"
#: modules of the command line: their options are on the page of pre- and postprocessing
COMMANDS = ("commands", "cli", "arguments", "__main__")
#: topics and their modules, in the order of the page; the rest are tools of these
TOPICS = {
    "Packings and grains": [
        "packing", "generate", "forms", "gradations", "tile", "tile_stamp", "tile_even",
        "tile_check", "column", "column_stack", "column_stamp", "column_measure",
    ],
    "Meshes": ["mesh", "gmsh_file", "block", "elements", "surface"],
    "Results": [
        "files", "datasets", "histories", "fields", "vtkhdf", "measure", "network", "specimens",
        "drivers", "strength", "secant", "orders", "compare", "checksum", "verification",
    ],
    "Fits and studies": ["fit", "study"],
    "Port": [
        "port", "port_frame", "port_solid", "port_linear", "port_explicit", "port_grains",
        "port_shm", "port_test", "port_asker", "port_judge", "port_names", "exchange",
    ],
    "Plots, pictures and pages": [
        "look", "plots", "gallery", "pictures", "picture_series", "view", "view_data", "watch",
        "watch_data", "reports", "report_compare", "lights", "paraview_scene",
    ],
    "Decks and machine": [
        "reference", "schema", "editor_files", "deck_json", "templates", "programs", "machine",
        "faults", "progress",
    ],
}  # fmt: skip
MARKS = ("property", "classmethod", "staticmethod")
REST = "Parts of the modules above"
Definition = ast.FunctionDef | ast.ClassDef


def modules() -> dict[str, Path]:
    """Return dotted name -> source of all modules of the package, without its commands."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] not in (*COMMANDS, "templates") or parts == ("templates",):
            name = ".".join(("talus", *(part for part in parts if part != "__init__")))
            found[name] = path
    return found


def by_topics(names: list[str]) -> dict[str, list[str]]:
    """Return topic -> modules; a package stands with its modules."""
    left = list(names)
    found = {}
    for topic, stems in TOPICS.items():
        found[topic] = [name for stem in stems for name in names
                        if name.split(".")[1:2] == [stem]]  # fmt: skip
        left = [name for name in left if name not in found[topic]]
    return {"The package": ["talus"], **found, REST: [name for name in left if name != "talus"]}


def public(body: list[ast.stmt]) -> Iterator[Definition]:
    """Yield the functions and classes of a body whose names are no private ones."""
    for node in body:
        if isinstance(node, Definition) and not node.name.startswith("_"):
            yield node


def text_html(text: str) -> str:
    """Return a docstring as HTML, each paragraph on one line; indented ones as they are."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        inside = html.escape(paragraph, quote=False).replace("$", "&#36;")
        if paragraph.startswith("  "):
            parts.append(f"<pre>{inside}</pre>".replace("\n", "&#10;").replace("`", "&#96;"))
            continue
        inside = re.sub(r"``?([^`]+)``?", r"<code>\1</code>", " ".join(inside.split()))
        parts.append(f"<p>{inside.replace('`', '&#96;')}</p>")
    return "".join(parts)


def signature(node: Definition) -> str:
    """Return a function with arguments and result, or a class with its bases."""
    if isinstance(node, ast.ClassDef):
        bases = ", ".join(ast.unparse(base) for base in node.bases)
        return f"class {node.name}" + (f"({bases})" if bases else "")
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    kinds = [ast.unparse(mark) for mark in node.decorator_list]
    marks = "".join(f"@{kind} " for kind in kinds if kind in MARKS)
    return f"{marks}{node.name}({ast.unparse(node.args)}){result}"


def code(text: str) -> str:
    """Return code as HTML that Markdown leaves alone."""
    return html.escape(text, quote=False).replace("$", "&#36;").replace("`", "&#96;")


def fields(node: ast.ClassDef, lines: list[str]) -> list[str]:
    """Return the fields of a class with type, default and the comment behind them."""
    found = []
    for one in node.body:
        if not isinstance(one, ast.AnnAssign) or not isinstance(one.target, ast.Name):
            continue
        note = re.search(r"#\s*(?!fmt|noqa)(.*)$", lines[one.end_lineno - 1][one.end_col_offset :])
        said = f" {code(note[1])}" if note else ""
        found.append(f"<li><code>{code(ast.unparse(one))}</code>{said}</li>")
    return [f"<ul>{''.join(found)}</ul>"] if found else []


def entry(node: Definition, anchor: str, lines: list[str]) -> list[str]:
    """Return the section of a function, or of a class with its fields and methods."""
    found = [f'<h4 id="{anchor}">{code(anchor.removeprefix("talus."))}</h4>',
             f"<pre><code>{code(signature(node))}</code></pre>",
             text_html(ast.get_docstring(node) or "")]  # fmt: skip
    if isinstance(node, ast.ClassDef):
        found += fields(node, lines)
        for method in public(node.body):
            found.append(f"<p><code>{code(signature(method))}</code></p>")
            found.append(text_html(ast.get_docstring(method) or ""))
    return found


def module_lines(name: str, path: Path) -> list[str]:
    """Return the section of a module."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    lines = [f'<h3 id="{name}">{name}</h3>', text_html(ast.get_docstring(tree) or "")]
    for node in public(tree.body):
        lines += entry(node, f"{name}.{node.name}", source.splitlines())
    return lines


def page() -> str:
    """Return the reference as a page of the manual."""
    found = modules()
    lines = [
        "# Python package",
        "",
        "What stands behind the command `talus`, for scripts of your own: `import talus` after "
        "`pip install` or with `prepost` on the path. Arrays have one row a grain, node or "
        "element, units are SI, faults are `talus.faults.FaultError` with a [code](errors.md). "
        "The command itself is on the page [pre- and postprocessing](prepost.md), readers of "
        "files without this package on [files](files.md).",
        "",
    ]
    for topic, names in by_topics(list(found)).items():
        lines += [f"## {topic}", "", ", ".join(f"[{name}](#{name})" for name in names), ""]
        for name in names:
            lines += ["\n\n".join(module_lines(name, found[name])), ""]
    return "\n".join(lines)
