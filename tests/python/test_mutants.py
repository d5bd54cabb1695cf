"""Faults put into the code: where they go, what notices them, and the manual's table."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import mutants  # noqa: E402

import manual  # noqa: E402


def tree_with(folder: Path, text: str) -> Path:
    """Return a tree with one source, a makefile that builds nothing, and a test that greps it."""
    (folder / "dem/laws").mkdir(parents=True)
    (folder / "dem/laws/dem_x.f90").write_text(text)
    (folder / "Makefile").write_text("build/unit/test_dem_x:\n\t@true\n")
    test = folder / "build/unit/test_dem_x"
    test.parent.mkdir(parents=True)
    test.write_text("#!/bin/sh\ngrep -q 'a + b' dem/laws/dem_x.f90 || { echo FAIL sum; exit 1; }\n")
    test.chmod(0o755)
    return folder


def fault(find: str, put: str) -> mutants.Mutant:
    """Return a fault in dem_x.f90."""
    return mutants.Mutant("sign", "dem_x.f90", find, put, ["unit dem_x"], "sum of a and b")


def test_a_fault_is_put_in_noticed_and_taken_out(tmp_path: Path) -> None:
    """The row names the test and its words; the source is as it was."""
    tree = tree_with(tmp_path, "c = a + b\n")
    row = mutants.try_mutant(tree, fault("a + b", "a - b"))
    assert (row["noticed by"], row["how"]) == ("unit dem_x", "FAIL sum")
    assert (tree / "dem/laws/dem_x.f90").read_text() == "c = a + b\n"


def test_a_fault_that_nothing_notices_is_named(tmp_path: Path) -> None:
    """A test that passes has not noticed."""
    row = mutants.try_mutant(tree_with(tmp_path, "c = a + b\nd = 1\n"), fault("d = 1", "d = 2"))
    assert (row["noticed by"], row["how"]) == ("", "passes unit dem_x")


def test_a_text_that_occurs_twice_or_never_is_refused(tmp_path: Path) -> None:
    """The place of a fault is one line of one file."""
    tree = tree_with(tmp_path, "c = a + b\nd = a + b\n")
    assert "occurs 2 times" in mutants.try_mutant(tree, fault("a + b", "a - b"))["how"]
    assert "occurs 0 times" in mutants.try_mutant(tree, fault("a*b", "a/b"))["how"]


def test_the_manual_shows_what_noticed(tmp_path: Path) -> None:
    """One line a fault; what nothing noticed is said first."""
    rows = [
        {"id": "sign", "file": "dem_x.f90", "about": "a | b", "noticed by": "unit dem_x",
         "how": "FAIL sum"},
        {"id": "other", "file": "dem_y.f90", "about": "c", "noticed by": "", "how": "passes it"},
    ]  # fmt: skip
    mutants.write_report(rows, tmp_path / "mutants.csv")
    page = manual.noticed_faults(tmp_path / "mutants.csv")
    assert "2 one-line faults" in page
    assert "noticed 1, none noticed other." in page
    assert "| a \\| b | dem_x.f90 | unit dem_x | FAIL sum |" in page
    assert "None tried" in manual.noticed_faults(tmp_path / "absent.csv")


def test_accepted_rows_replace_older_ones(tmp_path: Path) -> None:
    """Rows of other faults stay, in the order of the list; what left the list goes."""
    path = tmp_path / "mutants.csv"
    blank = dict.fromkeys(("file", "about", "noticed by", "how"), "")
    mutants.accept([{"id": name, **blank} for name in "abc"], ["a", "b", "c"], path)
    mutants.accept([{"id": "b", **blank, "noticed by": "unit x"}], ["b", "a", "d"], path)
    assert path.read_text().splitlines()[1:] == ["b,,,unit x,", "a,,,,"]
