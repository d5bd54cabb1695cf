"""Copies of a tile on one another: places, contacts within and between layers, floor and surface.

Layer k holds the grains of the tile with the numbers row + N k. It goes over from the state of the
tile at its lower border to that at its upper one, linearly by height: strain, what grains have
moved beyond it, turns and tangential forces. Two layers share the state between them, so that a
contact over the upper face of the tile, one with the layer above, is as the tile has it there.
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


def blended(tile: Packing, low: Packing, high: Packing, top: float = 1.0) -> Packing:
    """Return the layer between two states of a tile, each as `like_tile` returns it.

    The third edge of the cell, per height of the tile, goes linearly from that of the lower state
    to that of the upper: at the part s of the height the layer has come by l s + (h - l) s^2/2. The
    upper state is that of the part `top` of the height, and stays above. Eq. D.25 of the manual.
    """
    own = by_row(tile)
    part = (own.x[:, 2:] - own.corner[2]) / own.cell[2, 2]
    flat = (own.x - own.corner) * [1.0, 1.0, 0.0]
    edges = [state.cell[2] for state in (low, high)]
    beyond = [state.x - state.corner - flat - part * state.cell[2] for state in (low, high)]
    layer = low.take(np.arange(low.count))
    below = np.minimum(part, top)
    affine = flat + edges[0] * below + 0.5 * (edges[1] - edges[0]) * below**2 / top
    affine += edges[1] * (part - below)
    whole = 0.5 * top * (edges[0] + edges[1]) + (1.0 - top) * edges[1]
    part = below / top
    layer.x = affine + (1.0 - part) * beyond[0] + part * beyond[1]
    layer.corner = np.zeros(3)
    layer.cell = np.stack([*low.cell[:2], whole])
    sign = np.sign((low.quat * high.quat).sum(axis=1, keepdims=True))
    quat = (1.0 - part) * low.quat + part * sign * high.quat
    layer.quat = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    height = (own.x[:, 2] - own.corner[2]) / (top * own.cell[2, 2])
    blend_contacts(layer, contacts_of(low), contacts_of(high), height, 1.0 / top)
    return layer


def blend_contacts(
    layer: Packing, low: Contacts, high: Contacts, part: np.ndarray, edge: float
) -> None:
    """Give a layer the contacts of both states; forces by the height of their middles.

    Heights and the edge of the tile are parts of that at which the upper state is reached. A
    contact that one state has not bears nothing there.
    """
    both = (low, high)
    first, second = (
        np.concatenate([getattr(c, name) for c in both]) for name in ("first", "second")
    )
    shift = np.concatenate([c.shift for c in both])
    middle = np.clip(0.5 * (part[first] + part[second] + shift[:, 2] * edge), 0.0, 1.0)
    weight = np.where(np.arange(len(first)) < len(low.first), 1.0 - middle, middle)
    force = weight[:, None] * np.concatenate([c.tangential for c in both])
    key = np.column_stack([first, second, shift])
    every, place = np.unique(key, axis=0, return_inverse=True)
    layer.tangential = np.zeros((len(every), 3))
    np.add.at(layer.tangential, np.ravel(place), force)
    layer.pairs = layer.id[every[:, :2]]
    layer.shift = every[:, 2:]


def stack(layers: list[Packing]) -> Packing:
    """Stack layers (lowest first), each as `blended` returns it, in one cell.

    The cell is as high as all of them; ids are row + N k. Contacts over its lowest and highest face
    are left out.
    """
    count = layers[0].count
    own = [contacts_of(layer) for layer in layers]
    base = np.concatenate(
        [np.zeros((1, 3)), np.cumsum([layer.cell[2] for layer in layers], axis=0)]
    )
    whole = None
    for k, layer in enumerate(layers):
        copy = layer.take(np.arange(count))
        copy.x = layer.x - layer.corner + base[k]
        copy.pairs, copy.tangential, copy.shift = np.empty((0, 2), int), np.empty((0, 3)), None
        copy = copy.numbered(np.arange(1, count + 1) + count * k)
        whole = copy if whole is None else whole.join(copy)
    whole.cell = np.diag([layers[0].cell[0, 0], layers[0].cell[1, 1], base[-1, 2]])
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
            over = ~inside
            second = contacts.second + count  # in the layer above
            pairs.append(np.stack([contacts.first, second], axis=1)[over] + count * k)
            forces.append(contacts.tangential[over])
            shifts.append(contacts.shift[over] * [1, 1, 0])
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
