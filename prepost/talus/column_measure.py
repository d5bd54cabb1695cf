"""What a column tells of itself: stress by depth, weights, motion in coming to rest."""

from dataclasses import dataclass

import numpy as np

from talus.forms import volumes
from talus.packing import FREE, Packing
from talus.tile_stamp import Forces, rows_of


@dataclass
class Profile:
    """Stress by slices as high as the tile's mean layer, lowest first; positive in compression."""

    z: np.ndarray  # (n + 1) borders of the slices, from the floor's top [m]
    stress: np.ndarray  # (n, 3, 3) [Pa]
    solid_fraction: np.ndarray  # (n), of the grains' centres


def slices_of(height: float, edge: float) -> np.ndarray:
    """Borders of slices of equal height, about that of the tile [m]."""
    return np.linspace(0.0, height, max(int(round(height / edge)), 1) + 1)


def slice_stress(packing: Packing, forces: Forces, z: np.ndarray) -> np.ndarray:
    """Stress (n, 3, 3) of slices with borders z (n + 1) [Pa]: branches are cut at the borders."""
    start = packing.x[rows_of(packing, packing.pairs)[:, 0], 2]
    ends = np.stack([start, start + forces.branch[:, 2]], axis=1)
    low, high = ends.min(axis=1), ends.max(axis=1)
    length = np.maximum(high - low, np.finfo(float).tiny)
    area = packing.cell[0, 0] * packing.cell[1, 1]
    stress = np.empty((len(z) - 1, 3, 3))
    for k in range(len(z) - 1):
        inside = np.clip(np.minimum(high, z[k + 1]) - np.maximum(low, z[k]), 0.0, None) / length
        product = np.einsum("k,ki,kj->ij", inside, forces.force, forces.branch)
        stress[k] = product / (area * (z[k + 1] - z[k]))
    return stress


def profile_of(packing: Packing, forces: Forces, edge: float, height: float) -> Profile:
    """Stress and solid fraction of a column up to a height [m], slices about an edge high."""
    z = slices_of(height, edge)
    solid = volumes(packing.axes, packing.skew, packing.exponent)
    area = packing.cell[0, 0] * packing.cell[1, 1]
    part = np.histogram(packing.x[:, 2], z, weights=solid)[0] / (area * np.diff(z))
    return Profile(z, slice_stress(packing, forces, z), part)


def weight_stress(packing: Packing, z: np.ndarray, weight: float, surcharge: float) -> np.ndarray:
    """Vertical stress (n) [Pa] that balances grains of weight [N/m3] above, mean of slices z."""
    solid = volumes(packing.axes, packing.skew, packing.exponent)
    area = packing.cell[0, 0] * packing.cell[1, 1]
    above = np.empty(len(z) - 1)
    for k in range(len(z) - 1):
        part = np.clip((packing.x[:, 2] - z[k]) / (z[k + 1] - z[k]), 0.0, 1.0)
        above[k] = (solid * part).sum() * weight / area
    return surcharge + above


def moved_places(before: Packing, after: Packing) -> np.ndarray:
    """Lengths (n) by which the grains of one packing have moved in another, over faces of x, y."""
    way = after.x[rows_of(after, before.id)] - before.x
    edges = before.cell.diagonal()[:2]
    way[:, :2] -= edges * np.rint(way[:, :2] / edges)
    return np.linalg.norm(way, axis=1)


def inner_rows(packing: Packing, height: float) -> np.ndarray:
    """Rows of the bearing grains below a height [m]."""
    return np.flatnonzero(bearing(packing) & (packing.x[:, 2] < height))


def bearing(packing: Packing, least: int = 3) -> np.ndarray:
    """Mask (n) of the free grains that stand in a frame of contacts: rattlers left out in turns."""
    rows = rows_of(packing, packing.pairs)
    fixed = packing.kind != FREE
    stays = np.ones(packing.count, bool)
    while True:
        live = stays[rows].all(axis=1)
        number = np.bincount(rows[live].ravel(), minlength=packing.count)
        lost = stays & ~fixed & (number < least)
        if not lost.any():
            return stays & ~fixed
        stays &= ~lost
