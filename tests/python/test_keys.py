"""Definitions of deck keys: what tools/keys.py accepts, refuses and writes."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("talus_keys", ROOT / "tools/keys.py")
keys = importlib.util.module_from_spec(SPEC)
sys.modules["talus_keys"] = keys
SPEC.loader.exec_module(keys)

COMMON = {
    "run": {
        "doc": "What is run.",
        "required": True,
        "keys": {"t_end": {"type": "real", "unit": "s", "above": 0.0, "doc": "End."}},
    }
}


def faults_of(entry: dict) -> str:
    """Return what is said of the definition of one key."""
    faults = keys.Faults()
    keys.read_key("key", entry, "here", faults)
    return "\n".join(faults.lines)


def test_good_keys() -> None:
    """Definitions in every form are taken."""
    for entry in (
        {"type": "real", "doc": "x", "size": 3, "default": [0.0, 0, 1.5]},
        {"type": "real", "doc": "x", "words": {"full": -1.0}, "default": "full"},
        {"type": "integer", "doc": "x", "size": "n", "min": 1},
        {"type": "string", "doc": "x", "choices": ["a", "b"], "size": [1, 2], "default": "a"},
        {"type": "file", "doc": "x", "required": True},
        {"type": "logical", "doc": "x", "default": False},
    ):
        assert faults_of(entry) == ""


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"type": "float", "doc": "x"}, "type = 'float'"),
        ({"type": "real"}, "doc is missing"),
        ({"type": "real", "doc": "x", "defualt": 1.0}, "unknown word 'defualt'"),
        ({"type": "real", "doc": "x", "size": 0}, "size = 0"),
        ({"type": "real", "doc": "x", "default": 1.0, "above": 1.0}, "default 1.0 does not fit"),
        ({"type": "integer", "doc": "x", "default": 1.5}, "default 1.5 does not fit"),
        ({"type": "string", "doc": "x", "choices": ["a"], "default": "b"}, "default 'b'"),
        ({"type": "real", "doc": "x", "default": 1.0, "required": True}, "has no default"),
        ({"type": "real", "doc": "x", "min": 0.0, "above": 0.0}, "one of min and above"),
        ({"type": "string", "doc": "x", "min": 0.0}, "bounds are for numbers"),
        ({"type": "real", "doc": "x", "size": 3, "default": [1.0]}, "default has 1 values"),
    ],
)
def test_faulty_keys(entry: dict, said: str) -> None:
    """Each fault of a definition is named."""
    assert said in faults_of(entry)


def test_included_group_is_changed() -> None:
    """A program extends an included group and replaces a bound; the shared one stays."""
    change = {"keys": {"t_end": {"min": 0.0, "required": True}, "more": {"type": "real"}}}
    merged = keys.merge(COMMON["run"], change)
    assert merged["keys"]["t_end"] == {
        "type": "real",
        "unit": "s",
        "min": 0.0,
        "required": True,
        "doc": "End.",
    }
    assert list(merged["keys"]) == ["t_end", "more"]
    assert "above" in COMMON["run"]["keys"]["t_end"]


def test_fortran_lines_are_short() -> None:
    """Long texts are cut so that no line passes 100 columns, and nothing of them is lost."""
    doc = "It's " + "a long text with many words " * 20
    key = keys.Key("name", "string", doc.strip(), default=["x" * 150])
    group = keys.Group("group", doc.strip(), True, True, "", [key], False)
    text = keys.fortran(keys.Program("talus-dem", "dem", "", "", [group]))
    assert max(len(line) for line in text.splitlines()) <= 100
    assert re.sub(r"'\s*&\n\s*//'", "", text).count(doc.strip().replace("'", "''")) == 2


def test_committed_tables_are_up_to_date() -> None:
    """The key tables in the sources are those of the deck.toml files."""
    done = subprocess.run(
        [sys.executable, ROOT / "tools/keys.py", "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_reference_names_every_key(tmp_path: Path) -> None:
    """The deck reference has a row for every key of talus-dem."""
    done = subprocess.run(
        [sys.executable, ROOT / "tools/keys.py", "--docs", tmp_path], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    program = keys.read_program(
        "dem", keys.load(ROOT / "common/deck.toml", keys.Faults()), keys.Faults()
    )
    page = (tmp_path / "deck-dem.md").read_text()
    for group in program.groups:
        assert f"## &{group.name}" in page
        for key in group.keys:
            assert f"| `{key.name}` |" in page
