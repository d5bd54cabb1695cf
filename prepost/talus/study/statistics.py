"""Means, quantiles and sensitivities of the results of a study.

Indices of Sobol: first order after Saltelli et al. (2010, Comput. Phys. Commun. 181, Eq. b of Table
2), total after Jansen (1999): with f of the rows of A, B and AB_i,
S_i = mean(f_B (f_ABi - f_A)) / V,   T_i = mean((f_A - f_ABi)^2) / (2 V).
"""

import numpy as np

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
DRAWS = 1000  # of the bootstrap
CONFIDENCE = 0.95
LEAST = 8  # complete rows below which no index is said


def summary(values: np.ndarray) -> dict[str, float]:
    """Return count, mean, deviation, standard error and quantiles of the finite values."""
    x = values[np.isfinite(values)]
    if not x.size:
        return {"count": 0}
    deviation = float(np.std(x, ddof=1)) if x.size > 1 else float("nan")
    facts = {"count": int(x.size), "mean": float(np.mean(x)), "deviation": deviation,
             "standard_error": deviation / float(np.sqrt(x.size)),
             "least": float(np.min(x)), "largest": float(np.max(x))}  # fmt: skip
    return facts | {f"quantile_{q:g}": float(v)
                    for q, v in zip(QUANTILES, np.quantile(x, QUANTILES), strict=True)}  # fmt: skip


def interval(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper end of the confidence of draws (draws, columns)."""
    rest = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.nanquantile(draws, (rest, 1.0 - rest), axis=0)
    return low, high


def sobol_indices(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first and total indices (k) of values (k + 2, n) of A, B, AB_1 ... AB_k.

    The mean is taken off first, which lessens the scatter and changes no expected value.
    """
    both = f[:2].ravel()
    f, variance = f - both.mean(), np.var(both)
    if variance <= 0.0:
        return np.full(len(f) - 2, np.nan), np.full(len(f) - 2, np.nan)
    a, b, mixed = f[0], f[1], f[2:]
    first = np.mean(b * (mixed - a), axis=1) / variance
    return first, np.mean((a - mixed) ** 2, axis=1) / (2.0 * variance)


def sobol(values: np.ndarray, count: int, seed: int = 1) -> dict[str, np.ndarray] | None:
    """Return the indices of the results of a plan 'saltelli' with their confidence.

    Rows of which a point failed are left out; None with fewer than LEAST complete ones.
    """
    f = values.reshape(count + 2, -1)
    f = f[:, np.isfinite(f).all(axis=0)]
    n = f.shape[1]
    if n < LEAST:
        return None
    rng = np.random.default_rng(seed)
    draws = np.array([sobol_indices(f[:, rng.integers(0, n, n)]) for _ in range(DRAWS)])
    first, total = sobol_indices(f)
    (first_low, first_high), (total_low, total_high) = interval(draws[:, 0]), interval(draws[:, 1])
    return {"first": first, "first_low": first_low, "first_high": first_high, "total": total,
            "total_low": total_low, "total_high": total_high, "rows": np.array(n)}  # fmt: skip


def ranks(x: np.ndarray) -> np.ndarray:
    """Return the ranks of the columns; equal values share their mean rank."""
    out = np.empty(x.shape)
    for k, column in enumerate(x.T):
        _, back, count = np.unique(column, return_inverse=True, return_counts=True)
        out[:, k] = (np.cumsum(count) - 0.5 * (count - 1.0))[back]
    return out


def coefficients(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the standardised coefficients of a linear fit of ranks (n, k) and (n)."""
    data = ranks(np.column_stack([x, y]))
    spread = data.std(axis=0)
    data = (data - data.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return np.linalg.lstsq(data[:, :-1], data[:, -1], rcond=None)[0]


def regression(x: np.ndarray, y: np.ndarray, seed: int = 1) -> dict[str, np.ndarray] | None:
    """Return standardised rank coefficients with the confidence of a bootstrap.

    From -1 to 1: how the rank of a result rises with that of a parameter, the others held.
    """
    good = np.isfinite(y) & np.isfinite(x).all(axis=1)
    x, y, n = x[good], y[good], int(good.sum())
    if n < max(LEAST, x.shape[1] + 2):
        return None
    rng = np.random.default_rng(seed)
    chosen = (rng.integers(0, n, n) for _ in range(DRAWS))
    low, high = interval(np.array([coefficients(x[k], y[k]) for k in chosen]))
    return {"rank": coefficients(x, y), "rank_low": low, "rank_high": high}


def swings(values: dict[str, list], y: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return the least and largest result when each parameter alone leaves the first point."""
    base = {name: column[0] for name, column in values.items()}
    found = {}
    for name, column in values.items():
        own = [y[k] for k in range(len(y)) if np.isfinite(y[k]) and all(
            values[other][k] == base[other] for other in values if other != name)]  # fmt: skip
        if len(own) > 1 and len(set(map(repr, column))) > 1:
            found[name] = (float(min(own)), float(max(own)))
    return found


def numbers_of(column: list) -> np.ndarray:
    """Return a column as numbers; words are numbered in the order of their first use."""
    if all(isinstance(value, int | float) for value in column):
        return np.array(column, dtype=float)
    known = list(dict.fromkeys(column))
    return np.array([float(known.index(value)) for value in column])


def repeated(
    values: dict[str, list], results: dict[str, np.ndarray], repeats: list[str]
) -> list[dict]:
    """Return a row for each combination of the other parameters: points, means and deviations.

    `points` counts the rows of a combination; NAME, NAME_deviation are of the finite values.
    """
    others = [name for name in values if name not in repeats]
    count = len(next(iter(values.values())))
    groups: dict[tuple, list[int]] = {}
    for k in range(count):
        groups.setdefault(tuple(values[name][k] for name in others), []).append(k)
    rows = []
    for key, members in groups.items():
        row = dict(zip(others, key, strict=True)) | {"points": len(members)}
        for name, y in results.items():
            facts = summary(y[members])
            row[name] = facts.get("mean", float("nan"))
            row[f"{name}_deviation"] = facts.get("deviation", float("nan"))
        rows.append(row)
    return rows


def describe(plan: str, values: dict[str, list], results: dict[str, np.ndarray]) -> dict:
    """Return what is known of every result: summary and sensitivities, ready for JSON."""
    x = np.column_stack([numbers_of(column) for column in values.values()])
    out = {}
    for name, y in results.items():
        one: dict[str, object] = {"summary": summary(y)}
        found = sobol(y, len(values)) if plan == "saltelli" else None
        if plan not in ("saltelli", "one_at_a_time"):
            found = regression(x, y)
        if found is not None:
            one["sensitivity"] = {
                parameter: {kind: float(v[k]) for kind, v in found.items() if v.ndim}
                for k, parameter in enumerate(values)
            }
        if plan == "one_at_a_time":
            one["swing"] = swings(values, y)
        out[name] = one
    return out
