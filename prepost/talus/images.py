"""Contacts of grains with periodic images: shifts, nearest images, contacts of a repeated cell.

A shift (three whole numbers) says how many edges of the cell lie between the second grain of a
contact and its image that is touched; branch = x_second + shift @ cell - x_first.
"""

from typing import Protocol

import numpy as np

from talus.faults import FaultError

MOST_SHIFT = 4095  # that talus-dem can tell apart
LESS = 1.0 - 1e-9  # an edge is not changed for one as long


class Contacts(Protocol):
    """What is used here of a packing."""

    id: np.ndarray
    x: np.ndarray
    cell: np.ndarray | None
    pairs: np.ndarray
    tangential: np.ndarray
    shift: np.ndarray | None

    @property
    def count(self) -> int:
        """Number of grains."""


def check_shifts(shift: np.ndarray, rows: int, in_cell: bool, place: str) -> None:
    """Raise a fault (E504) for shifts of so many contacts that are no triples of small integers."""
    if shift.shape != (rows, 3) or shift.dtype.kind not in "iu":
        text = f"contacts: shift {shift.shape} of {shift.dtype}"
        raise FaultError("E504", text, f"{rows} rows of three whole numbers", place)
    far = (shift < -MOST_SHIFT) | (shift > MOST_SHIFT)
    if far.any():
        text = f"a contact is with an image {shift[far.any(axis=1)][0].tolist()} edges away"
        raise FaultError("E504", text, f"{MOST_SHIFT} at most, as a rule -1, 0 or 1", place)
    if shift.any() and not in_cell:
        raise FaultError("E504", "contacts over faces, but no cell", "", place)


def reduced(cell: np.ndarray) -> np.ndarray:
    """Return whole numbers (3, 3) whose product with the edges (3, 3) is a basis of short ones."""
    whole, edges = np.eye(3, dtype=np.int64), np.array(cell, float)
    for _ in range(1000):
        changed = False
        for i in range(3):
            for j in range(3):
                if i == j:
                    continue
                m = int(np.rint(LESS * edges[i] @ edges[j] / (edges[j] @ edges[j])))
                if m:
                    whole[i] -= m * whole[j]
                    edges[i] -= m * edges[j]
                    changed = True
        if not changed:
            break
    return whole


def nearest_shifts(apart: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Return the shifts (m, 3) that make vectors (m, 3) between grains shortest, in a cell [m]."""
    whole = reduced(cell)
    edges = whole @ cell
    first = -np.rint(apart @ np.linalg.inv(edges)).astype(np.int64)
    best, least = np.zeros_like(first), np.full(len(apart), np.inf)
    for step in np.indices((3, 3, 3)).reshape(3, -1).T - 1:
        length = np.linalg.norm(apart + (first + step) @ edges, axis=1)
        closer = length < least
        best[closer] = (first + step)[closer]
        least = np.minimum(length, least)
    return best @ whole


def shifts_of(packing: Contacts) -> np.ndarray:
    """Return the shifts (m, 3) of contacts: those given, else of the nearest images."""
    if packing.shift is not None:
        return np.asarray(packing.shift, np.int64)
    if packing.cell is None:
        return np.zeros((len(packing.pairs), 3), np.int64)
    order = np.argsort(packing.id)
    rows = order[np.searchsorted(packing.id, packing.pairs, sorter=order)]
    return nearest_shifts(packing.x[rows[:, 1]] - packing.x[rows[:, 0]], packing.cell)


def joined_contacts(
    first: Contacts, other: Contacts
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return pairs, forces and shifts of two packings in the cell of the first, None without cell.

    Contacts of the other over faces of another cell than the first one's are left out.
    """
    shift, keep = shifts_of(other), np.ones(len(other.pairs), bool)
    if first.cell is None or other.cell is None or not np.array_equal(first.cell, other.cell):
        keep = ~shift.any(axis=1)
    pairs = np.concatenate([first.pairs, other.pairs[keep]])
    tangential = np.concatenate([first.tangential, other.tangential[keep]])
    if first.cell is None:
        return pairs, tangential, None
    return pairs, tangential, np.concatenate([shifts_of(first), shift[keep]])


def repeat_contacts(one: Contacts, whole: Contacts, places: np.ndarray, times: np.ndarray) -> None:
    """Give a repeated cell the contacts of one, ids from 1, in copies at places (copies, 3).

    The second of a contact lies in the copy that its shift leads to, over the faces of the whole
    in that of the other side.
    """
    if not len(one.pairs):
        return
    shift = shifts_of(one)
    to = places[:, None] + shift  # (copies, m, 3)
    over = np.floor_divide(to, times)
    copy = (to - over * times) @ [1, times[0], times[0] * times[1]]
    first = one.pairs[:, 0] + one.count * np.arange(len(places))[:, None]
    second = one.pairs[:, 1] + one.count * copy
    whole.pairs = np.stack([first, second], axis=-1).reshape(-1, 2)
    whole.tangential = np.tile(one.tangential, (len(places), 1))
    whole.shift = over.reshape(-1, 3)
