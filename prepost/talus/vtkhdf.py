"""VTKHDF: a run's field file as one file with all its times, for ParaView (5.12 or later) and VTK.

The layout is that of https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format (version
2.0, unstructured grid with steps). Grains are vertices with their fields and the tensor
`ellipsoid` of a tensor glyph, and may change in number; the mesh of a solid is held once.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from talus.elements import VTK
from talus.faults import FaultError
from talus.fields import FieldFile, Snapshot, vtu_of_grains, vtu_of_solid
from talus.files import make_folder, replaced

ENDING = ".vtkhdf"
VERTEX = 1  # type of a cell of VTK
VERSION = (2, 0)
CHUNK = 4096  # rows
OWNERS = ("PointData", "CellData")
COUNTS = ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds")
PLACES = ("PointOffsets", "CellOffsets", "ConnectivityIdOffsets")


@dataclass
class Grid:
    """Points (n, 3) [m] and cells: types (m), node numbers one behind the other, their ends."""

    points: np.ndarray
    types: np.ndarray
    connectivity: np.ndarray
    offsets: np.ndarray  # (m + 1)


def grid_of_points(x: np.ndarray) -> Grid:
    """Return a vertex at each point."""
    n = len(x)
    return Grid(x, np.full(n, VERTEX, np.uint8), np.arange(n), np.arange(n + 1))


def grid_of_mesh(x: np.ndarray, elements: dict[str, np.ndarray]) -> Grid:
    """Return the mesh of a solid; its order of nodes is that of VTK.

    Readers want node numbers and their ends in one type.
    """
    types = np.concatenate([np.full(len(rows), VTK[kind]) for kind, rows in elements.items()])
    sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in elements.values()])
    nodes = np.concatenate([rows.ravel() for rows in elements.values()]).astype(np.int64)
    return Grid(x, types.astype(np.uint8), nodes, np.concatenate([[0], np.cumsum(sizes)]))


def extend(group: h5py.Group, name: str, rows: np.ndarray) -> None:
    """Append rows to a dataset that grows."""
    rows = np.asarray(rows)
    if name not in group:
        shape = (CHUNK, *rows.shape[1:])
        limit = (None, *rows.shape[1:])
        group.create_dataset(name, (0, *rows.shape[1:]), rows.dtype, maxshape=limit, chunks=shape)
    data = group[name]
    data.resize(len(data) + len(rows), axis=0)
    data[len(data) - len(rows) :] = rows


def begin(file: h5py.File) -> h5py.Group:
    """Return the root group of a file with the attributes by which VTK knows it."""
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array(VERSION)
    text = b"UnstructuredGrid"
    root.attrs.create("Type", text, dtype=h5py.string_dtype("ascii", len(text)))
    root.create_group("Steps")
    for owner in OWNERS:
        root.create_group(owner)
        root["Steps"].create_group(f"{owner}Offsets")
    return root


def add_grid(root: h5py.Group, grid: Grid) -> None:
    """Append a part."""
    extend(root, "Points", grid.points)
    extend(root, "Types", grid.types)
    extend(root, "Connectivity", grid.connectivity)
    extend(root, "Offsets", grid.offsets)
    for name, count in zip(COUNTS, part_sizes(grid), strict=True):
        extend(root, name, np.array([count]))


def part_sizes(grid: Grid) -> tuple[int, int, int]:
    """Return the numbers of points, cells and node numbers of a part."""
    return len(grid.points), len(grid.types), len(grid.connectivity)


def add_step(root: h5py.Group, time: float, part: int, places: tuple[int, ...]) -> None:
    """Append a time and where its part begins."""
    steps = root["Steps"]
    extend(steps, "Values", np.array([time]))
    extend(steps, "NumberOfParts", np.array([1]))
    extend(steps, "PartOffsets", np.array([part]))
    for name, place in zip(PLACES, places, strict=True):
        extend(steps, name, np.array([place] if name == "PointOffsets" else [[place]]))
    steps.attrs["NSteps"] = len(steps["Values"])


def add_fields(root: h5py.Group, owner: str, fields: dict[str, np.ndarray]) -> None:
    """Append the fields of a step; each step has the same ones."""
    group, offsets = root[owner], root["Steps"][f"{owner}Offsets"]
    if len(root["Steps/Values"]) > 1 and set(group) != set(fields):
        other = ", ".join(sorted(set(group) ^ set(fields)))
        hint = "talus convert --to vtu writes a file a step"
        raise FaultError("E542", f"not all steps have the fields {other}", hint)
    for name, values in fields.items():
        before = len(group[name]) if name in group else 0
        extend(offsets, name, np.array([before]))
        extend(group, name, values)


def fields_of(
    snapshot: Snapshot, mesh: tuple | None
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the fields of points and of cells, as in a VTU file."""
    made = vtu_of_solid(snapshot, mesh) if mesh else vtu_of_grains(snapshot)
    cells = {name: np.concatenate(parts) for name, parts in made.cell_data.items()}
    return made.point_data, cells


def write_vtkhdf(source: Path, target: Path, watch: object = iter) -> int:
    """Write all steps of a field file into one VTKHDF file; return their number."""
    if target.suffix != ENDING:
        raise FaultError("E555", f"'{target}' does not end in {ENDING}")
    with FieldFile(source) as fields:
        make_folder(target.parent)
        with replaced(target) as temporary, h5py.File(temporary, "w") as file:
            write_steps(fields, begin(file), watch)
        return len(fields)


def write_steps(fields: FieldFile, root: h5py.Group, watch: object) -> None:
    """Write the steps of an open field file below the root group."""
    mesh = fields.mesh
    if mesh:
        add_grid(root, grid_of_mesh(*mesh))
    places = np.zeros(len(PLACES), int)
    steps: Iterable[int] = watch(range(len(fields)))
    for step in steps:
        snapshot = fields.read(step)
        if not mesh and not snapshot.grains:
            raise FaultError("E543", f"{fields.path} holds neither grains nor a mesh")
        add_step(root, snapshot.time, 0 if mesh else step, tuple(places))
        for owner, found in zip(OWNERS, fields_of(snapshot, mesh), strict=True):
            add_fields(root, owner, found)
        if not mesh:
            grid = grid_of_points(snapshot.grains["x"])
            add_grid(root, grid)
            places += part_sizes(grid)
