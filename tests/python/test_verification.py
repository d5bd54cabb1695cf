"""The cases of verification in one table, by feature, and as a badge."""

import json
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import verification_index  # noqa: E402
import verification_table  # noqa: E402

FACTS = verification_table.all_cases()
NAMES = {facts["id"] for facts in FACTS}


def metric(value: float | None, expected: float | None, limit: float, good: bool) -> dict:
    """Return a metric as a summary has it."""
    return {"metric": "m", "value": value, "expected": expected, "limit": limit, "pass": good}


@pytest.mark.parametrize(
    ("judged", "part", "text"),
    [
        (metric(1.02, 1.0, 0.05, True), 0.4, "0.02 / 0.05"),
        (metric(0.03, None, 0.05, True), 0.6, "0.03 / 0.05"),
        (metric(0.1, None, 0.05, False), 2.0, "0.1 / 0.05"),
        (metric(8.0, None, 4.0, True), 0.5, "8 / ≥ 4"),
        (metric(2.0, None, 4.0, False), 2.0, "2 / ≥ 4"),
        (metric(-6.0, None, -3.0, True), 0.5, "-6 / -3"),
        (metric(0.0, None, 0.0, True), 0.0, "0 / 0"),
        (metric(1.0, None, 0.0, False), float("inf"), "1 / 0"),
        (metric(None, 1.0, 0.1, False), float("inf"), "nan / 0.1"),
    ],
)
def test_part_of_the_limit(judged: dict, part: float, text: str) -> None:
    """The part of its limit that a metric uses is that of its own kind of limit."""
    assert verification_table.used(judged) == pytest.approx(part)
    assert verification_table.result_text(judged) == text


def test_worst_metric() -> None:
    """A metric that fails comes first, then the one nearest to its limit."""
    near, far = metric(0.9, None, 1.0, True), metric(0.1, None, 1.0, True)
    failed = metric(1.1, 1.0, 0.05, False)
    assert verification_table.worst([far, near]) is near
    assert verification_table.worst([near, failed, far]) is failed
    assert verification_table.worst([]) is None


def test_table_has_every_case(tmp_path: Path) -> None:
    """Each case of verification has one line; what was not run is shown as that."""
    case = {"id": "cook", "area": "fem", "pass": False, "error": "", "figures": [],
            "metrics": [metric(0.2, None, 0.1, False)]}  # fmt: skip
    (tmp_path / "summary.json").write_text(json.dumps({"version": "9.9", "cases": [case]}))
    found, version = verification_table.results(tmp_path)
    lines = verification_table.table(FACTS, found)[2:]
    counts = verification_table.counted(FACTS, found)
    assert version == "9.9" and len(lines) == sum(counts.values())
    assert counts == {"pass": 0, "fail": 1, "not run": len(lines) - 1}
    assert "fem | m | 0.2 / 0.1 | <span class='fail'>fail</span>" in "".join(lines)
    assert sum("<span>not run</span>" in line for line in lines) == len(lines) - 1
    assert not any(f["area"] == "validation" and f"#case-{f['id']})" in "".join(lines)
                   for f in FACTS)  # fmt: skip


@pytest.mark.parametrize(
    ("counts", "colour", "words"),
    [
        ((9, 0, 0), verification_table.GOOD, "9 of 9 pass"),
        ((8, 0, 1), verification_table.PART, "8 of 9 pass, 1 not run"),
        ((7, 1, 1), verification_table.BAD, "7 of 9 pass, 1 fail, 1 not run"),
    ],
)
def test_badge(counts: tuple, colour: str, words: str) -> None:
    """The badge is an SVG with the counts in words and the colour of the worst of them."""
    states = dict(zip(verification_table.STATES, counts, strict=True))
    svg = xml.fromstring(verification_table.badge(states, "1.0"))
    texts = [node.text for node in svg.iter() if node.tag.endswith("}text")]
    fills = {node.get("fill") for node in svg.iter()}
    assert texts == ["verification", words] and colour in fills


def test_badge_of_the_readme() -> None:
    """The README shows the badge that a run has written."""
    path = f"manual/{verification_table.BADGE}"
    assert f"]({path})" in (ROOT / "README.md").read_text()
    assert "verification of Talus" in xml.fromstring((ROOT / path).read_text()).get("aria-label")


def test_features_from_decks() -> None:
    """Keys and choices of decks and of exact.py lead to the cases that have them."""
    uses = verification_index.key_uses(FACTS)
    laws = {c for (program, group, key, c) in uses
            if (program, group, key) == ("talus-dem", "contact", "law")}  # fmt: skip
    assert "elastic_plastic_impact" in uses["talus-dem", "contact", "law", "thornton_ning"]
    assert {"hertz_mindlin", "thornton_ning"} <= laws
    assert "arc_length" in uses["talus-fem", "analysis", "continuation", "arc_length"]
    assert "harmonic_response" in uses["talus-fem", "analysis", "kind", "harmonic"]
    assert "overlap_penalty" in uses["talus-couple", "overlap", "method", "penalty"]
    assert "cook" not in uses["talus-fem", "analysis", "continuation", "arc_length"]
    assert "restart" in verification_index.other_uses(FACTS)["checkpoint and restart"]


def test_comments_and_strings_are_no_keys() -> None:
    """A key in a comment or in a string is none; a slash in a string ends no group."""
    text = "! &wall id = 'a' /\n&contact file = 'a/b = c', law = 'x' ! mu = 1\n young = 1.0 /\n"
    assert verification_index.keys_of(text) == [
        ("contact", "file", "'a/b = c'"), ("contact", "law", "'x'"), ("contact", "young", "1.0"),
    ]  # fmt: skip


def test_no_case_without_feature() -> None:
    """Every case stands in the index, by its decks or by the features of its case.toml."""
    uses = verification_index.key_uses(FACTS)
    named = set().union(*uses.values(), *verification_index.other_uses(FACTS).values())
    assert not NAMES - named
