"""Comparisons of results: a NaN never passes, in whatever place it stands."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from talus.compare import difference, extent, max_of, min_of, same_arrays
from talus.verification import Case, history_difference

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("choose", [max_of, min_of])
def test_largest_and_smallest_do_not_skip_nan(choose):
    """Python's own do, unless the NaN comes first."""
    for numbers in itertools.permutations([1.0, NAN, 3.0]):
        assert np.isnan(choose(*numbers))
        assert np.isnan(choose(numbers))
        assert np.isnan(choose(value for value in numbers))
    assert choose([2.0]) == choose(2.0) == 2.0
    assert (max_of(1.0, 3.0, 2.0), min_of({"a": 3.0, "b": 1.0}.values())) == (3.0, 1.0)
    assert (max_of(np.array([1.0, 5.0])), max_of(-1.0, -2.0)) == (5.0, -1.0)
    with pytest.raises(ValueError, match="zero-size"):
        choose([])


def test_difference_looks_at_nan_first():
    """Shapes and places of NaN must agree; then the rest is compared."""
    a = np.array([[1.0, NAN], [3.0, 4.0]])
    assert difference(a, a) == 0.0
    assert difference(a, a + 0.5) == 0.5
    assert difference(a, np.array([[1.0, 2.0], [3.0, 4.0]])) == INF
    assert difference(np.array([[1.0, 2.0], [3.0, 4.0]]), a) == INF
    assert difference(a, a.T) == INF
    assert difference(a, a.ravel()) == INF
    assert difference(np.full(3, NAN), np.array([NAN, NAN, 1.0])) == INF
    assert difference([], []) == 0.0
    assert difference([1, 2], [1, 5]) == 3.0


def test_difference_of_infinities():
    """The same infinity is no difference, another one or a number is."""
    assert difference([INF, 1.0], [INF, 1.5]) == 0.5
    assert difference([INF], [-INF]) == INF
    assert difference([INF], [1.0]) == INF
    assert extent([INF, NAN, -3.0]) == 3.0
    assert extent([]) == 0.0


def test_same_arrays():
    """Names, shapes, types and values; NaN for NaN."""
    one = {"x": np.array([1.0, NAN]), "n": np.array([1, 2])}
    assert same_arrays(one, {k: v.copy() for k, v in one.items()})
    assert not same_arrays(one, one | {"more": np.zeros(1)})
    assert not same_arrays(one | {"more": np.zeros(1)}, one)
    assert not same_arrays(one, one | {"x": np.array([1.0, 2.0])})
    assert not same_arrays(one, one | {"x": np.array([1.0])})
    assert not same_arrays(one, one | {"n": np.array([1.0, 2.0])})
    assert not same_arrays(one, one | {"n": np.array([1, 3])})


def compared(folder: Path, one: str, other: str, heads: str = "force_x [N],force_y [N]") -> float:
    """Return the difference of two histories of some rows."""
    (folder / "a.csv").write_text(f"time [s],{heads}\n{one}\n")
    (folder / "b.csv").write_text(f"time [s],force_x [N],force_y [N]\n{other}\n")
    return history_difference(folder / "a.csv", folder / "b.csv")


def test_nan_in_a_unit_hides_no_difference(tmp_path):
    """2 N for 99 N beside a NaN counted as nothing once."""
    assert compared(tmp_path, "1.0,2.0,nan", "1.0,99.0,nan") == pytest.approx(97.0 / 2.0)
    assert compared(tmp_path, "1.0,2.0,nan", "1.0,2.0,nan") == 0.0


def test_nan_for_a_number_is_no_rounding(tmp_path):
    """A NaN on one side alone, in whatever row, differs without bound."""
    for one, other in itertools.permutations(["1.0,2.0,3.0", "1.0,2.0,nan", "1.0,nan,3.0"], 2):
        assert compared(tmp_path, one, other) == INF
    rows = "1.0,2.0,3.0\n2.0,2.0,nan"
    assert compared(tmp_path, rows, "1.0,2.0,3.0\n2.0,2.0,3.0") == INF


def test_other_heads_are_no_rounding(tmp_path):
    """The same numbers under other names or units are another history."""
    row = "1.0,2.0,3.0"
    assert compared(tmp_path, row, row, "force_x [N],moment_y [N m]") == INF


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_a_metric_that_is_no_number_fails(tmp_path, value):
    """In every kind of judgement, on either side of the limit."""
    case = Case("id", "title", tmp_path, tmp_path)
    case.metric("about", value, 0.0, 1.0)
    case.metric("about itself", value, value, INF)
    case.below("below", value, 1.0)
    case.above("above", value, 1.0)
    case.below("below no number", 1.0, NAN)
    case.above("above no number", 1.0, NAN)
    case.metric("about no number", 1.0, NAN, 1.0)
    assert [m["pass"] for m in case.metrics] == [False] * 7
    case.below("a number", 0.5, 1.0)
    assert case.metrics[-1]["pass"]
