"""Values of keys in the text of a deck: found and replaced, everything else kept as it is."""

import re
from dataclasses import dataclass

from talus.faults import FaultError
from talus.study.faults import nearest
from talus.study.parameters import Target

QUOTES = "'\""
NAME = re.compile(r"(\w+)\s*=")


@dataclass
class Entry:
    """A key of a group: its name and where its value stands in the text."""

    name: str
    first: int
    last: int


@dataclass
class Block:
    """A group of a deck: its name, its keys, where the slash that ends it stands."""

    name: str
    entries: list[Entry]
    end: int

    def find(self, name: str) -> Entry | None:
        """Return a key."""
        return next((entry for entry in self.entries if entry.name == name), None)


def masked(text: str) -> str:
    """Return the text, as long, with comments and all within quotes blanked out."""
    out, quote, comment = [], "", False
    for sign in text:
        if sign == "\n":
            comment = False
        elif comment:
            sign = " "
        elif quote:
            quote = "" if sign == quote else quote
            sign = " " if quote else sign
        elif sign in QUOTES:
            quote = sign
        elif sign == "!":
            comment, sign = True, " "
        out.append(sign)
    return "".join(out)


def read_blocks(text: str) -> list[Block]:
    """Return the groups of a deck."""
    bare, blocks = masked(text), []
    for start in re.finditer(r"^[ \t]*&(\w+)", bare, flags=re.M):
        end = bare.find("/", start.end())
        end = len(bare) if end < 0 else end
        heads = list(NAME.finditer(bare, start.end(), end))
        entries = []
        for k, head in enumerate(heads):
            stop = heads[k + 1].start() if k + 1 < len(heads) else end
            value = bare[head.end() : stop].rstrip(" \t\n,")
            first = head.end() + len(value) - len(value.lstrip())
            entries.append(Entry(head[1].lower(), first, head.end() + len(value)))
        blocks.append(Block(start[1].lower(), entries, end))
    return blocks


def words_of(text: str, entry: Entry) -> list[str]:
    """Return the values of a key as they stand in the deck."""
    bare = masked(text)[entry.first : entry.last]
    cuts = [-1, *(k for k, sign in enumerate(bare) if sign == ","), len(bare)]
    raw = text[entry.first : entry.last]
    return [raw[a + 1 : b].strip() for a, b in zip(cuts, cuts[1:], strict=False)]


def choose(text: str, target: Target) -> Block:
    """Return the group that a parameter means: the only one, by number or by one of its words."""
    blocks = [block for block in read_blocks(text) if block.name == target.group]
    if not blocks:
        names = dict.fromkeys(block.name for block in read_blocks(text))
        hint = nearest(target.group, names)
        raise FaultError("E589", f"{target.deck} has no group &{target.group}", hint)
    if target.which.isdigit():
        if not 1 <= int(target.which) <= len(blocks):
            raise FaultError("E589", f"{target.deck} has {len(blocks)} &{target.group}, "
                             f"not a number {target.which}")  # fmt: skip
        return blocks[int(target.which) - 1]
    if target.which:
        words = [w.strip() for w in target.which.split(",")]
        blocks = [block for block in blocks if fits(text, block, words)]
    if len(blocks) != 1:
        what = f" with '{target.which}'" if target.which else ""
        hint = f"by number, {target.group}[2].{target.key}, or by its words: {target.group}[word]"
        text = f"{target.deck} has {len(blocks) or 'no'} groups &{target.group}{what}"
        raise FaultError("E589", text, hint)
    return blocks[0]


def fits(text: str, block: Block, words: list[str]) -> bool:
    """Whether the values of one key are these words: between = 'quartz', 'steel'."""
    return any([w.strip(QUOTES) for w in words_of(text, e)] == words for e in block.entries)


def fortran(value: object, kind: str) -> str:
    """Return a value as a deck has it."""
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return repr(float(value)) if kind == "real" else repr(value)


def put(text: str, target: Target, value: object, kind: str) -> str:
    """Return the deck with the value in the place of the old one, or added to the group."""
    block, new = choose(text, target), fortran(value, kind)
    entry = block.find(target.key)
    if entry is None:
        if target.component:
            hint = "give it there, whole"
            raise FaultError("E589", f"{target.deck} does not give {target.key}", hint)
        comma = "," if block.entries else ""
        at = max([e.last for e in block.entries], default=block.end)
        tail = "" if block.entries else " "
        return f"{text[:at]}{comma} {target.key} = {new}{tail}{text[at:]}"
    if target.component:
        words = words_of(text, entry)
        if target.component > len(words):
            say = f"{target.key} has {len(words)} values in {target.deck}, not {target.component}"
            raise FaultError("E589", say)
        words[target.component - 1] = new
        new = ", ".join(words)
    return text[: entry.first] + new + text[entry.last :]
