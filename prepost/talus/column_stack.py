"""Copies of a tile on one another: places, contacts within and between layers, floor and surface.

Layer k holds the grains of the tile in a state of its own, with the numbers row + N k. A contact
over the upper face of the tile is one with the layer above; its tangential force is the mean of
those that the two layers have.
"""

from dataclasses import dataclass

import numpy as np

from talus.images import shifts_of
from talus.packing import FIXED, Packing
from talus.tile_stamp import rows_of


@dataclass
class Contacts:
    """Contacts of a tile by rows from 0, turned so that no shift along z is below 0."""

    first: np.ndarray  # (m)
    second: np.ndarray  # (m)
    shift: np.ndarray  # (m, 3)
    tangential: np.ndarray  # (m, 3), on the second [N]


def by_row(packing: Packing) -> Packing:
    """Return the grains in the order of their ids."""
    return packing.take(np.argsort(packing.id))


def like_tile(layer: Packing, tile: Packing) -> Packing:
    """Return a replayed tile, in the order of ids, whose grains are at the images of the tile's.

    A run folds grains that pass a face; contacts are told anew from where they were.
    """
    fresh, old = by_row(layer), by_row(tile)
    moved = (fresh.x - fresh.corner) @ np.linalg.inv(fresh.cell)
    moved -= (old.x - old.corner) @ np.linalg.inv(old.cell)
    return moved_by(fresh, -np.rint(moved).astype(np.int64))


def moved_by(packing: Packing, edges: np.ndarray) -> Packing:
    """Return a packing whose grains are moved by whole edges (n, 3), contacts told anew."""
    fresh = packing.take(np.arange(packing.count))
    rows = rows_of(packing, packing.pairs)
    fresh.x = packing.x + edges @ packing.cell
    fresh.shift = shifts_of(packing) + edges[rows[:, 0]] - edges[rows[:, 1]]
    return fresh


def folded(packing: Packing, axes: tuple[int, ...]) -> Packing:
    """Return a packing whose centres lie within the cell along some of its edges."""
    places = (packing.x - packing.corner) @ np.linalg.inv(packing.cell)
    edges = np.zeros((packing.count, 3), np.int64)
    edges[:, axes] = -np.floor(places[:, axes]).astype(np.int64)
    return moved_by(packing, edges)


def contacts_of(layer: Packing) -> Contacts:
    """Return the contacts of a layer in the order of ids, those over a face of z upwards."""
    rows, shift = rows_of(layer, layer.pairs), shifts_of(layer)
    down = shift[:, 2] < 0
    rows[down] = rows[down][:, ::-1]
    sign = np.where(down, -1, 1)[:, None]
    return Contacts(rows[:, 0], rows[:, 1], sign * shift, sign * layer.tangential)


def between(lower: Contacts, upper: Contacts, count: int) -> Contacts:
    """Return the contacts of a layer with the one above: of both, forces the mean of theirs."""
    parts = [over_face(lower), over_face(upper)]
    keys = [pair_keys(part, count) for part in parts]
    every, place = np.unique(np.concatenate(keys), return_inverse=True)
    number = np.bincount(place, minlength=len(every))
    force = np.zeros((len(every), 3))
    np.add.at(force, place, np.concatenate([part.tangential for part in parts]))
    first, shift = np.empty(len(every), np.int64), np.empty((len(every), 3), np.int64)
    second = np.empty(len(every), np.int64)
    first[place] = np.concatenate([part.first for part in parts])
    second[place] = np.concatenate([part.second for part in parts])
    shift[place] = np.concatenate([part.shift for part in parts])
    return Contacts(first, second, shift, force / number[:, None])


def over_face(contacts: Contacts) -> Contacts:
    """Return the contacts over the upper face."""
    over = contacts.shift[:, 2] > 0
    parts = (contacts.first, contacts.second, contacts.shift, contacts.tangential)
    return Contacts(*(part[over] for part in parts))


def pair_keys(contacts: Contacts, count: int) -> np.ndarray:
    """Return one number a pair and image."""
    x, y = contacts.shift[:, 0] + 1, contacts.shift[:, 1] + 1
    return ((contacts.first * count + contacts.second) * 3 + x) * 3 + y


def stack(layers: list[Packing]) -> Packing:
    """Stack layers (lowest first), each as `like_tile` returns it, in one cell.

    The cell is as high as all of them; ids are row + N k. Contacts over its lowest and highest face
    are left out.
    """
    count = layers[0].count
    own = [contacts_of(layer) for layer in layers]
    heights = np.array([layer.cell[2, 2] for layer in layers])
    base = np.append(0.0, np.cumsum(heights))
    whole = None
    for k, layer in enumerate(layers):
        copy = layer.take(np.arange(count))
        copy.x = layer.x - layer.corner + [0.0, 0.0, base[k]]
        copy.pairs, copy.tangential, copy.shift = np.empty((0, 2), int), np.empty((0, 3)), None
        copy = copy.numbered(np.arange(1, count + 1) + count * k)
        whole = copy if whole is None else whole.join(copy)
    whole.cell = np.diag([layers[0].cell[0, 0], layers[0].cell[1, 1], base[-1]])
    whole.corner = np.zeros(3)
    add_contacts(whole, own, count)
    return whole


def add_contacts(whole: Packing, own: list[Contacts], count: int) -> None:
    """Give a stack the contacts within its layers and between them."""
    pairs, forces, shifts = [], [], []
    for k, contacts in enumerate(own):
        inside = contacts.shift[:, 2] == 0
        pairs.append(np.stack([contacts.first, contacts.second], axis=1)[inside] + count * k)
        forces.append(contacts.tangential[inside])
        shifts.append(contacts.shift[inside])
        if k + 1 < len(own):
            over = between(contacts, own[k + 1], count)
            pairs.append(np.stack([over.first + count * k, over.second + count * (k + 1)], axis=1))
            forces.append(over.tangential)
            shifts.append(over.shift * [1, 1, 0])
    whole.pairs = 1 + np.concatenate(pairs)
    whole.tangential, whole.shift = np.concatenate(forces), np.concatenate(shifts)


def cut(whole: Packing, floor: float, height: float) -> Packing:
    """Fix the grains below a height [m], a group 'floor', and drop those above the surface.

    The top of the floor comes to z = 0; the cell reaches from the floor's bottom to its old height.
    """
    kept = whole.take(whole.x[:, 2] < floor + height)
    fixed = kept.x[:, 2] < floor
    kept.kind[fixed] = FIXED
    kept.groups["floor"] = kept.id[fixed]
    held = np.isin(kept.pairs, kept.id[fixed]).all(axis=1)  # talus-dem has no contacts of these
    kept.pairs, kept.tangential = kept.pairs[~held], kept.tangential[~held]
    kept.shift = kept.shift[~held]
    kept.x = kept.x - [0.0, 0.0, floor]
    kept.corner = np.array([0.0, 0.0, -floor])
    return folded(kept, (0, 1))
