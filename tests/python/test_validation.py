"""The chapter of experiments: what was run, what was missed, and what was not run is in it."""

import json
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import manual  # noqa: E402

CASES = sorted((ROOT / "verification/validation").glob("*/case.toml"))


def summary_of(folder: Path, case: str) -> None:
    """Write a summary in which one experiment has a metric inside its band and one outside."""
    metrics = [
        {"metric": "slope", "value": 26.5, "expected": 27.0, "limit": 2.0, "pass": True},
        {"metric": "speed", "value": 0.6, "expected": 1.0, "limit": 0.15, "pass": False},
    ]
    facts = {"id": case, "title": "A drum", "area": "validation", "pass": False, "error": ""}
    entry = facts | {"metrics": metrics, "figures": []}
    other = {"id": "cook", "title": "Cook", "area": "fem", "pass": True, "metrics": []}
    text = json.dumps({"version": "0", "cases": [entry, other]})
    (folder / "summary.json").write_text(text)


def test_a_metric_outside_its_band_stays_visible(tmp_path: Path) -> None:
    """It is named in the table of experiments and marked in the table of its case."""
    case = CASES[0].parent.name
    summary_of(tmp_path, case)
    page = manual.validation_lines(tmp_path, tmp_path)
    assert "| 2 | speed |" in page
    assert "| speed | 0.6 | 1 | 0.15 | <span class='fail'>fail</span> |" in page
    assert f"({case}) <span id='case-{case}' class='fail'>fail</span>" in page


def test_experiments_that_were_not_run_are_in_the_chapter(tmp_path: Path) -> None:
    """Without any result each is there with its page and its source."""
    page = manual.validation_lines(tmp_path, tmp_path)
    for path in CASES:
        facts = tomllib.loads(path.read_text())
        assert f"({facts['id']}) <span id='case-{facts['id']}'>not run</span>" in page
        assert manual.cell(facts["source"]) in page
    assert page.count("**Experiment.**") == len(CASES)


def test_verification_counts_no_experiment(tmp_path: Path) -> None:
    """An experiment outside its band is no failing case of the verification chapter."""
    summary_of(tmp_path, CASES[0].parent.name)
    page = manual.verification_page(tmp_path, tmp_path)
    assert "cases: 1 of " in page and "fail," not in page.split("## All")[0]


def test_each_experiment_says_what_the_chapter_promises() -> None:
    """Source, what was known, the band, and what the size limits; none is a quick case."""
    for path in CASES:
        page = (path.parent / "README.md").read_text()
        for head in ("Experiment.", "Source.", "Known beforehand.", "Band", "Limits."):
            assert f"**{head}" in page, f"{path.parent.name}: {head}"
        assert tomllib.loads(path.read_text())["quick"] is False
