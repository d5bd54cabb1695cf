"""Points that fill the unit cube evenly: Sobol's sequence and Latin hypercubes."""

import numpy as np

from talus.faults import FaultError

BITS = 30
#: Joe and Kuo (2008), new-joe-kuo-6: polynomial (with its degree) and first direction numbers.
DIRECTIONS = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
    (5, 11, (1, 1, 5, 1, 1)),
    (5, 13, (1, 1, 1, 3, 11)),
    (5, 14, (1, 3, 5, 5, 31)),
    (6, 1, (1, 3, 3, 9, 7, 49)),
    (6, 13, (1, 1, 1, 15, 21, 21)),
    (6, 16, (1, 3, 1, 13, 27, 49)),
    (6, 19, (1, 1, 1, 15, 7, 5)),
    (6, 22, (1, 3, 1, 15, 13, 25)),
    (6, 25, (1, 1, 5, 5, 19, 61)),
    (7, 1, (1, 3, 7, 11, 23, 15, 103)),
)
MOST_COLUMNS = len(DIRECTIONS) + 1


def directions(column: int) -> np.ndarray:
    """Return the direction numbers of a column as integers of BITS bits."""
    if column == 0:
        return np.array([1 << (BITS - 1 - k) for k in range(BITS)], dtype=np.int64)
    degree, polynomial, first = DIRECTIONS[column - 1]
    m = list(first)
    for k in range(degree, BITS):
        new = m[k - degree] ^ (m[k - degree] << degree)
        for i in range(1, degree):
            if (polynomial >> (degree - 1 - i)) & 1:
                new ^= m[k - i] << i
        m.append(new)
    return np.array([m[k] << (BITS - 1 - k) for k in range(BITS)], dtype=np.int64)


def sobol_points(count: int, columns: int, rng: np.random.Generator | None) -> np.ndarray:
    """Return the first points (count, columns) of Sobol's sequence, in Gray order.

    With a generator every column is shifted by random digits, which keeps the points even.
    """
    if columns > MOST_COLUMNS:
        text = f"Sobol's sequence has {columns} columns here, the largest number is {MOST_COLUMNS}"
        raise FaultError("E585", text, "plan = 'latin'; saltelli uses two columns a parameter")
    gray = np.arange(count, dtype=np.int64)
    gray ^= gray >> 1
    points = np.zeros((count, columns), dtype=np.int64)
    for column in range(columns):
        for bit, direction in enumerate(directions(column)):
            points[:, column] ^= np.where((gray >> bit) & 1, direction, 0)
    if rng is None:
        return points / 2.0**BITS
    points ^= rng.integers(0, 1 << BITS, columns)
    return (points + 0.5) / 2.0**BITS


def latin_points(count: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Return a Latin hypercube (count, columns): one point in each of `count` slices of an axis."""
    order = np.array([rng.permutation(count) for _ in range(columns)]).T.reshape(count, columns)
    return (order + rng.random((count, columns))) / count
