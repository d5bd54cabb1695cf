"""The stamp of a column: what it was made of and for, and its stresses by depth."""

from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from talus.checksum import edited, opened
from talus.column import Bed, Column
from talus.datasets import word
from talus.faults import FaultError
from talus.files import replaced
from talus.packing import Packing, read_packing, write_packing_file
from talus.tile_stamp import Stamp, hash_of

FORMAT = "talus-column"


@dataclass
class ColumnStamp:
    """Attributes of the group /column; lengths [m], stresses [Pa], positive in compression."""

    rows: int  # grains of the tile: ids are row + rows k
    layers: int
    tile: str  # hash of the tile
    floor: float  # thickness of the fixed grains, below z = 0
    height: float  # at which the free bed was cut
    surcharge: float
    gravity: float  # [m/s2]
    solid_fraction: float  # of the tile
    friction: float
    young: float
    poisson: float
    density: float
    mean_diameter: float
    replayed: np.ndarray  # (layers + 1, 3) normal stresses of the tile at borders of layers
    z: np.ndarray  # (n + 1) borders of slices
    stress: np.ndarray  # (n, 3, 3) of the slices, from contacts cut at the borders
    way: float  # that 95 of 100 inner grains do not exceed in coming to rest, in mean diameters
    hash: str = ""


def stamp_of(column: Column, tile: Stamp, rows: int, bed: Bed) -> ColumnStamp:
    """Return the stamp of a column of a tile of so many grains."""
    return ColumnStamp(
        rows, column.layers, tile.hash, column.floor, bed.height, bed.surcharge, bed.gravity,
        tile.solid_fraction, tile.friction, tile.young, tile.poisson, tile.density,
        tile.mean_diameter, column.replayed, column.profile.z, column.profile.stress, column.way,
    )  # fmt: skip


def write_column(path: Path, packing: Packing, stamp: ColumnStamp) -> None:
    """Write a column with its stamp, and in that the hash of what it holds."""
    stamp.hash = hash_of(packing)
    with replaced(path) as temporary:
        write_packing_file(temporary, packing)
        with edited(temporary) as file:
            attributes = file.create_group("column").attrs
            attributes["format"], attributes["version"] = np.bytes_(FORMAT), np.int32(1)
            for key, value in asdict(stamp).items():
                attributes[key] = stored(value)


def stored(value: object) -> object:
    """Return a value as an attribute of HDF5."""
    if isinstance(value, str):
        return np.bytes_(value)
    return np.int64(value) if isinstance(value, int) else np.asarray(value, np.float64)


def is_column(path: Path) -> bool:
    """Whether a file has the stamp of a column."""
    if path.suffix != ".h5":
        return False
    with opened(path) as file:
        return "column" in file and word(file["column"].attrs.get("format", b"")) == FORMAT


def read_column_stamp(path: Path) -> ColumnStamp:
    """Read the stamp of a column; none, or one of other grains, is a fault (E516)."""
    packing = read_packing(path)
    with opened(path) as file:
        attributes = dict(file["column"].attrs) if "column" in file else {}
    names = {field.name: field.type for field in fields(ColumnStamp)}
    if word(attributes.get("format", b"")) != FORMAT or not set(names) <= set(attributes):
        raise FaultError("E516", f"{path} is no column", "make one: talus pack column")
    found = {}
    for name, kind in names.items():
        value = attributes[name]
        if kind is str:
            found[name] = word(value)
        else:
            found[name] = int(value) if kind is int else np.asarray(value, float)[()]
    stamp = ColumnStamp(**found)
    if stamp.hash != hash_of(packing):
        raise FaultError("E516", f"{path} is not as the column was made: its hash differs")
    return stamp
