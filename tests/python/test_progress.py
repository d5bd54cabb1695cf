"""Progress: a bar with the time left on a terminal alone, and that of the cases of verification."""

import io
import sys
from pathlib import Path

import pytest

from talus.progress import watch

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import verify  # noqa: E402


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        """Say so."""
        return True


def test_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a terminal items are counted against their number, given or known; all pass."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert list(watch(iter(range(7)), "steps", 7)) == list(range(7))
    assert "steps:" in terminal.getvalue() and "/7 [" in terminal.getvalue()


def test_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a file nothing is written, and the items are those given."""
    file, items = io.StringIO(), [1, 2]
    monkeypatch.setattr(sys, "stderr", file)
    assert watch(items, "steps") is items and file.getvalue() == ""


def test_time_left() -> None:
    """Cases that have run before count by their time, others by the mean, over the jobs."""
    waiting = [{"id": "a"}, {"id": "b"}, {"id": "new"}]
    known = {"a": 100.0, "b": 500.0}
    assert verify.left_text(waiting, known, 1) == "3 cases wait, about 15.0 min left"
    assert verify.left_text(waiting[:1], known, 2) == "1 cases wait, about 50 s left"
    assert verify.left_text([], known, 1) == "all cases are done"
