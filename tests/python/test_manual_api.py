"""The reference of the Python package: every public name, as the interpreter sees it."""

import html
import importlib
import inspect
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import manual_api  # noqa: E402
import manual_search  # noqa: E402

import manual  # noqa: E402

PAGE = manual.page_html(manual_api.page())
IDS = set(re.findall(r'id="([^"]+)"', PAGE))


@pytest.mark.parametrize("name", ["talus.packing", "talus.measure", "talus.fields", "talus.port",
                                  "talus.study.plans", "talus.verification"])  # fmt: skip
def test_all_that_the_interpreter_sees(name: str) -> None:
    """Functions and classes that a module defines have a section with their first words."""
    module = importlib.import_module(name)
    own = [thing for _, thing in inspect.getmembers(module)
           if (inspect.isfunction(thing) or inspect.isclass(thing))
           and thing.__module__ == name and not thing.__name__.startswith("_")]  # fmt: skip
    assert own
    for thing in own:
        anchor = f"{name}.{thing.__name__}"
        assert anchor in IDS
        section = PAGE.split(f'id="{anchor}"')[1].split("<h4")[0]
        first = inspect.getdoc(thing).split("\n")[0].replace("`", "")
        assert first[:40] in html.unescape(re.sub(r"<[^>]+>", "", section))


def test_signature() -> None:
    """Arguments stand with type and default, results behind an arrow, fields with their comment."""
    text = manual_search.plain(PAGE.split('id="talus.measure.gaps"')[1].split("<h4")[0])
    assert "gaps(packing: Packing, pairs: np.ndarray, sweeps: int=60) -> tuple[" in text
    case = PAGE.split('id="talus.verification.Case"')[1].split("<h4")[0]
    assert "class Case" in case and "of every run of talus-dem that sets none itself" in case
    assert "below(self, name: str, value: float, limit: float" in case


def test_every_module_has_one_place() -> None:
    """Each module of the package stands under one topic; the command line is on another page."""
    modules = list(manual_api.modules())
    placed = [name for names in manual_api.by_topics(modules).values() for name in names]
    assert sorted(placed) == sorted(modules) and "talus.study.plans" in placed
    assert "talus.commands.pack" not in placed
    stems = {name.split(".")[1] for name in modules if "." in name}
    assert {stem for topic in manual_api.TOPICS.values() for stem in topic} <= stems


def test_in_the_search() -> None:
    """The search of the manual has an entry for each function."""
    entries = {anchor: text for anchor, _, text in manual_search.entries("api", PAGE)}
    assert "support functions of both" in entries["talus.measure.gaps"]


def test_docstrings_are_text() -> None:
    """Marks of HTML, formulas and Markdown in a docstring stay as they are written."""
    text = "Files *_a_*.csv of `x < 1`, $2.\n\n    A table   of\n    two lines"
    body = manual.page_html(manual_api.text_html(text))
    assert "Files *_a_*.csv of <code>x &lt; 1</code>, &#36;2." in body
    assert "<pre>    A table   of&#10;    two lines</pre>" in body
