"""Definitions of deck keys: what tools/keys.py accepts, refuses and writes."""

import copy
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import deck_definitions  # noqa: E402
import deck_reference  # noqa: E402
import deck_tables  # noqa: E402

COMMON = {
    "run": {
        "doc": "What is run.",
        "required": True,
        "keys": {"t_end": {"type": "real", "unit": "s", "above": 0.0, "doc": "End."}},
    }
}


def faults_of(entry: dict) -> str:
    """Return what is said of the definition of one key."""
    faults = deck_definitions.Faults()
    deck_definitions.read_key("key", entry, "here", faults)
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


GROUPS = {
    "step": {
        "doc": "Steps.",
        "was": "stride",
        "some_of": [["lower", "upper"]],
        "keys": {
            "kind": {
                "type": "string",
                "doc": "Kind.",
                "choices": ["static", "newmark", "hht"],
                "choices_were": {"average": "newmark"},
                "default": "static",
            },
            "beta": {
                "type": "real",
                "doc": "Beta.",
                "of": {"kind": ["newmark", "hht"]},
                "required": {"kind": ["hht"]},
                "was": ["b", "beta_n"],
            },
            "path": {
                "type": "string",
                "doc": "Path.",
                "choices": ["load", "arc"],
                "choices_of": {"arc": {"kind": ["static"]}},
            },
            "lower": {"type": "real", "doc": "Lower.", "needs": ["upper"]},
            "upper": {"type": "real", "doc": "Upper.", "excludes": ["beta"]},
        },
    },
    "tool": {
        "doc": "A tool.",
        "repeat": True,
        "of": {"step.kind": ["static"]},
        "one_of": [["file", "disc"]],
        "keys": {
            "file": {"type": "string", "doc": "File.", "of": {"step.kind": ["static"]}},
            "disc": {"type": "real", "doc": "Disc."},
        },
    },
}


def program_of(groups: dict) -> tuple[deck_definitions.Program, str]:
    """Return a program of these groups and what is said of them."""
    faults = deck_definitions.Faults()
    read = [
        deck_definitions.read_group(name, entry, False, name, faults)
        for name, entry in groups.items()
    ]
    program = deck_definitions.Program("talus-dem", "dem", "", "", read)
    deck_definitions.check_relations(program, "here", faults)
    return program, "\n".join(faults.lines)


def test_relations_reach_table_and_manual() -> None:
    """What is said of keys that depend on others stands in the Fortran table and in the manual."""
    program, said = program_of(GROUPS)
    assert said == ""
    table = deck_tables.fortran(program)
    for line in (
        "call table%group_was('stride')",
        "call table%one_of('lower|upper', at_least=.true.)",
        "call table%choices_were('average', 'newmark')",
        "call table%only_with('kind', 'newmark|hht')",
        "call table%need_with('kind', 'hht')",
        "call table%was('b|beta_n')",
        "call table%choice_with('arc', 'kind', 'static')",
        "call table%needs('upper')",
        "call table%excludes('beta')",
        "call table%group_with('step.kind', 'static')",
        "call table%one_of('file|disc')",
        "call table%only_with('step.kind', 'static')",
    ):
        assert line in table
    page = deck_reference.page(program)
    for text in (
        "At least one of `lower`, `upper`. Once called `&stride`.",
        "Only with `kind` = `'newmark'`, `'hht'`. Required with `kind` = `'hht'`. Once called",
        "`'arc'` only with `kind` = `'static'`.",
        "Needs `upper`.",
        "Not beside `beta`.",
        "Only with `kind` = `'static'` of `&step`. Exactly one of `file`, `disc`.",
    ):
        assert text in page


@pytest.mark.parametrize(
    ("group", "key", "change", "said"),
    [
        ("step", "beta", {"of": ["newmark"]}, "is not {"),
        ("step", "beta", {"of": {"knd": ["hht"]}}, "no choosing key 'knd'"),
        ("step", "beta", {"of": {"kind": ["htt"]}}, "'htt' is none of the choices"),
        ("step", "beta", {"of": {"kind": []}}, "'nothing' is none of the choices"),
        ("step", "beta", {"of": {"kind": ["static", "newmark", "hht"]}}, "is no condition"),
        ("step", "beta", {"of": {"lower": ["a"]}}, "is no choosing key"),
        ("step", "kind", {"of": {"kind": ["hht"]}}, "no choosing key 'kind'"),
        ("step", "beta", {"of": {"tool.file": ["a"]}}, "is no choosing key"),
        ("step", "beta", {"required": {"kind": ["static"]}}, "to which it does not belong"),
        ("step", "beta", {"default": 1.0}, "a required key has no default"),
        ("step", "lower", {"needs": ["lowest"]}, "no other key 'lowest'"),
        ("step", "lower", {"excludes": ["lower"]}, "no other key 'lower'"),
        ("step", "beta", {"excludes": ["upper"]}, "say it once"),
        ("step", "lower", {"was": "upper"}, "was = 'upper' is in use"),
        ("step", "lower", {"was": "b"}, "was = 'b' is in use"),
        ("step", "lower", {"was": "Low"}, "is no name"),
        ("step", "path", {"choices_of": {"ark": {"kind": ["hht"]}}}, "'ark' is none"),
        ("step", "kind", {"choices_were": {"hht": "newmark"}}, "choices_were: 'hht' is one"),
        ("step", "kind", {"choices_were": {"old": "new"}}, "or 'new' is none"),
    ],
)
def test_faulty_relations(group: str, key: str, change: dict, said: str) -> None:
    """Each rule that cannot hold is named."""
    groups = copy.deepcopy(GROUPS)
    groups[group]["keys"][key].update(change)
    assert said in program_of(groups)[1]


@pytest.mark.parametrize(
    ("group", "change", "said"),
    [
        ("step", {"was": "tool"}, "was = 'tool' is in use"),
        ("tool", {"of": {"kind": ["static"]}}, "no choosing key 'kind'"),
        ("tool", {"one_of": ["file", "disc"]}, "is not [["),
        ("tool", {"one_of": [["file"]]}, "two or more keys"),
        ("tool", {"one_of": [["file", "plate"]]}, "no key 'plate'"),
    ],
)
def test_faulty_group_relations(group: str, change: dict, said: str) -> None:
    """So is each rule of a group."""
    groups = copy.deepcopy(GROUPS)
    groups[group].update(change)
    assert said in program_of(groups)[1]


def test_included_group_is_changed() -> None:
    """A program extends an included group and replaces a bound; the shared one stays."""
    change = {"keys": {"t_end": {"min": 0.0, "required": True}, "more": {"type": "real"}}}
    merged = deck_definitions.merge(COMMON["run"], change)
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
    key = deck_definitions.Key("name", "string", doc.strip(), default=["x" * 150])
    group = deck_definitions.Group("group", doc.strip(), True, True, "", [key], False)
    text = deck_tables.fortran(deck_definitions.Program("talus-dem", "dem", "", "", [group]))
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
    program = deck_definitions.read_program(
        "dem",
        deck_definitions.load(ROOT / "common/deck.toml", deck_definitions.Faults()),
        deck_definitions.Faults(),
    )
    page = (tmp_path / "deck-dem.md").read_text()
    for group in program.groups:
        assert f"## &{group.name}" in page
        for key in group.keys:
            assert f"| `{key.name}` |" in page
