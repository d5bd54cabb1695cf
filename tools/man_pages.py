"""Write the man pages of the programs and of `talus`, from what each says with --help.

Usage: man_pages.py FOLDER BIN; the package `talus` must be importable.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

from talus import version
from talus.cli import build_parser

ABOUT = {
    "talus-dem": "grains: discrete elements in contact",
    "talus-fem": "solids: finite elements",
    "talus-couple": "grains and solid together",
}
EXIT = {
    0: "finished",
    1: "input faults, all of them listed; nothing was run",
    2: "numerical failure; the last good checkpoint is kept",
    3: "stopped early on request with a checkpoint; --restart=auto goes on",
    4: "system failure: file, memory, disk, or a partner",
    5: "a bug of Talus",
}


def escaped(text: str) -> str:
    """Return text as roff reads it."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.M)


def page(name: str, about: str, sections: dict[str, str]) -> str:
    """Return a man page; the text of a section is roff already."""
    head = f'.TH {name.upper()} 1 "" "Talus {version()}" "Talus"\n'
    names = ", ".join([*ABOUT, "talus"])
    sections = {
        "NAME": f"{escaped(name)} \\- {escaped(about)}", **sections,
        "SEE ALSO": escaped(names) + "(1)",
    }  # fmt: skip
    return head + "".join(f".SH {title}\n{text.strip()}\n" for title, text in sections.items())


def literal(text: str) -> str:
    """Return text that keeps its lines."""
    return f".nf\n{escaped(text.rstrip())}\n.fi"


def of_program(program: Path) -> str:
    """Return the page of a solver."""
    said = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    usage, _, options = said.partition("\n\n")
    options = options.split("\nexit codes")[0]
    codes = "".join(f".TP\n.B {code}\n{escaped(text)}\n" for code, text in EXIT.items())
    files = (
        "deck.log, deck_summary.json, deck_*.csv, deck.h5, deck.xdmf, deck.chk.h5 beside the deck"
    )
    return page(program.name, ABOUT[program.name], {
        "SYNOPSIS": literal(usage.removeprefix("usage: ").replace("\n       ", "\n")),
        "DESCRIPTION": escaped("A deck of namelist groups is the whole input: --keys prints the "
                               "groups and keys, `talus explain NAME` explains one."),
        "OPTIONS": literal(options), "EXIT STATUS": codes, "FILES": escaped(files),
    })  # fmt: skip


def of_talus() -> str:
    """Return the page of the command `talus`, its sub-commands with their usage."""
    parser = build_parser()
    action = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    text = ""
    for choice in action._choices_actions:
        usage = " ".join(action.choices[choice.dest].format_usage().split()).removeprefix("usage: ")
        text += f".TP\n.B {escaped(choice.dest)}\n{escaped(choice.help)}\n.br\n{escaped(usage)}\n"
    return page("talus", "prepare and evaluate Talus runs", {
        "SYNOPSIS": escaped("talus COMMAND [OPTIONS]; talus COMMAND --help says more"),
        "COMMANDS": text,
    })  # fmt: skip


def main() -> int:
    """Write all pages."""
    folder, programs = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name in ABOUT:
        (folder / f"{name}.1").write_text(of_program(programs / name))
    (folder / "talus.1").write_text(of_talus())
    return 0


if __name__ == "__main__":
    sys.exit(main())
