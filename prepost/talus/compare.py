"""Comparisons of results that a NaN cannot pass.

Python's max and min pass over a NaN that is not their first, and a largest difference kept by
max(worst, x) is then that of the other numbers alone. All comparisons of results use this module.
"""

from collections.abc import Iterable, Mapping

import numpy as np


def max_of(*values: float | Iterable[float]) -> float:
    """Return the largest of several numbers, or of one sequence; NaN if one of them is."""
    return float(np.max(_numbers(values)))


def min_of(*values: float | Iterable[float]) -> float:
    """Return the smallest of several numbers, or of one sequence; NaN if one of them is."""
    return float(np.min(_numbers(values)))


def _numbers(values: tuple) -> np.ndarray:
    """Return the numbers of f(a, b, ...) or f(sequence); none at all raises, as of max."""
    alone = len(values) == 1 and isinstance(values[0], Iterable)
    return np.asarray(list(values[0]) if alone else values, dtype=float)


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Return the largest |a - b|; infinite where shapes or the places of NaN differ.

    Where both are NaN, or the same infinity, they do not differ. Without entries it is 0.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if a.shape != b.shape or not np.array_equal(np.isnan(a), np.isnan(b)):
        return float("inf")
    apart = (a != b) & ~np.isnan(a)
    return float(np.abs(a[apart] - b[apart]).max(initial=0.0))


def extent(values: np.ndarray) -> float:
    """Return the largest |value| that is finite; 0 without one. A scale for differences."""
    values = np.asarray(values, dtype=float)
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def same_arrays(a: Mapping[str, np.ndarray], b: Mapping[str, np.ndarray]) -> bool:
    """Whether two sets of arrays have the same names, shapes, types and values (NaN for NaN)."""
    return a.keys() == b.keys() and all(
        a[name].dtype == b[name].dtype
        and np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind in "fc")
        for name in a
    )
