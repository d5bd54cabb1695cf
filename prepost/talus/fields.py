"""Field files run.h5 of the solvers: read single steps, follow grains, write VTU series."""

import copy
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from talus.datasets import DAMAGE, all_numbers, numbers, word
from talus.elements import KINDS, MESHIO
from talus.faults import FaultError
from talus.files import make_folder, replaced, write_text_file
from talus.forms import LEAST_EXPONENT, net_triangles, surface_points
from talus.measure import rotations
from talus.packing import (
    DRIVEN,
    FIXED,
    FREE,
    Packing,
    check_cell,
    check_packing,
    packing_of,
    read_packing,
)
from talus.polyhedron_view import mark_vertices, rounded_points, without_features

ALWAYS = ("id", "kind", "x", "quat", "axes")  # datasets of every step of grains
STRESSES = ("stress", "couple_stress", "micro_stress")
# datasets of solids that are no means over elements: as talus-fem writes them
OF_NODES = frozenset(
    ["u", "v", "reaction", "phi", "phi_rate", "reaction_couple", "reaction_phi"]
    + ["pore_pressure", "excess_pressure"]
    + [f"{name}_nodal" for name in STRESSES]
)
OF_POINTS = frozenset(["points_x", "state_points"] + [f"{name}_points" for name in STRESSES])
GHOST = 3  # kind of grains that a partner moves
MOVED = 1.0e-12  # displacement above which a fixed grain counts as moved [m]


@dataclass
class Cell:
    """Edges of a cell as rows (3, 3) [m], its corner [m], and which edges are periodic."""

    vectors: np.ndarray
    origin: np.ndarray
    periodic: np.ndarray

    def fold(self, x: np.ndarray) -> np.ndarray:
        """Return points (n, 3) moved by whole periodic edges into the cell."""
        whole = np.floor((x - self.origin) @ np.linalg.inv(self.vectors))
        return x - np.where(self.periodic, whole, 0.0) @ self.vectors

    def nearest(self, x: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return of all images of points x (n, 3) those nearest to others (n, 3)."""
        short = self.short_edges()
        whole = np.round((point - x) @ np.linalg.inv(short))
        return x + np.where(self.periodic, whole, 0.0) @ short

    def short_edges(self) -> np.ndarray:
        """Return edges of the same lattice that are as short as can be, row by row."""
        short, changed = self.vectors.copy(), True
        pairs = [(i, j) for i in range(3) for j in range(3) if i != j]
        while changed:
            changed = False
            for i, j in pairs:
                times = np.round((1.0 - 1.0e-9) * (short[i] @ short[j]) / (short[j] @ short[j]))
                if times and self.periodic[i] and self.periodic[j]:
                    short[i] -= times * short[j]
                    changed = True
        return short

    def flow(self, first: "Cell", x: np.ndarray) -> np.ndarray:
        """Return where the flow from an earlier cell has carried points (n, 3)."""
        return self.origin + (x - first.origin) @ np.linalg.inv(first.vectors) @ self.vectors


@dataclass
class Snapshot:
    """One step: time [s], grains sorted by id, fields of the solid, triangles of surfaces, cell."""

    time: float
    grains: dict[str, np.ndarray] = field(default_factory=dict)
    solid: dict[str, np.ndarray] = field(default_factory=dict)
    surfaces: dict[str, np.ndarray] = field(default_factory=dict)
    cell: Cell | None = None


class FieldFile:
    """A field file, open for reading; use it in a `with` statement."""

    def __init__(self, path: Path):
        """Open the file; a file that is missing, damaged or foreign is a fault."""
        self.path = path
        if not path.exists():
            raise FaultError("E542", f"no such file: {path}")
        try:
            self.file = h5py.File(path)
        except OSError as fault:
            raise FaultError("E542", f"{path} cannot be read: {fault}") from fault
        try:
            self.names = sorted(self.file["steps"]) if "steps" in self.file else []
        except DAMAGE as fault:
            raise FaultError("E542", f"{path} cannot be read: {fault.args[-1]}") from fault
        if not self.names:
            self.file.close()
            hint = "a field file (grains.h5, solid.h5) of a run with output is wanted"
            raise FaultError("E543", f"{path} holds no steps", hint)

    def __enter__(self) -> "FieldFile":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.file.close()

    def __len__(self) -> int:
        """Number of steps."""
        return len(self.names)

    @property
    def mesh(self) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
        """Nodes (n, 3) [m] and elements by kind of a solid, or None for grains."""
        if "mesh" not in self.file:
            return None
        try:
            mesh = self.file["mesh"]
            cells = {kind: numbers(mesh[kind]) for kind in KINDS if kind in mesh}
            return numbers(mesh["x"]), cells
        except DAMAGE as fault:
            raise FaultError("E542", f"{self.path}, mesh: {fault.args[-1]}") from fault

    def places(self, step: int) -> tuple[np.ndarray, np.ndarray, Cell | None]:
        """Ids (n), centres (n, 3) [m] of the grains of a step, by id, and the cell."""
        try:
            group = self.file["steps"][self.names[step]]
            if "grains" not in group:
                return np.zeros(0, int), np.zeros((0, 3)), None
            number, x = numbers(group["grains/id"]), numbers(group["grains/x"])
            cell = None
            if "cell" in group:
                part = all_numbers(group["cell"])
                cell = Cell(part["vectors"], part["origin"], part["periodic"] > 0)
            order = np.argsort(number, kind="stable")
            return number[order], x[order], cell
        except DAMAGE as fault:
            raise FaultError("E542", f"{self.path}, step {step}: {fault.args[-1]}") from fault

    def entries(self) -> Iterator[Snapshot]:
        """Yield, step by step, the grains there (`id`, `x`) where they entered, and the first cell.

        A grain enters at the first step of an unbroken row of steps that hold it. With a cell the
        places are carried by its flow to the first step, so that all belong to one cell.
        """
        known, start, first = np.zeros(0, int), np.zeros((0, 3)), None
        for step in range(len(self)):
            number, x, cell = self.places(step)
            first = cell if step == 0 else first
            if step and first is not None and cell is not None:
                x = first.flow(cell, x)
            _, there, here = np.intersect1d(known, number, return_indices=True)
            x[here] = start[there]
            known, start = number, x
            found = {"id": known.copy(), "x": start.copy()}
            yield Snapshot(0.0, found, cell=copy.deepcopy(first))

    def entry(self, step: int) -> Snapshot:
        """Return the grains of a step where they entered: see `entries`."""
        return next(itertools.islice(self.entries(), step % len(self), None))

    def read(self, step: int) -> Snapshot:
        """Read one step; negative numbers count from the end."""
        if not -len(self) <= step < len(self):
            raise FaultError("E544", f"{self.path} has no step {step}", f"it has {len(self)} steps")
        try:
            group = self.file["steps"][self.names[step]]
            found = Snapshot(float(np.ravel(group.attrs["time"])[0]))
            if "grains" in group:
                grains = all_numbers(group["grains"])
                missing = [name for name in ALWAYS if name not in grains]
                if missing:
                    raise KeyError(f"no dataset grains/{missing[0]}")
                odd = [name for name in grains if grains[name].shape[:1] != grains["id"].shape]
                if odd:
                    raise KeyError(f"grains/{odd[0]} has another number of rows than grains/id")
                order = np.argsort(grains["id"], kind="stable")
                found.grains = {name: data[order] for name, data in grains.items()}
                if "clumps" in group:
                    mark_vertices(found.grains, all_numbers(group["clumps"]))
            if "surfaces" in group:
                found.surfaces = all_numbers(group["surfaces"])
                missing = [name for name in ("x", "triangles") if name not in found.surfaces]
                if missing:
                    raise KeyError(f"no dataset surfaces/{missing[0]}")
            if "cell" in group:
                part = all_numbers(group["cell"])
                check_cell(part["vectors"], part["origin"], str(self.path))
                found.cell = Cell(part["vectors"], part["origin"], part["periodic"] > 0)
            datasets = (item for item in group.items() if isinstance(item[1], h5py.Dataset))
            found.solid = {name: numbers(data) for name, data in datasets}
        except DAMAGE as fault:
            raise FaultError("E542", f"{self.path}, step {step}: {fault.args[-1]}") from fault
        return found


def read_grains(path: Path, step: int = -1) -> tuple[Packing, np.ndarray | None]:
    """Read a packing, or a step of a field file with the forces on the grains (n, 3) [N]."""
    if path.suffix not in (".h5", ".hdf5") or not has_steps(path):
        return read_packing(path), None
    with FieldFile(path) as fields:
        grains = fields.read(step).grains
    if not grains:
        raise FaultError(
            "E543", f"{path} holds no grains", "the field file of the grains is wanted"
        )
    known = np.isin(grains["kind"], (FREE, FIXED, DRIVEN))
    kinds = np.where(known, grains["kind"], FIXED)  # ghosts are walls here
    packing = packing_of(grains | {"kind": kinds}, {}, path)
    check_packing(packing, str(path))
    return packing, grains.get("force")


def has_steps(path: Path) -> bool:
    """Whether a file is a field file."""
    try:
        with h5py.File(path) as file:
            return "steps" in file
    except DAMAGE:
        return False


def of_a_grid(path: Path) -> bool:
    """Whether a field file holds fields of a grid among grains, and neither grains nor a solid."""
    with h5py.File(path) as file:
        return word(file.attrs.get("format", b"")) in ("talus-grid", "talus-pore", "talus-contacts")


def displacement(first: dict[str, np.ndarray], now: dict[str, np.ndarray]) -> np.ndarray:
    """Displacement of the grains of `now` since `first` (n, 3) [m]; NaN where not there then."""
    moved = np.full(now["x"].shape, np.nan)
    _, there, here = np.intersect1d(first["id"], now["id"], return_indices=True)
    moved[here] = now["x"][here] - first["x"][there]
    return moved


def ghost_rows(first: dict[str, np.ndarray], now: dict[str, np.ndarray]) -> np.ndarray:
    """Rows of the ghosts: grains of kind ghost, or else fixed grains that have moved."""
    ghosts = np.flatnonzero(now["kind"] == GHOST)
    if ghosts.size:
        return ghosts
    moved = np.linalg.norm(displacement(first, now), axis=1) > MOVED
    return np.flatnonzero(moved & (now["kind"] == FIXED))


def convert_to_vtu(
    source: Path, target: Path, watch: object = iter, surfaces: bool = False
) -> list[Path]:
    """Write every step as VTU and a .pvd that ties them together; return the files written.

    With `surfaces` grains are written as the triangles of their surfaces.
    """
    import meshio

    if target.suffix not in ("", ".vtu"):
        raise FaultError("E555", f"'{target}' is no folder and no name ending in .vtu")
    folder, stem = (target.parent, target.stem) if target.suffix else (target, source.stem)
    written, rows = [], []
    with FieldFile(source) as fields:
        make_folder(folder)
        mesh = fields.mesh
        steps: Iterable[int] = watch(range(len(fields)))
        for step in steps:
            snapshot = fields.read(step)
            if mesh:
                made = vtu_of_solid(snapshot, mesh)
            elif not snapshot.grains:
                raise FaultError("E543", f"{source} holds neither grains nor a mesh")
            else:
                made = vtu_of_surfaces(snapshot) if surfaces else vtu_of_grains(snapshot)
            path = folder / f"{stem}_{step:06d}.vtu"
            with replaced(path) as temporary:
                meshio.write(temporary, made)
            written.append(path)
            rows.append(f'<DataSet timestep="{snapshot.time!r}" part="0" file="{path.name}"/>')
    pvd = folder / f"{stem}.pvd"
    write_text_file(
        pvd,
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
        + "\n".join(rows)
        + "\n</Collection>\n</VTKFile>\n",
    )
    return [*written, pvd]


def vtu_of_grains(snapshot: Snapshot) -> object:
    """Return the grains as points with all their fields.

    `ellipsoid` (9) is the tensor R diag(a, b, c) R^T [m] that a tensor glyph draws as the grain
    (from spheres of radius 1).
    """
    import meshio

    grains = dict(snapshot.grains)
    x = grains.pop("x")
    if "quat" in grains and "axes" in grains:
        turn = rotations(grains["quat"])
        tensor = np.einsum("nij,nj,nkj->nik", turn, grains["axes"], turn)
        grains["ellipsoid"] = tensor.reshape(-1, 9)
    return meshio.Mesh(x, [("vertex", np.arange(len(x))[:, None])], point_data=grains)


def vtu_of_surfaces(snapshot: Snapshot) -> object:
    """Return the surfaces of the grains, of any form, as triangles; their fields are of cells."""
    import meshio

    if not {"quat", "axes"} <= snapshot.grains.keys():
        raise FaultError("E543", "the field file holds no shapes of grains")
    grains = without_features(snapshot.grains)
    n = len(grains["x"])
    skew = grains.get("skew", np.zeros((n, 3)))
    exponent = grains.get("exponent", np.full(n, LEAST_EXPONENT))
    normals, triangles = net_triangles(8)
    local = surface_points(grains["axes"], skew, exponent, normals)
    points = np.einsum("nij,npj->npi", rotations(grains["quat"]), local) + grains["x"][:, None, :]
    bodies = np.flatnonzero(snapshot.grains.get("vertices", np.zeros(0)) > 0)
    points[grains.get("vertices", np.zeros(n)) > 0] = rounded_points(
        snapshot.grains, bodies, normals
    )
    cells = triangles[None] + (np.arange(n) * len(normals))[:, None, None]
    data = {
        name: [np.repeat(values, len(triangles), axis=0)]
        for name, values in grains.items()
        if name not in ("x", "quat", "axes", "skew", "exponent")
    }
    return meshio.Mesh(points.reshape(-1, 3), [("triangle", cells.reshape(-1, 3))], cell_data=data)


def vtu_of_solid(snapshot: Snapshot, mesh: tuple[np.ndarray, dict[str, np.ndarray]]) -> object:
    """Return the solid with all fields of nodes and of elements; `OF_POINTS` stay in HDF5.

    Where a field belongs its name says (manual, Files), not its length; another length is E542.
    """
    import meshio

    x, elements = mesh
    ends = np.cumsum([len(rows) for rows in elements.values()])
    points, cells = {}, {}
    for name, data in snapshot.solid.items():
        if name in OF_POINTS:
            continue
        nodal = name in OF_NODES
        count = len(x) if nodal else int(ends[-1])
        if data.shape[:1] != (count,):
            what = "nodes" if nodal else "elements"
            text = f"the field {name} at {snapshot.time:g} s has the shape {data.shape}"
            raise FaultError("E542", f"{text}, and the mesh {count} {what}")
        if nodal:
            points[name] = data
        else:
            cells[name] = np.split(data, ends[:-1])
    blocks = [(MESHIO[kind], for_meshio(kind, rows)) for kind, rows in elements.items()]
    return meshio.Mesh(x, blocks, point_data=points, cell_data=cells)


def for_meshio(kind: str, cells: np.ndarray) -> np.ndarray:
    """Return elements so that meshio writes them in our order: it turns wedges over in VTU files.

    VTK has faces outward with the order of gmsh, which is ours.
    """
    return cells[:, [0, 2, 1, 3, 5, 4]] if kind == "wedge6" else cells
