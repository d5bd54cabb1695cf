"""Histories on ranks are judged by round-off, on one rank by every digit."""

from pathlib import Path

import pytest

from talus.verification import Case, history_difference

HEAD = "time [s],force_x [N],force_y [N],turn [-]\n"


def write(path: Path, force: str, turn: str = "1.0E-3") -> str:
    """Write a history of one row; return its text."""
    text = HEAD + f"1.0,{force},100.0,{turn}\n"
    path.write_text(text)
    return text


def test_difference_is_measured_by_the_largest_of_a_unit(tmp_path):
    """A force is measured by the largest force."""
    write(tmp_path / "a.csv", "1.0", "1.0E-3")
    write(tmp_path / "b.csv", "1.5", "1.2E-3")
    assert history_difference(tmp_path / "a.csv", tmp_path / "b.csv") == pytest.approx(5.0e-3)


def test_turns_below_one_count_as_they_are(tmp_path):
    """Plain numbers below 1 have the scale 1."""
    write(tmp_path / "a.csv", "1.0", "1.0E-3")
    write(tmp_path / "b.csv", "1.0", "1.2E-3")
    assert history_difference(tmp_path / "a.csv", tmp_path / "b.csv") == pytest.approx(2.0e-4)


def test_other_rows_are_no_rounding(tmp_path):
    """Histories of other lengths differ without bound."""
    write(tmp_path / "a.csv", "1.0")
    (tmp_path / "b.csv").write_text(HEAD)
    assert history_difference(tmp_path / "a.csv", tmp_path / "b.csv") == float("inf")


@pytest.mark.parametrize(("ranks", "passes"), [(0, False), (2, True)])
def test_one_rank_must_repeat_every_digit(tmp_path, ranks, passes):
    """A last digit counts on one rank alone."""
    kept = {"a.csv": write(tmp_path / "a.csv", "1.0")}
    write(tmp_path / "a.csv", "1.00000000001")
    case = Case("id", "title", tmp_path, tmp_path, ranks)
    case.same_histories("restart", kept, 1.0e-9)
    assert [m["pass"] for m in case.metrics] == [passes]
    case.same_histories("restart", kept, 1.0e-14)
    assert not case.metrics[-1]["pass"]
