"""Plans of a study: which values the parameters have at which point."""

import itertools

import numpy as np

from talus.faults import FaultError
from talus.study.parameters import Parameter
from talus.study.sequence import latin_points, sobol_points

PLANS = {
    "grid": "every combination of the values; ranges have `levels` values",
    "latin": "Latin hypercube of `points` points",
    "sobol": "the first `points` points of Sobol's sequence, shifted by random digits",
    "saltelli": "`points` rows of A and B and of A with one column of B each: indices of Sobol",
    "one_at_a_time": "the base point, then each parameter alone over its `levels`",
}


def size_of(plan: str, points: int, levels: int, parameters: list[Parameter]) -> int:
    """Return the number of points of a plan, without making them."""
    counts = [len(p.values) or levels for p in parameters]
    if plan == "grid":
        total = 1
        for count in counts:
            total *= count
        return total
    if plan == "saltelli":
        return points * (len(parameters) + 2)
    return points if plan in ("latin", "sobol") else 1 + sum(counts)


def one_at_a_time(parameters: list[Parameter], levels: int) -> list[dict]:
    """Return the base point, then the points that differ from it in one parameter."""
    base = {p.name: p.middle() for p in parameters}
    rows = [base]
    for p in parameters:
        rows += [base | {p.name: value} for value in p.levels(levels) if value != base[p.name]]
    return rows


def saltelli_shares(points: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Return the shares of A, B and AB_1 ... AB_k, block behind block (Saltelli 2010)."""
    both = sobol_points(points, 2 * columns, rng)
    a, b = both[:, :columns], both[:, columns:]
    blocks = [a, b]
    for k in range(columns):
        mixed = a.copy()
        mixed[:, k] = b[:, k]
        blocks.append(mixed)
    return np.concatenate(blocks)


def make_points(plan: str, points: int, levels: int, seed: int, parameters: list) -> list[dict]:
    """Return the points of a plan: name and value of every parameter."""
    rng = np.random.default_rng(seed)
    if plan == "grid":
        names = [p.name for p in parameters]
        every = itertools.product(*(p.levels(levels) for p in parameters))
        return [dict(zip(names, row, strict=True)) for row in every]
    if plan == "one_at_a_time":
        return one_at_a_time(parameters, levels)
    if plan == "latin":
        shares = latin_points(points, len(parameters), rng)
    elif plan == "sobol":
        shares = sobol_points(points, len(parameters), rng)
    else:
        shares = saltelli_shares(points, len(parameters), rng)
    return [{p.name: p.at(float(s)) for p, s in zip(parameters, row, strict=True)}
            for row in shares]  # fmt: skip


def check_plan(plan: str, points: int, most: int, size: int, place: str) -> None:
    """Refuse (E585, E586) a plan that says nothing or is larger than allowed."""
    if plan in ("latin", "sobol", "saltelli") and points < 2:
        raise FaultError("E585", f"plan '{plan}' needs points = 2 or more", "", place)
    if plan == "saltelli" and points & (points - 1):
        near = 1 << (points - 1).bit_length()
        text = f"points = {points} of plan 'saltelli' is no power of two"
        raise FaultError("E585", text, f"{near // 2} or {near}", place)
    if size > most:
        text = f"the plan has {size} points, more than most = {most}"
        raise FaultError("E586", text, "fewer levels or points, or a larger 'most'", place)
