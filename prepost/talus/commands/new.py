"""`talus new`: a folder of decks from a template, ready to run."""

import argparse
import sys
from pathlib import Path

from talus import templates
from talus.faults import FaultError
from talus.templates import Template


def register(commands: argparse._SubParsersAction) -> None:
    """Add `new`."""
    new = commands.add_parser("new", help="a folder of decks from a template, ready to run")
    new.add_argument("kind", choices=templates.kinds(), help="see below")
    new.formatter_class = argparse.RawDescriptionHelpFormatter
    new.epilog = "\n".join(f"  {kind:12s} {templates.load(kind).table['title']}"
                           for kind in templates.kinds())
    new.add_argument("-o", "--output", metavar="FOLDER", type=Path,
                     help="new or empty (default: the name of the kind)")  # fmt: skip
    new.add_argument("--set", metavar="KEY=VALUE", nargs="+", action="extend", default=[])
    new.add_argument("--small", action="store_true", help="the small form: a run of seconds")
    new.add_argument("--keys", action="store_true", help="list the keys of the template, no more")
    new.set_defaults(run=work)


def asked(template: Template, values: dict[str, float], given: list[str]) -> dict[str, float]:
    """Return the values with the answers to the few questions; an empty answer keeps a value."""
    named = {item.partition("=")[0] for item in given}
    for name, key in template.keys.items():
        if not key.get("ask") or name in named:
            continue
        unit = f" {key['unit']}" if key.get("unit") else ""
        while answer := input(f"{key['text']} ({name}) [{values[name]:g}{unit}]: ").strip():
            try:
                values[name] = templates.number_of(name, key, answer)
                break
            except FaultError as fault:
                print(fault, file=sys.stderr)
    return values


def work(options: argparse.Namespace) -> int:
    """Write the folder; say what to do there."""
    template = templates.load(options.kind)
    values = templates.settings(template, options.set, options.small)
    if options.keys:
        print(templates.table_of(template, templates.words_of(template, values)))
        return 0
    folder = options.output or Path(template.name)
    if sys.stdin.isatty() and sys.stdout.isatty():
        values = asked(template, values, options.set)
    templates.write(template, values, folder)
    print(f"{folder}: {template.table['title']}")
    print(f"next: sh {folder}/run.sh; {folder}/README.md says what to change")
    return 0
