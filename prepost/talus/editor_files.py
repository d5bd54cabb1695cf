"""Files for editors, made from the deck.toml tables: JSON Schemas, Vim and VS Code.

`python -m talus.editor_files FOLDER` writes all of them; it needs the standard library alone.
"""

import json
import sys
from pathlib import Path

from talus import reference, schema, version
from talus.files import make_folder, write_text_file

HERE = Path(__file__).parent / "editors"
VIM = """" Syntax of the decks of Talus {version}, made from its deck.toml files.
if exists('b:current_syntax') | finish | endif
syntax case ignore
syntax match talusComment /!.*/
syntax region talusString start=/'/ end=/'/ oneline
syntax region talusString start=/"/ end=/"/ oneline
syntax match talusNumber /[+-]\\=\\<\\d\\+\\(\\.\\d*\\)\\=\\([eEdD][+-]\\=\\d\\+\\)\\=\\>/
syntax match talusLogical /\\.\\(true\\|false\\)\\./
{groups}
highlight default link talusComment Comment
highlight default link talusString String
highlight default link talusNumber Number
highlight default link talusLogical Boolean
highlight default link talusGroup Statement
highlight default link talusKey Identifier
highlight default link talusUnknown Error
let b:current_syntax = 'talus'
"""
VIM_GROUP = """syntax region talusIn_{name} matchgroup=talusGroup \
start=/^\\s*&{name}\\>/ end=/\\// keepend extend \
contains=talusComment,talusString,talusNumber,talusLogical,talusKey_{name},talusUnknown
syntax match talusKey_{name} /\\<\\({keys}\\)\\>\\ze\\s*=/ contained
highlight default link talusKey_{name} talusKey"""


def texts() -> dict[str, str]:
    """Return the hover text of every group and of every group.key, of all programs."""
    found: dict[str, dict[str, list[str]]] = {}
    for group in reference.groups():
        doc = " ".join(group.table.get("doc", "").split())
        entries = {group.name: doc}
        entries |= {f"{group.name}.{n}": schema.hover(k) for n, k in group.table["keys"].items()}
        for name, text in entries.items():
            found.setdefault(name, {}).setdefault(text, []).append(group.program)
    return {
        name: "\n".join(
            text if len(many) == 1 else f"{', '.join(programs)}: {text}"
            for text, programs in many.items()
        )
        for name, many in sorted(found.items())
    }


def keys_by_group() -> dict[str, list[str]]:
    """Return the keys of every group over all programs."""
    found: dict[str, set] = {}
    for group in reference.groups():
        found.setdefault(group.name, set()).update(group.table["keys"])
    return {name: sorted(keys) for name, keys in sorted(found.items())}


def vim_files() -> dict[str, str]:
    """Return the files of Vim: syntax, detection, and keys with their text."""
    parts = ["syntax match talusUnknown /\\<\\h\\w*\\>\\ze\\s*=/ contained"]
    for name, keys in keys_by_group().items():
        parts.append(VIM_GROUP.format(name=name, keys="\\|".join(keys)))
    return {
        "syntax/talus.vim": VIM.format(version=version(), groups="\n".join(parts)),
        "ftdetect/talus.vim": (HERE / "ftdetect.vim").read_text("utf-8"),
        "ftplugin/talus.vim": (HERE / "ftplugin.vim").read_text("utf-8"),
        "ftplugin/talus_keys.json": as_json(texts()),
    }


def grammar() -> dict:
    """Return the TextMate grammar: each group with its own keys; others are marked as wrong."""
    common = [
        {"name": "comment.line.talus", "match": "!.*$"},
        {"name": "string.quoted.talus", "match": "'[^'\n]*'|\"[^\"\n]*\""},
        {"name": "constant.language.talus", "match": "(?i)\\.(true|false)\\."},
        {"name": "constant.numeric.talus", "match": "[+-]?\\b\\d+(\\.\\d*)?([eEdD][+-]?\\d+)?"},
    ]
    groups = [
        {
            "begin": f"(?i)^\\s*(&{name})\\b", "end": "/",
            "beginCaptures": {"1": {"name": "keyword.control.talus"}},
            "patterns": [
                *common,
                {
                    "name": "variable.parameter.talus",
                    "match": f"(?i)\\b({'|'.join(keys)})\\b(?=\\s*=)",
                },
                {"name": "invalid.illegal.talus", "match": "\\b[A-Za-z_]\\w*(?=\\s*=)"},
            ],
        }
        for name, keys in keys_by_group().items()
    ]  # fmt: skip
    return {"scopeName": "source.talus-deck", "patterns": [common[0], *groups]}


def vscode_files() -> dict[str, str]:
    """Return the files of an extension of VS Code."""
    language = {
        "id": "talus-deck", "aliases": ["Talus deck"], "extensions": [".nml"],
        "configuration": "./language-configuration.json",
    }  # fmt: skip
    rules = {"language": "talus-deck", "scopeName": "source.talus-deck",
             "path": "./talus.tmLanguage.json"}  # fmt: skip
    package = {
        "name": "talus-deck", "displayName": "Decks of Talus", "version": version(),
        "publisher": "talus", "engines": {"vscode": "^1.60.0"}, "main": "./extension.js",
        "activationEvents": ["onLanguage:talus-deck"],
        "contributes": {"languages": [language], "grammars": [rules]},
    }  # fmt: skip
    return {
        "package.json": as_json(package),
        "language-configuration.json": as_json({"comments": {"lineComment": "!"}}),
        "talus.tmLanguage.json": as_json(grammar()),
        "keys.json": as_json(texts()),
        "extension.js": (HERE / "extension.js").read_text("utf-8"),
    }


def json_files() -> dict[str, str]:
    """Return the JSON Schema of each program."""
    return {f"{name}.schema.json": as_json(schema.of_program(name)) for name in schema.PROGRAMS}


def as_json(value: object) -> str:
    """Return JSON text."""
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


MAKERS = {"json": json_files, "vim": vim_files, "vscode": vscode_files}


def write(kind: str, folder: Path) -> list[Path]:
    """Write the files of a kind into a folder; E635 without the tables of the sources."""
    schema.check_tables()
    paths = []
    for name, text in MAKERS[kind]().items():
        make_folder((folder / name).parent)
        write_text_file(folder / name, text)
        paths.append(folder / name)
    return paths


if __name__ == "__main__":
    for one in MAKERS:
        write(one, Path(sys.argv[1]) / one)
