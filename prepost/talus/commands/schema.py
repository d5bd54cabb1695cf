"""`talus schema`: JSON Schemas of the decks, and files for Vim and VS Code."""

import argparse
import json
from pathlib import Path

from talus import deck_json, editor_files
from talus.faults import FaultError


def register(commands: argparse._SubParsersAction) -> None:
    """Add `schema`."""
    new = commands.add_parser("schema", help="JSON Schema of decks, files for Vim and VS Code")
    new.add_argument("kind", choices=list(editor_files.MAKERS))
    new.add_argument("-o", "--output", metavar="FOLDER", type=Path, default=Path("."))
    new.add_argument("--deck", type=Path, help="json: print this deck as JSON, no more")
    new.set_defaults(run=work)


def work(options: argparse.Namespace) -> int:
    """Write the files and print their names, or a deck as JSON."""
    if options.deck:
        try:
            text = options.deck.read_text("utf-8")
        except (OSError, UnicodeDecodeError) as fault:
            raise FaultError("E531", f"cannot read {options.deck}: {fault}") from fault
        print(json.dumps(deck_json.deck_as_json(text), indent=1, ensure_ascii=False))
        return 0
    for path in editor_files.write(options.kind, options.output):
        print(path)
    return 0
