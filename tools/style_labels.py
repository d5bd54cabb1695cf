"""Check labels of equations in the manual and what cites them.

A displayed equation ends with its label: `$$ ... $$ {D.12}` (D grains, F solids, C coupling). Code
and decks cite it as `eq. D.12`, a page as `theory-dem` or `manual/files.md`.
"""

import re
from pathlib import Path

DISPLAYED = re.compile(r"\$\$.+?\$\$(?: \{([A-Z]\.\d+)\})?", flags=re.S)
CITED = re.compile(r"\beqs?\. ([A-Z]\.\d+)(?:(?:, | and |-)([A-Z]\.\d+))*")
LABEL = re.compile(r"\b[A-Z]\.\d+")
PAGE = re.compile(r"\b(theory-[a-z]+)\b|\bmanual/([a-z-]+)\.md\b")
FOREIGN = re.compile(r"\bformulation(?:/| [A-Z]\d)")
CODE = ("common", "dem", "fem", "couple", "tests", "prepost", "verification", "tools", "examples")
KINDS = {".f90", ".c", ".h", ".py", ".toml", ".md"}
OWN = {"style_labels.py", "test_style.py"}  # breach the rules on purpose


def labels(root: Path) -> tuple[dict[str, str], list[str]]:
    """Return label -> page of all displayed equations, and breaches: no label or one twice."""
    known: dict[str, str] = {}
    found = []
    for path in sorted((root / "manual").glob("*.md")):
        text = path.read_text()
        for match in DISPLAYED.finditer(text):
            place = f"manual/{path.name}:{text.count(chr(10), 0, match.end()) + 1}"
            if match[1] is None:
                found.append(f"{place}: equation without label")
            elif match[1] in known:
                found.append(f"{place}: label {match[1]} is in {known[match[1]]} too")
            else:
                known[match[1]] = path.name
    return known, found


def citations(root: Path, known: dict[str, str]) -> list[str]:
    """Return breaches: labels that no equation has, pages that are not in the manual."""
    pages = {path.stem for path in (root / "manual").glob("*.md")}
    pages |= {"deck-dem", "deck-fem", "deck-couple", "verification", "errors"}  # generated
    found = []
    for path in sorted(p for folder in CODE for p in (root / folder).rglob("*.*")):
        if path.suffix not in KINDS or path.name in OWN:
            continue
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
            wrong = [
                f"no equation {label}"
                for match in CITED.finditer(line)
                for label in LABEL.findall(match[0])
                if label not in known
            ]
            names = [a or b for a, b in PAGE.findall(line)]
            wrong += [f"no page {name}" for name in names if name not in pages]
            wrong += ["cites what is not in the repository"] if FOREIGN.search(line) else []
            found += [f"{path.relative_to(root)}:{number}: {text}" for text in wrong]
    return found


def check(root: Path) -> list[str]:
    """Return all breaches as `file:line: rule`."""
    known, found = labels(root)
    return found + citations(root, known)
