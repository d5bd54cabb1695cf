"""Change decks: numbers, words, keys, groups and characters of decks that run.

Usage: decks.py [--bin build/bin] [--long] [--seed N] [--count N] [--only RUN ...] [--keep DIR]
A program that gets such a deck runs to its end with finite results, or refuses it: exit code 1, 2
or 4, a message with a code and a place. One that has more to do than a few seconds is told to stop
and must end with exit code 3 at once. Memory is limited, so that a deck cannot take the machine's.
"""

import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import inputs
import numpy as np
from fuzzing import (
    CODE,
    CRASH,
    FAST,
    GOOD,
    MEMORY,
    REFUSALS,
    ROOT,
    Run,
    Tally,
    baseline,
    environment,
    is_sanitized,
    not_finite,
    numbers,
    options,
    results,
)

sys.path.insert(0, str(ROOT / "tools"))

import deck_definitions as definitions  # noqa: E402

RUNS = {  # name: decks that are changed, the program that reads each
    "bed": {"deck.nml": "dem"},
    "tools": {"deck.nml": "dem"},
    "cell": {"deck.nml": "dem"},
    "feed": {"deck.nml": "dem"},
    "elastic": {"deck.nml": "fem"},
    "plastic": {"deck.nml": "fem"},
    "stages": {"deck.nml": "fem"},
    "coupled": {"deck.nml": "couple", "grains.nml": "dem", "solid.nml": "fem"},
    "overlap": {"deck.nml": "couple", "grains.nml": "dem", "solid.nml": "fem"},
    "opened": {"deck.nml": "couple", "grains.nml": "dem"},
}
SHORT, LONG = 8, 1500  # changed decks of each run
ENOUGH, LEAVE = 2.0, 20.0  # [s] until it is told to stop, then until it must have ended
PLACE = re.compile(r"^ +at \S", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w'.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w'])")
STRING = re.compile(r"'[^'\n]*'")
GROUP = re.compile(r"&(\w+)([^/]*)/")
ENTRY = re.compile(
    r",?\s*(\w+)\s*=\s*((?:'[^']*'|[^='/,]+)(?:\s*,\s*(?:'[^']*'|[^='/,]+)(?!\w*\s*=))*)"
)
EXTREMES = ["0", "-1", "1", "2", "1e300", "-1e300", "1e-300", "1e15", "1e-15", "1e49", "nan", "inf"]
EXTREMES += [
    "2147483647",
    "-2147483648",
    "99999999999",
    "0.0",
    "-0.0",
    "1.0",
    "1e5",
    "1d3",
    "3*0.0",
]
NAMES = ["quartz", "soil", "floor", "tool", "pusher", "low", "all", "z0", "z1", "ramp", "none", ""]
NAMES += ["inner", "layer", "x", "y", "z", "xx", "zz", "packing.h5", "block.h5", "tool.stl", "a/b"]
CHARACTERS = list("&/=,'!\n\t .*()@\\\"") + ["\x00", "é", "'", "/", "&run", "\r\n", "e", "-"]


def programs() -> dict[str, definitions.Program]:
    """Return the groups and keys of all programs."""
    faults = definitions.Faults()
    common = definitions.load(ROOT / "common/deck.toml", faults)
    found = {f: definitions.read_program(f, common, faults) for f in definitions.PROGRAMS}
    return {folder: program for folder, program in found.items() if program}


def number(key: definitions.Key, dice: random.Random) -> str:
    """Return a number for a key: mostly within its bounds, at times an extreme one."""
    if dice.random() < 0.15:
        return dice.choice(EXTREMES)
    if key.default and dice.random() < 0.3:
        value = dice.choice(key.default)
        return f"'{value}'" if isinstance(value, str) else repr(value)
    low = max(key.bounds.get("min", 0.0), key.bounds.get("above", 0.0))
    high = min(key.bounds.get("max", 1e9), key.bounds.get("below", 1e9))
    if key.kind == "integer":
        return str(min(int(high), int(low) + dice.choice([0, 1, 2, 3, 10, 100, 5000])))
    if high < 1e3:
        return repr(dice.uniform(low, high))
    return f"{dice.choice([1, 1, 1, -1]) * 10 ** dice.uniform(-7, 9):.4e}"


def value(key: definitions.Key, dice: random.Random) -> str:
    """Return the text of some value or values of a key."""
    many = key.least if key.most == key.least else min(key.most, key.least + dice.randrange(3))
    if dice.random() < 0.05:
        many += dice.choice([-1, 1])
    found = []
    for _ in range(many):
        if key.kind in ("real", "integer"):
            found.append(number(key, dice))
        elif key.kind == "logical":
            found.append(dice.choice([".true.", ".false."]))
        else:
            found.append(f"'{dice.choice(key.choices or NAMES)}'")
    return ", ".join(found)


def group(known: definitions.Group, dice: random.Random) -> str:
    """Return a group with its required keys and some others."""
    chosen = [key for key in known.keys if key.required or dice.random() < 0.3]
    for names in known.one_of:
        name = dice.choice(names)
        chosen += [key for key in known.keys if key.name == name and key not in chosen]
    return f"&{known.name} " + ", ".join(f"{k.name} = {value(k, dice)}" for k in chosen) + " /\n"


def pick(pattern: re.Pattern, text: str, dice: random.Random) -> re.Match | None:
    """Return one of the places that a pattern has in a text, if there is any left."""
    found = list(pattern.finditer(text))
    return dice.choice(found) if found else None


def change_number(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Put another number in place of one: an extreme one, or one some decades away."""
    one = pick(NUMBER, text, dice)
    if not one:
        return text
    new = dice.choice(EXTREMES)
    if dice.random() < 0.5:
        new = repr(float(one.group(0)) * 10.0 ** dice.choice([-9, -3, -2, -1, 1, 2, 3, 9]))
    return text[: one.start()] + new + text[one.end() :]


def change_string(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Put another string in place of one: a choice of any key, a name, or one with a slip."""
    one = pick(STRING, text, dice)
    if not one:
        return text
    choices = [c for g in program.groups for k in g.keys for c in k.choices]
    old = one.group(0)[1:-1]
    slip = old[:-1] + dice.choice("aeiou_")
    new = dice.choice([dice.choice(choices), dice.choice(NAMES), slip])
    return text[: one.start()] + f"'{new}'" + text[one.end() :]


def insert_key(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Give a group of the deck one more key."""
    one = pick(GROUP, text, dice)
    if not one:
        return text
    known = next((g for g in program.groups if g.name == one.group(1)), None)
    if not known:
        return text
    key = dice.choice(known.keys)
    comma = ", " if "=" in one.group(2) else " "
    return (
        text[: one.end() - 1] + f"{comma}{key.name} = {value(key, dice)} " + text[one.end() - 1 :]
    )


def insert_group(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Add a group, at times one that is there already."""
    return text + "\n" + group(dice.choice(program.groups), dice)


def remove(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Take out a key or a group, or say it twice."""
    one = pick(dice.choice([GROUP, ENTRY]), text, dice)
    if not one:
        return text
    if dice.random() < 0.3:
        return text[: one.end()] + one.group(0) + text[one.end() :]
    return text[: one.start()] + text[one.end() :]


def change_text(text: str, program: definitions.Program, dice: random.Random) -> str:
    """Take out, double or replace characters, or cut the end off."""
    place = dice.randrange(len(text))
    what = dice.randrange(4)
    if what == 0:
        return text[:place]
    length = dice.choice([1, 1, 1, 5, 40])
    middle = ["", 2 * text[place : place + length], dice.choice(CHARACTERS)][what - 1]
    return text[:place] + middle + text[place + length :]


CHANGES = [change_number] * 4 + [change_string, insert_key, insert_key, insert_key]
CHANGES += [insert_group, insert_group, remove, change_text]


def limit_memory() -> None:
    """Let the program that is started have no more memory than MEMORY.

    A sanitizer reserves address space beyond all limits and has one of its own (environment).
    """
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def call(command: list[str], folder: Path) -> tuple[int | None, str]:
    """Run a command; one that takes long is stopped. Return exit code (None: it hangs), output."""
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment() | {"OMP_THREAD_LIMIT": "4"},
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            preexec_fn=None if is_sanitized(Path(command[0])) else limit_memory,
        )
        try:
            code = process.wait(ENOUGH)
        except subprocess.TimeoutExpired:
            process.terminate()
            try:
                code = process.wait(LEAVE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return None, ""
    return code, (folder / "said").read_text(errors="replace")


def bad_fields(folder: Path, old: set[str]) -> str:
    """First dataset of a file of results that holds NaN or infinity."""
    for path in folder.rglob("*.h5"):
        if str(path.relative_to(folder)) in old:
            continue
        try:
            for name, values in numbers(path):
                if values.dtype.kind == "f" and not np.all(np.isfinite(values)):
                    return f"{path.name}:{name}"
        except (OSError, RuntimeError, KeyError, ValueError):
            return f"{path.name}: unreadable"
    return ""


def verdict(run: Run, folder: Path) -> str:
    """Run a changed deck: changed, refused, stopped or a failure."""
    code, said = call(run.command, folder)
    if code is None:
        return f"hang: does not end {LEAVE:g} s after it is told to"
    crash = CRASH.search(said.replace("SIGTERM", ""))
    if code < 0 or code >= 128 or crash:
        return f"crash: exit {code}, {crash.group(0)[:90] if crash else said[-200:]!r}"
    if code in REFUSALS:
        if not CODE.search(said):
            return f"unclear: exit {code}, {said[-200:]!r}"
        if not PLACE.search(said):
            return f"no place: {CODE.search(said).group(0)} {said[-200:]!r}"
        return "refused"
    if code not in (0, 3):
        return f"unclear: exit {code}, {said[-200:]!r}"
    bad = not_finite(results(folder, run.inputs), run.results) or bad_fields(folder, run.inputs)
    return f"not finite: {bad}" if bad else "changed" if code == 0 else "stopped"


def trial(run: Run, decks: dict[str, str], known: dict, dice: random.Random, keep: Path) -> str:
    """Change a deck of a fresh copy, once or twice, and run it."""
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as name:
        folder = Path(name) / "run"
        shutil.copytree(run.folder, folder)
        deck = dice.choice(list(decks))
        text = (folder / deck).read_text()
        for _ in range(dice.choice([1, 1, 2])):
            text = dice.choice(CHANGES)(text, known[decks[deck]], dice) or "!"
        (folder / deck).write_text(text)
        found = verdict(run, folder)
        if keep and found.split(":")[0] not in GOOD:
            place = keep / f"{run.name}_{len(list(keep.glob('*'))):03d}"
            shutil.copytree(folder, place, ignore_dangling_symlinks=True)
            (place / "command").write_text(" ".join(run.command) + f"\n{found}\n")
        return found


def main() -> int:
    """Run the campaign."""
    found = options(__doc__)
    tally = Tally()
    known = programs()
    with tempfile.TemporaryDirectory(prefix="talus_fuzz_", dir=FAST) as scratch:
        for name, decks in RUNS.items():
            if found.only and not any(word in name for word in found.only):
                continue
            run = baseline(inputs.make(name, Path(scratch), found.bin))
            for count in range(found.count or (LONG if found.long else SHORT)):
                dice = random.Random(f"{found.seed} {name} {count}")
                what = trial(run, decks, known, dice, found.keep)
                tally.add(what, f"{name}, {count}, seed {found.seed}")
    return tally.close()


if __name__ == "__main__":
    sys.exit(main())
