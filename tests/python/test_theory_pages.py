"""Notation, differences, choosing: labels, files, cases and anchors that they name exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANUAL = ROOT / "manual"
PAGES = ["theory-notation.md", "theory-differences.md", "choosing.md"]
NUMBERS = 49  # equations of the chapter


def slug(head: str) -> str:
    """Return the anchor that the manual gives a heading."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", head).strip().lower())


@pytest.mark.parametrize("name", PAGES)
def test_links(name: str) -> None:
    """Each link leads to a file of the tree and to a heading of it."""
    for target in re.findall(r"\]\(([^)]+)\)", (MANUAL / name).read_text()):
        file, _, anchor = target.partition("#")
        if file in ("verification.md", "errors.md"):  # made by `make manual`
            continue
        text = (MANUAL / file).read_text()
        assert not anchor or anchor in map(slug, re.findall(r"^#+ (.+)$", text, flags=re.M)), target


@pytest.mark.parametrize("name", PAGES)
def test_names(name: str) -> None:
    """Labels stand at an equation, sources are there, cases have a folder."""
    text = (MANUAL / name).read_text()
    labels = "".join(p.read_text() for p in MANUAL.glob("theory-*.md"))
    for label in re.findall(r"\b[DFC]\.\d+\b", text):
        assert f"{{{label}}}" in labels, label
    for place in re.findall(r"`((?:dem|fem|couple)/[^`]+)`", text):
        assert (ROOT / place).exists(), place
    cases = {path.parent.name for path in ROOT.glob("verification/*/*/case.toml")}
    for words in re.findall(r"cases? ((?:\*\w+\*(?:, )?)+)", text):
        assert all(any(c.startswith(w) for c in cases) for w in re.findall(r"\*(\w+)\*", words))


def test_numbers() -> None:
    """Every equation of the chapter has a row, or is named among those that have none."""
    text = (MANUAL / "theory-notation.md").read_text()
    named = set()
    for first, last in re.findall(r"\((\d+)\)(?:(?:–| to )\((\d+)\))?", text):
        named |= set(range(int(first), int(last or first) + 1))
    assert named >= set(range(1, NUMBERS + 1)), sorted(set(range(1, NUMBERS + 1)) - named)


def test_sources() -> None:
    """Every part of the page on choosing that has a number names where it comes from."""
    for part in re.split(r"\n(?=## )", (MANUAL / "choosing.md").read_text())[1:]:
        for block in part.split("\n\n")[1:]:
            if re.search(r"\d\.\d", block) and not block.startswith("| half-width"):
                assert "](" in block or "case" in block, block[:120]
