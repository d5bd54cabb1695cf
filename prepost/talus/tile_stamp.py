"""What a tile says of itself: measures of a packing in a cell, its stress from contacts, the stamp.

Stress is positive in compression.
"""

import hashlib
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from talus.checksum import edited, opened
from talus.datasets import word
from talus.faults import FaultError
from talus.files import replaced
from talus.forms import volumes
from talus.images import nearest_shifts, shifts_of
from talus.packing import Packing, read_packing, write_packing_file

FORMAT = "talus-tile"
SHARES = np.linspace(0.0, 1.0, 11)  # of the mass, at which the grading is given
STRESS_ERROR = 0.01  # of the mean stress, for it and for normal stresses that are held
ROUNDING = 1.0e-9  # of numbers that a stamp tells
TANGENT_ERROR = 1.0e-6  # of a tangential force, over the mean normal force
PARTS = (
    "id", "kind", "x", "quat", "axes", "v", "omega", "skew", "exponent", "cell", "corner", "pairs",
    "tangential", "shift",
)  # fmt: skip


@dataclass
class Stamp:
    """Attributes of the group /tile; lengths [m], stresses [Pa], forces of contacts [N]."""

    stress: np.ndarray  # (3, 3), of the contacts
    solid_fraction: float
    coordination: float  # contacts with a force, twice, a grain
    making_friction: float
    friction: float
    young: float
    poisson: float
    density: float
    mean_diameter: float
    openings: np.ndarray  # that SHARES of the mass pass, by the middle axis
    mean_wanted: float  # stress that was to be held
    normal_wanted: np.ndarray  # (3), stresses xx, yy, zz; not a number where only the mean was held
    anisotropy: float = np.nan  # of the stress, see anisotropy_of
    hash: str = ""

    def __post_init__(self) -> None:
        """Take the anisotropy of the stress where none is given."""
        if np.isnan(self.anisotropy):
            self.anisotropy = anisotropy_of(self.stress)


def anisotropy_of(stress: np.ndarray) -> float:
    """Deviatoric over mean stress, sqrt(3/2 s:s)/p of a stress (3, 3), shear stresses with it."""
    mean = np.trace(stress) / 3.0
    part = 0.5 * (stress + stress.T) - mean * np.eye(3)
    return float(np.sqrt(1.5 * (part * part).sum()) / mean)


def check_held(stamp: Stamp) -> None:
    """Raise a fault (E519) if the contacts do not bear the stresses that were to be held."""
    mean = np.trace(stamp.stress) / 3.0
    if not abs(mean / stamp.mean_wanted - 1.0) < STRESS_ERROR:
        text = f"the contacts of the tile bear {mean:.5g} Pa, not {stamp.mean_wanted:g}"
        raise FaultError("E519", text, "remove the stages hold and rest, and run it again")
    normal = np.diag(stamp.stress)
    off = np.abs(normal - stamp.normal_wanted) / mean
    if (off > STRESS_ERROR).any():  # never where it is not a number
        text = f"the contacts bear the normal stresses {listed(normal)} Pa"
        text += f", not {listed(stamp.normal_wanted)}"
        raise FaultError("E535", text, "more grains, another --seed, or --mean-only")


def listed(numbers: np.ndarray) -> str:
    """Return numbers with four digits and commas between."""
    return ", ".join(f"{number:.4g}" for number in numbers)


def mean_diameter(packing: Packing) -> float:
    """Diameter of the sphere with the mean volume of the grains [m]."""
    solid = volumes(packing.axes, packing.skew, packing.exponent)
    return float((6.0 / np.pi * solid.mean()) ** (1.0 / 3.0))


def solid_fraction(packing: Packing) -> float:
    """Volume of the grains over that of the cell [-]."""
    solid = volumes(packing.axes, packing.skew, packing.exponent).sum()
    return float(solid / np.linalg.det(packing.cell))


def openings_of(packing: Packing) -> np.ndarray:
    """Openings that SHARES of the mass pass by the middle axes of the grains [m]."""
    size = 2.0 * np.median(packing.axes, axis=1)
    order = np.argsort(size)
    mass = volumes(packing.axes, packing.skew, packing.exponent)[order]
    passing = np.cumsum(mass) / mass.sum()
    return np.interp(SHARES, np.append(0.0, passing), np.append(size[order][0], size[order]))


def branches(packing: Packing) -> np.ndarray:
    """Vectors (m, 3) from the first to the second grain of each contact, over the faces [m]."""
    rows = rows_of(packing, packing.pairs)
    return packing.x[rows[:, 1]] + shifts_of(packing) @ packing.cell - packing.x[rows[:, 0]]


def rows_of(packing: Packing, ids: np.ndarray) -> np.ndarray:
    """Rows of the grains with some ids."""
    order = np.argsort(packing.id)
    return order[np.searchsorted(packing.id, ids, sorter=order)]


def check_images(tile: Packing) -> None:
    """Raise a fault (E519) for contacts that reach too far, lie not nearest, or are there twice."""
    rows = rows_of(tile, tile.pairs)
    branch = branches(tile)
    reach = tile.axes.max(axis=1)[rows].sum(axis=1)
    if tile.formed:
        reach *= 2.0  # the octants of a form reach farther than its mean semi-axes
    nearest = nearest_shifts(tile.x[rows[:, 1]] - tile.x[rows[:, 0]], tile.cell)
    bad = (np.linalg.norm(branch, axis=1) > reach) | (nearest != shifts_of(tile)).any(axis=1)
    if bad.any():
        pair = tile.pairs[bad][0].tolist()
        raise FaultError("E519", f"grains {pair} cannot touch over the image of their contact")
    if len(np.unique(np.sort(tile.pairs, axis=1), axis=0)) < len(tile.pairs):
        raise FaultError("E519", "two grains touch twice, over different images", "more grains")


@dataclass
class Forces:
    """Contacts of a run in the order of the packing's: unit normals, forces on the second."""

    force: np.ndarray  # (m, 3) [N]
    normal: np.ndarray  # (m, 3)
    branch: np.ndarray  # (m, 3), of the packing [m]
    overlap: np.ndarray  # (m) [m]


def forces_of(packing: Packing, contacts: dict[str, np.ndarray]) -> Forces:
    """Return the forces of the contacts of a packing in a run of it.

    Contacts are those of a field file at the start of a run: ids, normals, forces on the second. A
    contact that the packing has not, or whose tangential force differs from that of the packing, is
    a fault (E519).
    """
    pairs, sign = ordered(contacts["ids"])
    own, own_sign = ordered(packing.pairs)
    key, own_key = (p[:, 0] * (1 + int(packing.id.max())) + p[:, 1] for p in (pairs, own))
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key, own_key, sorter=order), len(order) - 1)
    row = order[place]
    if len(key) != len(own_key) or (key[row] != own_key).any():
        text = f"a run has {len(key)} contacts, the packing {len(own_key)}"
        raise FaultError("E519", text, "it was not at rest: remove the last stages")
    force, normal = (contacts[name] * sign for name in ("force", "normal"))
    force, normal = (part[row] * own_sign for part in (force, normal))
    along = (force * normal).sum(axis=1, keepdims=True)
    apart = np.linalg.norm(force - along * normal - packing.tangential, axis=1).max()
    if apart > TANGENT_ERROR * np.abs(along).mean():
        text = f"tangential forces of a run differ by {apart:.3g} N from the packing's"
        raise FaultError("E519", text, "it was not at rest: remove the last stages")
    return Forces(force, normal, branches(packing), contacts["overlap"][row])


def measured_stress(tile: Packing, contacts: dict[str, np.ndarray]) -> tuple[np.ndarray, int]:
    """Return the stress (3, 3) of the contacts of a run of a tile [Pa], and their number."""
    found = forces_of(tile, contacts)
    stress = np.einsum("ki,kj->ij", found.force, found.branch) / np.linalg.det(tile.cell)
    return stress, len(found.force)


def ordered(pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs with the lower id first, and the sign (m, 1) that vectors take by it."""
    turned = pairs[:, 0] > pairs[:, 1]
    return np.sort(pairs, axis=1), np.where(turned, -1.0, 1.0)[:, None]


def hash_of(packing: Packing) -> str:
    """Return the SHA-256 of grains, contacts and cell, in the order in which they are stored."""
    total = hashlib.sha256()
    for name in PARTS:
        part = getattr(packing, name)
        if part is not None:
            kind = np.int64 if part.dtype.kind in "iu" else np.float64
            total.update(np.ascontiguousarray(part, kind).tobytes())
    return total.hexdigest()


def write_tile(path: Path, tile: Packing, stamp: Stamp) -> None:
    """Write a tile with its stamp, and in that the hash of what it holds, in the group /tile."""
    stamp.hash = hash_of(tile)
    with replaced(path) as temporary:
        write_packing_file(temporary, tile)
        with edited(temporary) as file:
            attributes = file.create_group("tile").attrs
            attributes["format"], attributes["version"] = np.bytes_(FORMAT), np.int32(2)
            attributes["passing"] = SHARES
            for key, value in asdict(stamp).items():
                attributes[key] = np.bytes_(value) if isinstance(value, str) else np.float64(value)


def read_stamp(path: Path) -> Stamp:
    """Read the stamp of a tile; none, or one of other grains, is a fault (E516).

    Stamps of version 1 have no stresses that were held: the mean is taken.
    """
    packing = read_packing(path)
    with opened(path) as file:
        attributes = dict(file["tile"].attrs) if "tile" in file else {}
    if word(attributes.get("format", b"")) == FORMAT and int(attributes.get("version", 2)) == 1:
        mean = np.trace(attributes.get("stress", np.zeros((3, 3)))) / 3.0
        attributes |= {"mean_wanted": mean, "normal_wanted": np.full(3, np.nan)}
        attributes |= {"anisotropy": np.nan}
    names = [field.name for field in fields(Stamp)]
    if word(attributes.get("format", b"")) != FORMAT or not set(names) <= set(attributes):
        raise FaultError("E516", f"{path} is no tile", "make one: talus pack tile")
    found = {name: attributes[name] for name in names}
    for name, value in found.items():
        found[name] = word(value) if name == "hash" else np.asarray(value, float)[()]
    stamp = Stamp(**found)
    if stamp.hash != hash_of(packing):
        raise FaultError("E516", f"{path} is not as the tile was made: its hash differs")
    check_told(path, stamp, packing)
    return stamp


def check_told(path: Path, stamp: Stamp, packing: Packing) -> None:
    """Raise a fault (E516) if numbers of a stamp do not belong together or to its packing."""
    told = {
        "solid fraction": (stamp.solid_fraction, solid_fraction(packing)),
        "mean diameter": (stamp.mean_diameter, mean_diameter(packing)),
        "coordination number": (stamp.coordination, 2.0 * len(packing.pairs) / packing.count),
        "anisotropy of the stress": (stamp.anisotropy, anisotropy_of(stamp.stress)),
    }
    for name, (said, found) in told.items():
        if not abs(said - found) <= ROUNDING * max(abs(found), 1.0e-3):
            text = f"{path}: the stamp tells a {name} of {said:.6g}, found is {found:.6g}"
            raise FaultError("E516", text, "make the tile again: talus pack tile")
    check_held(stamp)
