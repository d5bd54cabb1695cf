"""Meshes from gmsh files: nodes and elements through meshio, physical groups by our own reader.

meshio keeps one physical group of an entity and one name of those that several dimensions share,
so tables of names and entities are read here and cut out of the copy that meshio reads.
"""

import contextlib
import io
import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.elements import FACETS, KINDS, MESHIO
from talus.faults import FaultError
from talus.mesh import Facets, Mesh, element_counts, facet_parts, sorted_corners

DIMENSIONS = ("point", "curve", "surface", "volume")
KNOWN = {MESHIO[kind]: kind for kind in (*KINDS, *FACETS)}
FORMAT = re.compile(rb"\A(?:\$Comments.*?\$EndComments\s*)?\$MeshFormat\s+(\S+)\s+([01])\s+(\d+)",
                    re.DOTALL)  # fmt: skip
TABLES = re.compile(rb"^\$(PhysicalNames|Entities|PartitionedEntities)[ \t]*\r?\n", re.MULTILINE)
NAME = re.compile(r'\s*(\d+)\s+(-?\d+)\s+"(.*)"\s*')
LONGEST = 64  # bytes of a name that talus-fem tells apart
HINT = "a whole .msh file of gmsh (2.2 or 4.1) is wanted"

Group = tuple[int, int]  # dimension and number
Parts = dict[str, list[np.ndarray]]


@dataclass
class Tables:
    """Physical groups of a gmsh file: names, and of version 4 the numbers for every entity."""

    names: dict[Group, str] = field(default_factory=dict)
    entities: dict[Group, set[int]] | None = None

    def name(self, group: Group) -> str:
        """Name of a group, made of dimension and number where it has none."""
        dim, number = group
        return self.names.get(group) or f"{DIMENSIONS[dim]}_{number}"

    def title(self, group: Group) -> str:
        """Name, dimension and number of a group for messages."""
        dim, number = group
        return f"'{self.name(group)}' (physical {DIMENSIONS[dim]} {number})"

    def all(self) -> set[Group]:
        """All groups that the file says it has."""
        entities = (self.entities or {}).items()
        return set(self.names) | {(dim, n) for (dim, _), found in entities for n in found}


def from_gmsh(path: Path) -> Mesh:
    """Read a gmsh file of first or second order with all its physical groups.

    Groups of volumes become volume groups, those of surfaces facet groups, those of curves, of
    points and of surfaces inside the mesh node groups. Elements that the file has twice, as
    version 2.2 of those in two groups, count once. Faults E520, E524, E525, E529.
    """
    data, tables = read_gmsh(path)
    check_types(path, data)
    blocks = [KNOWN.get(block.type, block.type) for block in data.cells]
    rows = [np.asarray(block.data) for block in data.cells]
    wanted = {kind: [r for k, r in zip(blocks, rows, strict=True) if k == kind] for kind in KINDS}
    cells, renumber = once({kind: np.concatenate(r) for kind, r in wanted.items() if r})
    known: dict[Group, Parts] = {}
    row = dict.fromkeys(KINDS, 0)
    for kind, part, members in zip(blocks, rows, all_members(path, data, tables), strict=True):
        for group, chosen in members.items():
            what = renumber[kind][row[kind] + chosen] if kind in KINDS else part[chosen]
            known.setdefault(group, {}).setdefault(kind, []).append(what)
        if kind in KINDS:
            row[kind] += len(part)
    check_groups(path, tables, known)
    mesh = Mesh(data.points, cells)
    place_groups(path, mesh, tables, known)
    return without_unused(mesh)


def check_types(path: Path, data: object) -> None:
    """Raise fault E525 unless there are volume elements, all of known kinds."""
    found = sorted({block.type for block in data.cells})
    if not found:
        raise FaultError("E525", f"{path} holds no elements", "save a mesh of volumes")
    others = {name for name in found if name not in KNOWN and not name.startswith("line")}
    if others - {"vertex"} or not any(KNOWN.get(name) in KINDS for name in found):
        raise FaultError(
            "E525",
            f"{path} has cells of type {', '.join(found)}; known are "
            f"{', '.join(MESHIO[kind] for kind in KINDS)}",
            "mesh volumes with these, of first or second order",
        )


def once(cells: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return elements without those that come twice, and by kind the new number of each."""
    kept, numbers, start = {}, {}, 0
    for kind, rows in cells.items():
        _, first, place = np.unique(
            np.sort(rows, axis=1), axis=0, return_index=True, return_inverse=True
        )
        order = np.argsort(first)
        rank = np.empty(len(order), int)
        rank[order] = np.arange(len(order))
        kept[kind] = rows[first[order]]
        numbers[kind] = start + rank[place.ravel()]
        start += len(order)
    return kept, numbers


def dimension(kind: str) -> int:
    """Dimension of a kind of element, ours or meshio's."""
    if kind in KINDS:
        return 3
    return 2 if kind in FACETS else int(kind != "vertex")


def all_members(path: Path, data: object, tables: Tables) -> list[dict[Group, np.ndarray]]:
    """Return of every block the rows that belong to each group."""
    name = "gmsh:physical" if tables.entities is None else "gmsh:geometrical"
    tags = data.cell_data.get(name, [np.zeros(len(block.data), int) for block in data.cells])
    members = []
    for block, tag in zip(data.cells, tags, strict=True):
        dim = dimension(KNOWN.get(block.type, block.type))
        found: dict[Group, np.ndarray] = {}
        for value in np.unique(tag).tolist():
            numbers = {abs(value)} - {0}
            if tables.entities is not None:
                if (dim, value) not in tables.entities:
                    text = f"{path}: {DIMENSIONS[dim]} {value} has elements but is no entity"
                    raise FaultError("E520", text, HINT)
                numbers = tables.entities[dim, value]
            for number in numbers:
                rows = np.flatnonzero(tag == value)
                before = found.get((dim, number), np.zeros(0, int))
                found[dim, number] = np.concatenate([before, rows])
        members.append(found)
    return members


def check_groups(path: Path, tables: Tables, known: dict[Group, Parts]) -> None:
    """Raise fault E529 for groups without elements, and for names that cannot be kept."""
    missing = sorted(tables.all() - set(known))
    if missing:
        raise FaultError(
            "E529",
            f"{path}: the group {tables.title(missing[0])} has no elements in the file",
            "mesh and save what it holds; with Mesh.SaveAll version 2.2 leaves groups out, 4.1 not",
        )
    owners: dict[tuple[int, str], Group] = {}
    for group in sorted(known):
        name = tables.name(group)
        if "/" in name or name == "." or len(name.encode()) > LONGEST:
            text = f"{path}: the group {tables.title(group)} cannot be named so in mesh.h5"
            raise FaultError("E529", text, f"a name without '/', of up to {LONGEST} bytes")
        other = owners.setdefault((group[0], name), group)
        if other != group and not (other in tables.names and group in tables.names):
            raise clash(path, tables, other, group)


def clash(path: Path, tables: Tables, one: Group, two: Group) -> FaultError:
    """Return fault E529 of two groups that would have one name."""
    text = f"{path}: {tables.title(one)} and {tables.title(two)} would be one group of mesh.h5"
    return FaultError("E529", text, "give them names of their own; a deck knows groups by name")


def place_groups(path: Path, mesh: Mesh, tables: Tables, known: dict[Group, Parts]) -> None:
    """Put the groups into the mesh: elements, facets or nodes."""
    check_nodes(path, mesh, tables, known)
    inner = inner_groups(path, mesh, tables, known)
    holders: dict[str, dict[int, Group]] = {}
    for group in sorted(known, key=lambda group: (-group[0], group[1])):
        name, parts = tables.name(group), known[group]
        # a dimension for each place; in one place only groups of one dimension are joined
        place = 0 if group in inner else max(group[0] - 1, 0)
        held = holders.setdefault(name, {})
        first = held.setdefault(place, group)
        if first[0] != group[0] or (0 in held and len(held) > 1):
            raise clash(path, tables, next(iter(held.values())), group)
        if place == 1:
            facets = {kind: np.concatenate(rows) for kind, rows in parts.items()}
            mesh.facets[name] = joined(mesh.facets.get(name, {}), facets)
            continue
        folder = mesh.volumes if place == 2 else mesh.nodes
        rows = [part.ravel() for kind in parts.values() for part in kind]
        folder[name] = np.unique(np.concatenate([folder.get(name, np.zeros(0, int)), *rows]))


def check_nodes(path: Path, mesh: Mesh, tables: Tables, known: dict[Group, Parts]) -> None:
    """Raise fault E529 for a group of surfaces, curves or points with nodes of no volume."""
    used = np.zeros(len(mesh.x), bool)
    for rows in mesh.cells.values():
        used[rows] = True
    for group, parts in known.items():
        if group[0] == 3:
            continue
        nodes = np.unique(np.concatenate([part.ravel() for k in parts.values() for part in k]))
        if not used[nodes].all():
            text = (
                f"{path}: {np.sum(~used[nodes])} of the {len(nodes)} nodes of the group "
                f"{tables.title(group)} belong to no volume element"
            )
            raise FaultError("E529", text, "leave out of the group what bounds no meshed volume")


def inner_groups(path: Path, mesh: Mesh, tables: Tables, known: dict[Group, Parts]) -> set[Group]:
    """Return groups of facets between two elements; fault E524 where only some facets are such."""
    keys = {
        group: np.concatenate([sorted_corners(k, part) for k in parts for part in parts[k]])
        for group, parts in known.items()
        if group[0] == 2
    }
    if not keys:
        return set()
    counts = element_counts(mesh.cells, np.concatenate(list(keys.values())))
    ends = np.cumsum([len(rows) for rows in keys.values()])[:-1]
    inner = set()
    for group, count in zip(keys, np.split(counts, ends), strict=True):
        if (count > 1).all():
            inner.add(group)
        elif (count > 1).any():
            raise FaultError(
                "E524",
                f"{path}: of the {len(count)} facets of the group {tables.title(group)} "
                f"{np.sum(count > 1)} lie inside the mesh, between two elements, the others on "
                "its surface",
                "part it in two: a group of inner surfaces alone becomes a node group",
            )
    return inner


def joined(before: Facets, facets: dict[str, np.ndarray]) -> Facets:
    """Facets of both, each once: of one kind as an array, of several as a dict."""
    whole: dict[str, np.ndarray] = {}
    earlier = facet_parts(before) if len(before) else {}
    for kind in FACETS:
        rows = [part[kind] for part in (earlier, facets) if kind in part]
        if not rows:
            continue
        rows = np.concatenate(rows)
        _, first = np.unique(sorted_corners(kind, rows), axis=0, return_index=True)
        whole[kind] = rows[np.sort(first)]
    return whole if len(whole) > 1 else next(iter(whole.values()))


def read_gmsh(path: Path) -> tuple[object, Tables]:
    """Return what meshio reads of a file, and the tables of groups that it does not."""
    if not path.is_file():
        raise FaultError("E520", f"{path}: there is no such file")
    whole = path.read_bytes()
    head = FORMAT.match(whole)
    if not head:
        return read_foreign(path, path), Tables()
    version, binary = head[1].decode(errors="replace"), head[2] == b"1"
    if version in ("4", "4.0"):  # gmsh writes 4
        raise FaultError("E520", f"{path} is of version 4.0 of gmsh's form", HINT)
    bodies, rest = cut_tables(path, whole)
    try:
        tables = Tables(physical_names(bodies.get("PhysicalNames", b"")))
        if version.startswith("4"):
            tables.entities = {}
            for name in ("Entities", "PartitionedEntities"):
                if name in bodies:
                    stream = Stream(bodies[name], binary, int(head[3]))
                    tables.entities |= read_entities(stream, name.startswith("Part"))
    except (ValueError, OverflowError, TypeError) as fault:
        raise FaultError("E520", f"{path}: a table of groups is damaged: {fault}", HINT) from fault
    if tables.entities == {}:  # version 4 may lack the table
        tables.entities = None
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"copy{path.suffix}"
        copy.write_bytes(rest)
        return read_foreign(copy, path), tables


def cut_tables(path: Path, whole: bytes) -> tuple[dict[str, bytes], bytes]:
    """Return the tables of groups of a file by name, and the file without them."""
    bodies, rest, at = {}, [], 0
    while found := TABLES.search(whole, at):
        end = whole.find(b"$End" + found[1], found.end())
        if end < 0:
            text = f"{path}: ${found[1].decode()} has no end"
            raise FaultError("E520", text, HINT)
        bodies[found[1].decode()] = whole[found.end() : end]
        rest.append(whole[at : found.start()])
        newline = whole.find(b"\n", end)
        at = len(whole) if newline < 0 else newline + 1
    return bodies, b"".join([*rest, whole[at:]])


def physical_names(body: bytes) -> dict[Group, str]:
    """Return the names of the groups; ValueError for lines that are none."""
    names = {}
    for line in body.decode(errors="replace").splitlines()[1:]:
        found = NAME.fullmatch(line)
        if not found and line.strip():
            raise ValueError(f"'{line.strip()}' in $PhysicalNames")
        if found:
            dim, number = int(found[1]), abs(int(found[2]))
            if dim >= len(DIMENSIONS):
                raise ValueError(f"dimension {dim} in $PhysicalNames")
            names[dim, number] = found[3]
    return names


class Stream:
    """Numbers of a table one after the other, in text or binary."""

    def __init__(self, body: bytes, binary: bool, size: int):
        """Take the table and the bytes of its counts."""
        self.words = None if binary else body.split()
        self.body, self.at = body, 0
        self.types = {"int": np.dtype("i4"), "count": np.dtype(f"u{size}"), "real": np.dtype("f8")}

    def take(self, kind: str, count: int = 1) -> list:
        """Return the next numbers; ValueError where the table ends before."""
        if self.words is None:
            values = np.frombuffer(self.body, self.types[kind], count, self.at).tolist()
            self.at += count * self.types[kind].itemsize
            return values
        words = self.words[self.at : self.at + count]
        if len(words) < count:
            raise ValueError("it ends too early")
        self.at += count
        return [float(word) if kind == "real" else int(word) for word in words]

    def counted(self) -> list[int]:
        """Return a list of integers that follows its length."""
        (count,) = self.take("count")
        if count < 0:
            raise ValueError(f"{count} numbers")
        return self.take("int", count) if count else []


def read_entities(stream: Stream, partitioned: bool) -> dict[Group, set[int]]:
    """Return the numbers of the physical groups of every entity (dimension, tag)."""
    if partitioned:
        stream.take("count")
        (ghosts,) = stream.take("count")
        for _ in range(ghosts):
            stream.take("int", 2)
    found = {}
    for dim, count in enumerate(stream.take("count", len(DIMENSIONS))):
        for _ in range(count):
            (tag,) = stream.take("int")
            if partitioned:
                stream.take("int", 2)  # parent
                stream.counted()
            stream.take("real", 6 if dim else 3)
            found[dim, tag] = {abs(number) for number in stream.counted()}
            if dim:
                stream.counted()  # its boundary
    return found


def read_foreign(path: Path, source: Path) -> object:
    """Read a file, a copy of `source`, through meshio; what it cannot read is fault E520."""
    import meshio

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(path)
    except SystemExit as fault:  # meshio exits when no reader of this ending accepts the file
        hint = "a whole .msh file of gmsh is wanted"
        raise FaultError("E520", f"{source} is not in the form of its ending", hint) from fault
    except Exception as fault:  # a damaged file may raise anything inside a reader
        raise FaultError("E520", f"{source} cannot be read: {fault}", HINT) from fault


def without_unused(mesh: Mesh) -> Mesh:
    """Drop nodes that belong to no element (gmsh keeps construction points)."""
    used = np.unique(np.concatenate([rows.ravel() for rows in mesh.cells.values()]))
    new = np.full(len(mesh.x), -1)
    new[used] = np.arange(len(used))
    facets = {
        name: {k: new[part] for k, part in group.items()} if isinstance(group, dict) else new[group]
        for name, group in mesh.facets.items()
    }
    nodes = {name: new[rows] for name, rows in mesh.nodes.items()}
    cells = {kind: new[rows] for kind, rows in mesh.cells.items()}
    return Mesh(mesh.x[used], cells, mesh.volumes, facets, nodes)
