"""`talus schema`: the decks of the examples are valid, wrong ones are not; files for editors."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from talus import cli, deck_json, editor_files, reference, schema
from talus.programs import program_of

ROOT = Path(__file__).resolve().parents[2]
#: whole decks: example 08 makes its own of parts that have no &run
DECKS = [p for p in sorted((ROOT / "examples").rglob("*.nml")) if "&run" in p.read_text()]
#: what the scripts of the examples put into their decks before they run them
FILLED = {
    "HEIGHT": "0.03", "CENTRE": "0.0, 0.0, 0.1", "@start@": "command = 'solver'",
    "@ends@": "", "@liquid@": "", "@run@": "", "@step@": "", "@total@": "", "@bricks@": "9",
    "@tip@": "0.0, 0.0, 0.1", "@deck@": "solid.nml", "@SEED@": "1",
    "@taus@": ", ".join(11 * ["0.0"]),
}  # fmt: skip
NUMBER = "0.3"  # stands for every other @word@
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int,
         "number": (int, float)}  # fmt: skip
COMPARED = {"minimum": lambda v, b: v >= b, "maximum": lambda v, b: v <= b,
            "exclusiveMinimum": lambda v, b: v > b, "exclusiveMaximum": lambda v, b: v < b,
            "minItems": lambda v, b: len(v) >= b, "maxItems": lambda v, b: len(v) <= b}  # fmt: skip
SAID = {"$schema", "$defs", "title", "description", "default", "if", "then"}


def valid(rules: dict, value: object, defs: dict) -> bool:
    """Whether a value keeps the rules of a schema; a word that is not known here is a KeyError."""
    return all(keeps(word, rules, value, defs) for word in rules)


def keeps(word: str, rules: dict, value: object, defs: dict) -> bool:
    """Whether a value keeps one rule."""
    rule = rules[word]
    if word == "if":
        return not valid(rule, value, defs) or valid(rules["then"], value, defs)
    if word in SAID:
        return True
    if word == "$ref":
        return valid(defs[rule.rsplit("/", 1)[1]], value, defs)
    if word == "type":
        return isinstance(value, TYPES[rule]) and (rule == "boolean") == isinstance(value, bool)
    if word in COMPARED:
        number = isinstance(value, list if word.endswith("Items") else (int, float))
        return not number or COMPARED[word](value, rule)
    if word in ("anyOf", "oneOf", "allOf", "not"):
        held = [valid(one, value, defs) for one in ([rule] if word == "not" else rule)]
        wanted = {"anyOf": sum(held) > 0, "oneOf": sum(held) == 1, "allOf": all(held)}
        return wanted.get(word, not held[0])
    if word == "enum":
        return value in rule
    if word == "items":
        return not isinstance(value, list) or all(valid(rule, one, defs) for one in value)
    return not isinstance(value, dict) or of_object(word, rules, value, defs)


def of_object(word: str, rules: dict, value: dict, defs: dict) -> bool:
    """Whether an object keeps one rule about its members."""
    rule = rules[word]
    return {
        "required": lambda: set(rule) <= set(value),
        "properties": lambda: all(valid(rule[k], v, defs) for k, v in value.items() if k in rule),
        "additionalProperties": lambda: set(value) <= set(rules["properties"]),
        "dependentRequired": lambda: all(set(rule[k]) <= set(value) for k in rule if k in value),
    }[word]()


def accepted(text: str, program: str) -> bool:
    """Whether a deck is valid by the schema of its program."""
    rules = schema.of_program(program)
    return valid(rules, deck_json.deck_as_json(text), rules["$defs"])


@pytest.mark.parametrize("deck", DECKS, ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_examples(deck: Path) -> None:
    """Every deck of the examples is valid; with a key spelt wrong it is not."""
    text = deck.read_text()
    for word, value in FILLED.items():
        text = text.replace(word, value)
    text = re.sub(r"@\w+@", NUMBER, text)
    program = program_of(deck)
    assert accepted(text, program)
    wrong = re.sub(r"^(\s*&run\s+)title\b", r"\1titel", text, count=1, flags=re.M)
    assert wrong == text or not accepted(wrong, program)


GOOD = """&run title = 'x', t_end = 1.0, gravity = 0.0, 0.0, -9.81 /
&material id = 'a', density = 2650.0, young = 1.0d7, poisson = 0.25 /
&contact between = 2*'a', law = 'hertz_mindlin', friction = 0.5, damping_ratio = 0.2 /
&particles file = 'a.h5', material = 'a' /
&wall id = 'z', point = 3*0.0, normal = 0.0, 0.0, 1.0, material = 'a' /
&relaxation damping = 'full', mass_scale = 10 /
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("friction = 0.5", "frction = 0.5"),
        ("friction = 0.5", "friction = -0.5"),
        ("friction = 0.5", "friction = 'much'"),
        ("friction = 0.5,", ""),
        ("'hertz_mindlin'", "'hertz'"),
        ("damping_ratio = 0.2", "damping_ratio = 0.2, restitution = 0.5"),
        ("damping_ratio = 0.2", "normal_stiffness = 1.0e5"),
        ("3*0.0", "2*0.0"),
        ("&wall", "&wal"),
        ("'full'", "'some'"),
        ("&material id", "&run title = 'y' /\n&material id"),
        ("&particles file = 'a.h5', material = 'a' /\n", ""),
    ],
)
def test_wrong(old: str, new: str) -> None:
    """Wrong keys, values, choices, sizes, groups and combinations are not valid."""
    assert accepted(GOOD, "talus-dem")
    assert old in GOOD and not accepted(GOOD.replace(old, new), "talus-dem")


def test_values() -> None:
    """Values of a deck keep type and number."""
    deck = deck_json.deck_as_json("&a x = 2*1.5, y = .true., z = 3, t = 'it''s', e = 1d3 /\n")
    assert deck == {"a": {"x": [1.5, 1.5], "y": True, "z": 3, "t": "it's", "e": 1000.0}}
    assert isinstance(deck["a"]["z"], int) and math.isclose(deck["a"]["e"], 1e3)


def test_editors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every key is known to both editors, with its text, unit and default."""
    for kind in editor_files.MAKERS:
        assert cli.main(["schema", kind, "-o", str(tmp_path / kind)]) == 0
    said = capsys.readouterr().out
    assert "talus.vim" in said and "package.json" in said and "talus-fem.schema.json" in said
    text = json.loads((tmp_path / "vscode/keys.json").read_text())
    assert "[1/s]" in text["dynamics.damping"] and "default 0.0" in text["dynamics.damping"]
    vim = (tmp_path / "vim/syntax/talus.vim").read_text()
    grammar = json.loads((tmp_path / "vscode/talus.tmLanguage.json").read_text())
    rules = {one["begin"]: json.dumps(one) for one in grammar["patterns"] if "begin" in one}
    for group in reference.groups():
        (rule,) = (r for begin, r in rules.items() if begin == f"(?i)^\\s*(&{group.name})\\b")
        for key in group.table["keys"]:
            assert f"{group.name}.{key}" in text
            assert re.search(rf"[(|]{key}[)|]", rule) and re.search(rf"\b{key}\b", vim)
    assert json.loads((tmp_path / "json/talus-dem.schema.json").read_text())["title"]


@pytest.mark.skipif(not shutil.which("node"), reason="no node here")
def test_hover(tmp_path: Path) -> None:
    """The extension of VS Code tells the key of the group in which it stands."""
    editor_files.write("vscode", tmp_path)
    code = """const lines = ["&run t_end = 1 /", "&contact between = 'a', 'a',", " friction = 1 /"];
const { textOf } = require(process.argv[1]);
const at = (line, word) => textOf({ lineAt: (k) => ({ text: lines[k] }),
  getWordRangeAtPosition: () => word, getText: () => word }, { line });
console.log(at(2, "friction") + "|" + at(0, "friction"));"""
    done = subprocess.run(["node", "-e", code, str(tmp_path / "extension.js")],
                          capture_output=True, text=True)  # fmt: skip
    hover, _, none = done.stdout.partition("|")
    assert "Coulomb" in hover and none.strip() == "", done.stderr


def test_no_tables(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without the sources E635 says where the files are."""
    monkeypatch.setattr(reference, "groups", lambda: ())
    assert cli.main(["schema", "vim"]) == 1
    said = capsys.readouterr().err
    assert "error E635" in said and "share/talus/editors" in said


def test_deck(capsys: pytest.CaptureFixture[str]) -> None:
    """A deck is printed as JSON; one that is not there is E531."""
    assert cli.main(["schema", "json", "--deck", str(DECKS[0])]) == 0
    assert json.loads(capsys.readouterr().out) == deck_json.deck_as_json(DECKS[0].read_text())
    assert cli.main(["schema", "json", "--deck", "nowhere.nml"]) == 1
    assert "error E531" in capsys.readouterr().err
