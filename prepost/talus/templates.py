"""Decks from templates: a folder of the package a kind, with its questions in template.toml.

template.toml holds `title`; `[key.NAME]` with text, default, unit and bounds (`ask`: asked on a
terminal; `follows`: an expression that stands for the default where other keys are not theirs);
`[small]`, values of a run of seconds; `[first]` and `[derived]`, expressions over the keys, in
order, the former before those that follow;
`prepare`, commands of `talus` that write packings and meshes; `decks`, those that are run, in
order, as `name.nml` or `name.nml --restart=...`, with commands `talus ...` between them; `look`,
commands of `talus` for afterwards. Words in braces are replaced in all files.
"""

import contextlib
import io
import math
import re
import shlex
import tomllib
from dataclasses import dataclass
from pathlib import Path

from talus.faults import FaultError
from talus.files import make_folder, write_text_file
from talus.programs import program_of
from talus.study.deck_keys import BOUNDS
from talus.study.expressions import check_expression, evaluate
from talus.study.faults import nearest

FOLDER = Path(__file__).parent / "templates"
WORD = re.compile(r"\{(\w+)\}")
WHOLE = re.compile(r"(ceil|floor)\([^()]*\)")
FILLED = (".nml", ".toml")
COPIED = (".sh", ".env", ".py")  # their braces are their own
BETWEEN = "talus "  # begins a command between decks
DIGITS = 6  # of derived numbers in a deck
RUN = """#!/bin/sh
# {title}: from the packings that are here to the figures.
set -e
cd "$(dirname "$0")"
bin=${{TALUS_BIN:+$TALUS_BIN/}}
{lines}
"""


@dataclass(frozen=True)
class Template:
    """A kind of decks: its name, folder and table."""

    name: str
    folder: Path
    table: dict

    @property
    def keys(self) -> dict[str, dict]:
        """Return the questions by name."""
        return self.table["key"]

    @property
    def decks(self) -> list[str]:
        """Return the names of the decks that are run, in order."""
        return [line.split()[0] for line in self.table["decks"] if not line.startswith(BETWEEN)]


def kinds() -> list[str]:
    """Return the names of all templates."""
    return sorted(path.parent.name for path in FOLDER.glob("*/template.toml"))


def load(name: str) -> Template:
    """Return a template by its name."""
    folder = FOLDER / name
    return Template(name, folder, tomllib.loads((folder / "template.toml").read_text("utf-8")))


def number_of(name: str, key: dict, text: str) -> float | int:
    """Return the value of a key; E631 where it is no number or out of its range."""
    unit = f" {key['unit']}" if key.get("unit") else ""
    whole = isinstance(key["default"], int)
    try:
        value = int(text) if whole else float(text)
    except ValueError as fault:
        kind = "a whole number" if whole else f"a number{' in' * bool(unit)}{unit}"
        raise FaultError("E631", f"{name} = '{text}' is no {kind[2:]}", key["text"]) from fault
    for bound, (say, holds) in BOUNDS.items():
        if not math.isfinite(value) or bound in key and not holds(value, key[bound]):
            limit = f"it must be {say} {key[bound]:g}{unit}" if bound in key else key["text"]
            raise FaultError("E631", f"{name} = {text} is out of its range", limit)
    return value


def settings(template: Template, given: list[str], small: bool) -> dict[str, float]:
    """Return the values of keys: those given as `key=value`, else defaults that follow no other."""
    values = {n: key["default"] for n, key in template.keys.items() if "follows" not in key}
    if small:
        values |= template.table["small"]
    for item in given:
        name, sign, text = item.partition("=")
        if name not in template.keys or not sign:
            hint = nearest(name, template.keys) if sign else "--set key=value"
            keys = ", ".join(template.keys)
            what = f"no key '{name}'" if sign else f"'{item}' without a value"
            raise FaultError("E630", f"{what}; {template.name} has {keys}", hint)
        values[name] = number_of(name, template.keys[name], text)
    return values


def complete(template: Template, values: dict[str, float]) -> dict[str, float]:
    """Return the values with those that follow from others where they were not given."""
    place = f"{template.name}/template.toml"
    numbers = dict(values)
    for name, text in template.table.get("first", {}).items():
        check_expression(text, list(numbers), place)
        numbers[name] = evaluate(text, numbers)
    for name, key in template.keys.items():
        if name not in numbers:
            check_expression(key["follows"], list(numbers), place)
            numbers[name] = evaluate(key["follows"], numbers)
    return numbers


def shown(value: float) -> str:
    """Return a number as a deck has it."""
    return repr(value) if isinstance(value, int) else repr(float(f"{value:.{DIGITS}g}"))


def words_of(template: Template, values: dict[str, float]) -> dict[str, str]:
    """Return the words of the files: keys and what is derived from them."""
    numbers = complete(template, values)
    place = f"{template.name}/template.toml"
    for name, text in template.table.get("derived", {}).items():
        check_expression(text, list(numbers), place)
        value = evaluate(text, numbers)
        numbers[name] = int(value) if WHOLE.fullmatch(text) else value
    return {name: shown(value) for name, value in numbers.items()}


def filled(text: str, words: dict[str, str]) -> str:
    """Return the text with its words in braces replaced."""
    return WORD.sub(lambda found: words[found[1]], text)


def run_lines(template: Template, words: dict[str, str], folder: Path) -> list[str]:
    """Return the commands that run the decks and draw the figures."""
    lines = []
    for line in template.table["decks"]:
        program = "" if line.startswith(BETWEEN) else f"{program_of(folder / line.split()[0])} "
        lines.append(f"{program}{filled(line, words)}")
    return lines + [f"talus {filled(line, words)}" for line in template.table["look"]]


def table_of(template: Template, words: dict[str, str]) -> str:
    """Return the README's table of keys and their values."""
    rows = ["| key | value | what |", "|---|---|---|"]
    for name, key in template.keys.items():
        unit = f" {key['unit']}" if key.get("unit") else ""
        rows.append(f"| `{name}` | {words[name]}{unit} | {key['text']} |")
    return "\n".join(rows)


def readme(template: Template, words: dict[str, str], folder: Path) -> str:
    """Return the README: what it is, how it is run, which keys to change first."""
    head = filled((template.folder / "README.md").read_text("utf-8"), words)
    commands = "\n".join(run_lines(template, words, folder))
    made = "\n".join(f"talus {filled(line, words)}" for line in template.table["prepare"])
    return "\n\n".join([
        head.rstrip(),
        "## Run", "`sh run.sh` does all of this:", f"```\n{commands}\n```",
        "## How it was made", f"With `talus new {template.name}` and these values:",
        table_of(template, words),
        "Packings and meshes, to be made again where their sizes change:", f"```\n{made}\n```\n",
    ])  # fmt: skip


def prepare(template: Template, words: dict[str, str], folder: Path) -> None:
    """Run the commands of `talus` that write packings and meshes into the folder."""
    from talus.cli import build_parser

    for line in template.table["prepare"]:
        options = build_parser().parse_args(shlex.split(filled(line, words)))
        for name in ("output", "source", "join"):
            if getattr(options, name, None):
                setattr(options, name, folder / getattr(options, name))
        with contextlib.redirect_stdout(io.StringIO()):
            options.run(options)


def write(template: Template, values: dict[str, float], folder: Path) -> None:
    """Write decks, packings, run.sh and README of a template into a folder that is empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FaultError("E632", f"{folder} is there and not empty", "name another with -o")
    make_folder(folder)
    words = words_of(template, values)
    for path in sorted(template.folder.iterdir()):
        text = path.read_text("utf-8") if path.suffix in FILLED + COPIED else ""
        if path.suffix in FILLED and path.name != "template.toml":
            write_text_file(folder / path.name, filled(text, words))
        elif path.suffix in COPIED:
            write_text_file(folder / path.name, text)
    prepare(template, words, folder)
    lines = [
        f'"$bin"{line}' if not line.startswith("talus ") else f'"${{TALUS:-talus}}"{line[5:]}'
        for line in run_lines(template, words, folder)
    ]
    title = template.table["title"]
    write_text_file(folder / "run.sh", RUN.format(title=title, lines="\n".join(lines)))
    write_text_file(folder / "README.md", readme(template, words, folder))
