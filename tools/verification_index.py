"""The cases by feature: which case uses which group, key and choice of the decks, or which tool.

What a case uses is read from its decks, from the decks in its `exact.py` and in the modules of its
area that this imports, and from the decks of examples that it names. Choices that `exact.py` puts
into a deck count where the key stands in that deck. What is no key of a deck (checkpoints, ranks,
modules of the Python package) follows from `exact.py`; `features` in case.toml adds what does not.
"""

import io
import re
import sys
import tokenize
from collections import defaultdict

from verification_table import ROOT, VALIDATION, all_cases

sys.path.insert(0, str(ROOT / "prepost"))

from talus import reference  # noqa: E402

GROUP = re.compile(r"&([a-z]\w*)\b((?:'[^'\n]*'|[^/'])*)", flags=re.I)
KEY = re.compile(r"\b(\w+)\s*=\s*((?:'[^'\n]*'|[^,\s'])*)")
GAP = re.compile(r"(?:^|[^=\s])\s*[@{]\w+[@}]")  # of a deck, that exact.py fills with keys
# modules that are no feature of a case
COMMON = ("look", "verification", "faults", "files", "compare", "orders")
MANY = 12  # cases of a key that most cases use are counted and not named
#: what `exact.py` says that is no key of a deck
OTHER = {
    "checkpoint and restart": r"--restart",
    "several ranks": r"\branks=|mpirun",
    "several threads": r"--threads=[2-9]",
    "weights of an overlap without solvers (`--weights`)": r"--weights",
    "a material point (`talus-fem --point`)": r"--point",
    "checks of a deck (`--check`)": r"--check",
}

Uses = dict[tuple[str, str, str, str], set[str]]  # program, group, key, choice -> ids of cases


def sources(facts: dict) -> tuple[list[tuple[str, str]], str]:
    """Return the decks of a case as (program, text), and the Python that belongs to it."""
    folder = facts["folder"]
    texts = [(folder / "exact.py").read_text(encoding="utf-8")]
    for name in re.findall(r"^(?:import|from) (\w+)", texts[0], flags=re.M):
        beside = folder.parent / f"{name}.py"
        texts += [beside.read_text(encoding="utf-8")] if beside.exists() else []
    python = "\n".join(texts)
    decks = sorted(folder.rglob("*.nml"))
    for example in re.findall(r"examples/(\d\d-[\w-]+)", texts[0]):
        decks += sorted((ROOT / "examples" / example).glob("*.nml"))
    named = [(program_of(text), text) for text in (p.read_text("utf-8") for p in decks)]
    return named, python


def program_of(deck: str) -> str:
    """Return the program that a deck is for."""
    if re.search(r"^\s*&program\b", deck, flags=re.M):
        return "talus-couple"
    return "talus-fem" if re.search(r"^\s*&section\b", deck, flags=re.M) else "talus-dem"


def strings_of(python: str) -> str:
    """Return all strings of a text in Python, one below the other, with their quotes."""
    tokens = tokenize.generate_tokens(io.StringIO(python).readline)
    return "\n".join(token.string for token in tokens if token.type == tokenize.STRING)


def keys_of(text: str) -> list[tuple[str, str, str]]:
    """Return group, key and value as written of all keys in a text with decks."""
    plain = re.sub(r"(?m)!.*$", "", text)
    return [(group[1].lower(), key[1].lower(), key[2])
            for group in GROUP.finditer(plain) for key in KEY.finditer(group[2])]  # fmt: skip


def filled(text: str, strings: str) -> list[tuple[str, str, str]]:
    """Return group, key and value that strings of Python may put into the gaps of a deck."""
    groups = {group[1].lower() for group in GROUP.finditer(text) if GAP.search(group[2])}
    return [(group, key[1], key[2]) for group in groups for key in KEY.finditer(strings)]


def owner(area: str, group: str, key: str) -> str | None:
    """Return the program of a key that stands in Python; None where several could be meant."""
    programs = [g.program for g in reference.groups() if g.name == group and key in g.table["keys"]]
    if area in ("dem", "fem"):
        return f"talus-{area}" if f"talus-{area}" in programs else None
    return programs[0] if len(programs) == 1 else None


def choices_in(value: str, choices: list[str], strings: str) -> list[str]:
    """Return the choices that a value stands for: itself, or those that strings of Python have."""
    if value.strip("'") in choices:
        return [value.strip("'")]
    return [choice for choice in choices if re.search(rf"[\"'=]{re.escape(choice)}\b", strings)]


def key_uses(facts: list[dict]) -> Uses:
    """Return which cases use each key, and each choice, of the decks."""
    tables = {(g.program, g.name): g.table["keys"] for g in reference.groups()}
    found: Uses = defaultdict(set)
    for case in facts:
        decks, python = sources(case)
        strings = strings_of(python)
        given = [(program, *one) for program, text in decks
                 for one in keys_of(text) + filled(text, strings)]  # fmt: skip
        written = [(owner(case["area"], *one[:2]), *one)
                   for one in keys_of(strings) + filled(strings, strings)]  # fmt: skip
        for program, group, key, value in given + written:
            keys = tables.get((program or "", group), {})
            if key not in keys:
                continue
            found[program, group, "", ""].add(case["id"])
            found[program, group, key, ""].add(case["id"])
            for choice in choices_in(value, keys[key].get("choices", []), strings):
                found[program, group, key, choice].add(case["id"])
    return found


def other_uses(facts: list[dict]) -> dict[str, set[str]]:
    """Return which cases use what is no key of a deck."""
    found: dict[str, set[str]] = defaultdict(set)
    for case in facts:
        python = sources(case)[1]
        for name, sign in OTHER.items():
            if re.search(sign, python):
                found[name].add(case["id"])
        for module in re.findall(r"^from talus\.([\w.]+) import|^import talus\.([\w.]+)", python,
                                 flags=re.M):  # fmt: skip
            name = module[0] or module[1]
            if name not in COMMON:
                found[f"Python: `talus.{name}`"].add(case["id"])
        for name in case.get("features", []):
            found[name].add(case["id"])
    return found


def links(ids: set[str], areas: dict[str, str]) -> str:
    """Return links to cases; where there are many, their number alone."""
    if len(ids) > MANY:
        return f"{len(ids)} cases"
    pages = {name: "validation" if areas[name] == VALIDATION else "verification" for name in ids}
    return (
        ", ".join(f"[{name}]({pages[name]}.md#case-{name})" for name in sorted(ids)) or "none found"
    )


def program_lines(program: str, uses: Uses, areas: dict[str, str]) -> list[str]:
    """Return the tables of the groups of a program."""
    lines = [f"## {program}", ""]
    for group in (g for g in reference.groups() if g.program == program):
        lines += [f"### &{group.name} of {program}", "", "| key | cases |", "|---|---|"]
        for key, table in group.table["keys"].items():
            ids = uses.get((program, group.name, key, ""), set())
            lines.append(f"| `{key}` | {links(ids, areas)} |")
            for choice in table.get("choices", []):
                ids = uses.get((program, group.name, key, choice), set())
                lines.append(f"| `{key} = '{choice}'` | {links(ids, areas)} |")
        lines.append("")
    return lines


def page() -> str:
    """Return the index as a page of the manual in Markdown."""
    facts = all_cases()
    areas = {case["id"]: case["area"] for case in facts}
    uses, other = key_uses(facts), other_uses(facts)
    lines = ["# Index of cases by feature", "", " ".join(__doc__.split("\n\n")[1].split()), ""]
    lines += [f"Where more than {MANY} cases use a key their number is given. Where none is "
              "found all cases take the default, or `exact.py` sets the key by a text that it puts "
              "together.", ""]  # fmt: skip
    lines += ["## What is no key of a deck", "", "| feature | cases |", "|---|---|"]
    lines += [f"| {name} | {links(other[name], areas)} |" for name in sorted(other)]
    lines.append("")
    for program in dict.fromkeys(g.program for g in reference.groups()):
        lines += program_lines(program, uses, areas)
    return "\n".join(lines)
