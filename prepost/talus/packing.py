"""Packings: the data of grains in memory, packing.h5 and the text form.

Arrays have one row a grain; SI units; quaternions are (w, x, y, z), body to space.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from talus.checksum import created, opened
from talus.clumps import Clumps, clumps_of, put_clumps
from talus.datasets import DAMAGE, all_numbers, word
from talus.faults import FaultError
from talus.files import refuse, replaced, write_text_file
from talus.forms import LEAST_EXPONENT, MOST_EXPONENT, MOST_SKEW, formed
from talus.images import check_shifts, joined_contacts, repeat_contacts

FREE, FIXED, DRIVEN = 0, 1, 2
UNIT = 1.0e-6  # how far the length of a quaternion may be from 1
LARGEST_ID = 2**31 - 1  # what decks can name
TEXT_ENDINGS = (".txt", ".text")
TEXT_COLUMNS = "id kind a b c x y z qw qx qy qz group"
FORM_COLUMNS = "skew_a skew_b skew_c exponent"  # behind them if some grain is no ellipsoid


@dataclass
class Packing:
    """Grains and their named groups; every array has n rows."""

    id: np.ndarray
    x: np.ndarray
    quat: np.ndarray
    axes: np.ndarray
    kind: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    cell: np.ndarray | None = None  # edges of a periodic cell as rows (3, 3) [m]
    corner: np.ndarray = field(default_factory=lambda: np.zeros(3))  # where it begins [m]
    skew: np.ndarray | None = None  # (upper - lower)/(upper + lower) of the semi-axes (n, 3)
    exponent: np.ndarray | None = None  # of superquadrics (n); 2 for all others
    pairs: np.ndarray = field(default_factory=lambda: np.empty((0, 2), np.int64))  # ids in contact
    tangential: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))  # on the second [N]
    surcharge: np.ndarray | None = None  # load of each grain, downwards (n) [N]
    shift: np.ndarray | None = None  # edges to the image of the second (m, 3); None: the nearest
    clumps: Clumps | None = None  # rigid grains whose spheres are among the grains

    def __post_init__(self) -> None:
        """Take ellipsoids where no forms are given."""
        if self.skew is None:
            self.skew = np.zeros((len(self.id), 3))
        if self.exponent is None:
            self.exponent = np.full(len(self.id), LEAST_EXPONENT)
        if self.surcharge is None:
            self.surcharge = np.zeros(len(self.id))

    @property
    def formed(self) -> bool:
        """Whether some grain is no ellipsoid."""
        return bool(formed(self.skew, self.exponent).any())

    @property
    def count(self) -> int:
        """Number of grains."""
        return len(self.id)

    def check_loose(self) -> None:
        """Raise a fault (E681) if some grains are spheres of clumps."""
        if self.clumps is not None:
            text = "a packing with clumps cannot be cut, renumbered, repeated, joined or converted"
            raise FaultError("E681", text, "make it anew: talus pack cloud --clumps")

    def take(self, keep: np.ndarray) -> "Packing":
        """Return the grains of a mask or index array; groups shrink with them. No clumps (E681)."""
        self.check_loose()
        ids = self.id[keep]
        groups = {name: g[np.isin(g, ids)] for name, g in self.groups.items()}
        both = np.isin(self.pairs, ids).all(axis=1)
        return Packing(
            ids, self.x[keep], self.quat[keep], self.axes[keep], self.kind[keep], self.v[keep],
            self.omega[keep], groups, self.cell, self.corner, self.skew[keep],
            self.exponent[keep], self.pairs[both], self.tangential[both], self.surcharge[keep],
            None if self.shift is None else self.shift[both],
        )  # fmt: skip

    def numbered(self, ids: np.ndarray) -> "Packing":
        """Return the grains under other ids (n), and so their groups and contacts."""
        order = np.argsort(self.id)

        def other(old: np.ndarray) -> np.ndarray:
            return ids[order[np.searchsorted(self.id, old, sorter=order)]]

        fresh = self.take(np.arange(self.count))
        fresh.id = np.asarray(ids, np.int64)
        fresh.groups = {name: np.sort(other(old)) for name, old in self.groups.items()}
        fresh.pairs = other(self.pairs)
        return fresh

    def renumbered(self, after: int) -> "Packing":
        """Return the grains numbered on after an id, in the order of their ids."""
        ordered = self.take(np.argsort(self.id))
        return ordered.numbered(np.arange(after + 1, after + 1 + self.count))

    def repeated(self, times: tuple[int, int, int]) -> "Packing":
        """Return the periodic cell laid side by side so many times along its edges.

        Ids are row + N (i + n_x (j + n_y k)): row from 1 in the order of the ids of the N grains,
        copy (i, j, k) from 0 of (n_x, n_y, n_z). Groups, contacts and loads go with their grains.
        A packing without a cell is a fault (E515).
        """
        if self.cell is None:
            hint = "make it with --periodic, or take the packing of a run with &cell"
            raise FaultError("E515", "only a periodic cell can be repeated, this has none", hint)
        places = np.indices(times[::-1]).reshape(3, -1).T[:, ::-1]  # (copies, 3), i runs first
        copies = [self.renumbered(0)] * len(places)
        whole = Packing(
            *(
                np.concatenate([getattr(part, key) for part in copies])
                for key in ("id", "x", "quat", "axes", "kind", "v", "omega")
            ),
            cell=self.cell * np.reshape(times, (3, 1)),
            corner=self.corner,
            skew=np.concatenate([part.skew for part in copies]),
            exponent=np.concatenate([part.exponent for part in copies]),
            surcharge=np.concatenate([part.surcharge for part in copies]),
        )
        step = self.count
        whole.id = np.arange(1, step * len(places) + 1)
        whole.x += np.repeat(places @ self.cell, step, axis=0)
        whole.groups = {
            name: (ids + step * np.arange(len(places))[:, None]).reshape(-1)
            for name, ids in copies[0].groups.items()
        }
        repeat_contacts(copies[0], whole, places, np.array(times))
        return whole

    def scaled(self, factor: float) -> "Packing":
        """Return all lengths times a factor; forces go with its square, so that stresses stay."""
        fresh = self.take(np.arange(self.count))
        for name in ("x", "axes", "v", "cell", "corner"):
            value = getattr(fresh, name)
            setattr(fresh, name, None if value is None else factor * value)
        fresh.tangential = factor**2 * fresh.tangential
        fresh.surcharge = factor**2 * fresh.surcharge
        return fresh

    def join(self, other: "Packing") -> "Packing":
        """Return both packings in one, in the cell of this one; ids must differ.

        Contacts over the faces of another cell than this one's are left out. No clumps (E681).
        """
        self.check_loose()
        other.check_loose()
        twice = np.intersect1d(self.id, other.id)
        if twice.size:
            raise FaultError("E503", f"grain id {twice[0]} is in both packings")
        groups = dict(self.groups)
        for name, ids in other.groups.items():
            groups[name] = np.concatenate([groups.get(name, np.empty(0, np.int64)), ids])
        pairs, tangential, shift = joined_contacts(self, other)
        return Packing(
            *(
                np.concatenate([getattr(self, key), getattr(other, key)])
                for key in ("id", "x", "quat", "axes", "kind", "v", "omega")
            ),
            groups=groups,
            cell=self.cell,
            corner=self.corner,
            skew=np.concatenate([self.skew, other.skew]),
            exponent=np.concatenate([self.exponent, other.exponent]),
            pairs=pairs,
            tangential=tangential,
            surcharge=np.concatenate([self.surcharge, other.surcharge]),
            shift=shift,
        )


def make_packing(
    x: np.ndarray,
    axes: np.ndarray,
    quat: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    ids: np.ndarray | None = None,
    groups: dict[str, np.ndarray] | None = None,
    v: np.ndarray | None = None,
    omega: np.ndarray | None = None,
) -> Packing:
    """Return a packing; what is not given is free, at rest, unturned, numbered from 1."""
    n = len(x)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    zero = np.zeros((n, 3))

    def filled(value: object, default: np.ndarray, dtype: type) -> np.ndarray:
        return np.array(default if value is None else value, dtype=dtype)

    return Packing(
        filled(ids, np.arange(1, n + 1), np.int64),
        np.array(x, float),
        filled(quat, upright, float),
        np.array(axes, float),
        filled(kind, np.zeros(n), np.int32),
        filled(v, zero, float),
        filled(omega, zero, float),
        {name: np.asarray(g, np.int64) for name, g in (groups or {}).items()},
    )


def version_of(packing: Packing) -> int:
    """Return the least version of the format that holds the packing."""
    if packing.clumps is None:
        return 2 if packing.formed else 1
    return 4 if any(t.corners is not None for t in packing.clumps.templates) else 3


def write_h5(path: Path, packing: Packing) -> None:
    """Write packing.h5 (to a temporary name, then renamed)."""
    with replaced(path) as temporary, created(temporary) as file:
        file.attrs["format"] = np.bytes_("talus-packing")
        file.attrs["version"] = np.int32(version_of(packing))
        grains = file.create_group("grains")
        grains["id"] = packing.id.astype(np.int64)
        grains["kind"] = packing.kind.astype(np.int32)
        forms = ("skew", "exponent") if packing.formed else ()
        forms += ("surcharge",) if packing.surcharge.any() else ()
        for name in ("x", "quat", "axes", "v", "omega", *forms):
            grains[name] = np.ascontiguousarray(getattr(packing, name), np.float64)
        if packing.clumps:
            put_clumps(file, packing.clumps)
        groups = file.create_group("groups")
        for name, ids in packing.groups.items():
            groups[name] = np.sort(ids).astype(np.int64)
        if len(packing.pairs):
            contacts = file.create_group("contacts")
            contacts["ids"] = packing.pairs.astype(np.int64)
            contacts["tangential"] = np.ascontiguousarray(packing.tangential, np.float64)
            if packing.shift is not None:
                contacts["shift"] = packing.shift.astype(np.int32)
        if packing.cell is not None:
            cell = file.create_group("cell")
            cell["vectors"] = np.ascontiguousarray(packing.cell, np.float64)
            cell["origin"] = np.ascontiguousarray(packing.corner, np.float64)


def read_h5(path: Path) -> Packing:
    """Read packing.h5."""
    try:
        with opened(path) as file:
            kind = word(file.attrs.get("format", b""))
            if kind != "talus-packing":
                raise FaultError("E502", f"{path} is no packing (format '{kind}')")
            grains = all_numbers(file["grains"])
            groups = all_numbers(file.get("groups", {}))
            cell = all_numbers(file.get("cell", {}))
            contacts = all_numbers(file.get("contacts", {}))
            rigid = all_numbers(file.get("clumps", {}))
            templates = all_numbers(file.get("templates", {}))
    except FileNotFoundError as fault:
        raise FaultError("E501", f"no such file: {path}", exit_code=1) from fault
    except DAMAGE as fault:
        reason = str(refuse(path, fault)).split(f"{path}: ", 1)[-1]
        raise FaultError("E502", f"{path} cannot be read as a packing: {reason}") from fault
    packing = packing_of(grains, groups, path)
    if "vectors" in cell:
        packing.cell, packing.corner = cell["vectors"], cell.get("origin", np.zeros(3))
        check_cell(packing.cell, packing.corner, str(path))
    packing.pairs = contacts.get("ids", packing.pairs)
    packing.tangential = contacts.get("tangential", packing.tangential)
    packing.shift = contacts.get("shift")
    if rigid:
        try:
            packing.clumps = clumps_of(templates, rigid)
        except KeyError as fault:
            raise FaultError("E502", f"{path} has no dataset {fault} of clumps") from fault
    return packing


def check_cell(vectors: np.ndarray, origin: np.ndarray, place: str) -> None:
    """Raise a fault (E502) for edges (3, 3) or a corner (3) of a cell that are none."""
    good = vectors.shape == (3, 3) and origin.shape == (3,)
    good = good and np.isfinite(vectors).all() and np.isfinite(origin).all()
    if not good or not np.linalg.det(vectors) > 0.0:
        text = f"the cell has edges {vectors.tolist()} and the corner {origin.tolist()}"
        raise FaultError("E502", text[:300], "three edges of a right-handed frame", place)


def packing_of(grains: dict[str, np.ndarray], groups: dict[str, np.ndarray], path: Path) -> Packing:
    """Return the packing of the datasets of a file; missing ones and other shapes are faults."""
    for name in ("x", "axes"):
        if name not in grains:
            raise FaultError("E502", f"{path} has no dataset /grains/{name}")
    n = len(grains["x"])
    width = {"x": (3,), "axes": (3,), "quat": (4,), "v": (3,), "omega": (3,), "kind": (), "id": ()}
    width |= {"skew": (3,), "exponent": (), "surcharge": ()}
    for name, shape in width.items():
        if name in grains and grains[name].shape != (n, *shape):
            text = f"/grains/{name} has the shape {grains[name].shape} instead of {(n, *shape)}"
            raise FaultError("E502", text, place=str(path))
    for name, ids in groups.items():
        if ids.ndim != 1 or ids.dtype.kind not in "iu":
            text = f"/groups/{name} has the shape {ids.shape} of {ids.dtype}, no list of ids"
            raise FaultError("E502", text, place=str(path))
    packing = make_packing(
        grains["x"], grains["axes"], grains.get("quat"), grains.get("kind"), grains.get("id"),
        groups, grains.get("v"), grains.get("omega"),
    )  # fmt: skip
    packing.skew = np.array(grains.get("skew", packing.skew), float)
    packing.exponent = np.array(grains.get("exponent", packing.exponent), float)
    packing.surcharge = np.array(grains.get("surcharge", packing.surcharge), float)
    return packing


def check_packing(packing: Packing, place: str) -> None:
    """Raise a fault for the first grain that no solver would take (E504), or an id twice (E503)."""
    ids = packing.id
    if not len(ids):
        raise FaultError("E502", "there are no grains", place=place)
    finite = {
        name: ~np.isfinite(getattr(packing, name)).all(axis=1)
        for name in ("x", "axes", "quat", "v", "omega")
    } | {"surcharge": ~np.isfinite(packing.surcharge)}
    tests = [(name, bad, "a finite number is wanted") for name, bad in finite.items()]
    length = np.linalg.norm(packing.quat, axis=1)
    tests += [
        ("axes", (packing.axes <= 0.0).any(axis=1), "all three semi-axes must be above 0"),
        (
            "skew",
            ~(np.abs(packing.skew) <= MOST_SKEW).all(axis=1),
            f"(upper - lower)/(upper + lower) of semi-axes lies within {MOST_SKEW:g}",
        ),
        (
            "exponent",
            ~((packing.exponent >= LEAST_EXPONENT) & (packing.exponent <= MOST_EXPONENT)),
            f"from {LEAST_EXPONENT:g}, an ellipsoid, to {MOST_EXPONENT:g}",
        ),
        ("kind", ~np.isin(packing.kind, (FREE, FIXED, DRIVEN)), "0 free, 1 fixed, 2 driven"),
        ("id", (ids < 1) | (ids > LARGEST_ID), f"ids lie from 1 to {LARGEST_ID}"),
        ("quat", np.abs(length - 1.0) > UNIT, "a quaternion must have the length 1"),
    ]
    for name, bad, hint in tests:
        if bad.any():
            row = np.flatnonzero(bad)[0]
            text = f"grain {ids[row]}: {name} = {getattr(packing, name)[row]}"
            raise FaultError("E504", f"{text} ({bad.sum()} such grains)", hint, place)
    check_contacts(packing, place)
    unique, count = np.unique(ids, return_counts=True)
    if (count > 1).any():
        raise FaultError("E503", f"id {unique[count > 1][0]} is there twice", "", place)
    for name, members in packing.groups.items():
        strangers = np.setdiff1d(members, ids)
        if strangers.size:
            text = f"group '{name}' names grain {strangers[0]}, which there is not"
            raise FaultError("E504", text, place=place)


def check_contacts(packing: Packing, place: str) -> None:
    """Raise a fault (E504) for contacts of strangers or forces that are no numbers."""
    rows = len(packing.pairs)
    if packing.pairs.shape != (rows, 2) or packing.tangential.shape != (rows, 3):
        text = f"contacts: ids {packing.pairs.shape}, tangential {packing.tangential.shape}"
        raise FaultError("E504", text, "each contact has a row of two and one of three", place)
    strangers = np.setdiff1d(packing.pairs, packing.id)
    if strangers.size:
        text = f"a contact is of grain {strangers[0]}, which there is not"
        raise FaultError("E504", text, "", place)
    if packing.shift is not None:
        check_shifts(packing.shift, rows, packing.cell is not None, place)
    if not np.isfinite(packing.tangential).all():
        text = "the tangential force of a contact is no finite number"
        raise FaultError("E504", text, "leave /contacts out, or make the packing again", place)


def write_text(path: Path, packing: Packing, header: str = "") -> None:
    """Write the text form; 17 digits, so that it reads back to the same bits. No clumps (E681).

    The last word of a row names the grain's groups with commas between; '-' is none.
    """
    packing.check_loose()
    members: dict[int, list[str]] = {int(i): [] for i in packing.id}
    for name, ids in packing.groups.items():
        if len(name.split()) != 1 or "," in name or name == "-":
            raise FaultError("E504", f"the text form cannot hold a group called '{name}'")
        for i in ids:
            members[int(i)].append(name)
    titles = f"{TEXT_COLUMNS} {FORM_COLUMNS}" if packing.formed else TEXT_COLUMNS
    lines = [f"# {line}" for line in ["talus-packing text 1", *header.splitlines(), titles]]
    for k in range(packing.count):
        numbers = [*packing.axes[k], *packing.x[k], *packing.quat[k]]
        text = " ".join(repr(float(value)) for value in numbers)
        own = ",".join(members[int(packing.id[k])]) or "-"
        if packing.formed:
            form = [*packing.skew[k], packing.exponent[k]]
            own += " " + " ".join(repr(float(value)) for value in form)
        lines.append(f"{packing.id[k]} {packing.kind[k]} {text} {own}")
    write_text_file(path, "\n".join(lines) + "\n")


def read_text(path: Path) -> Packing:
    """Read the text form."""
    try:
        rows = [
            (number, line.split())
            for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1)
            if line.strip() and not line.startswith("#")
        ]
    except UnicodeDecodeError as fault:
        raise FaultError("E502", f"{path} is no text file", f"rows are: {TEXT_COLUMNS}") from fault
    except OSError as fault:
        raise FaultError("E501", f"cannot read {path}: {fault.strerror}") from fault
    if not rows:
        raise FaultError("E502", f"{path} holds no grains", f"rows are: {TEXT_COLUMNS}")
    groups: dict[str, list[int]] = {}
    ids, kinds, numbers, forms = [], [], [], []
    for number, words in rows:
        try:
            if len(words) not in (13, 17):
                raise ValueError(f"{len(words)} words instead of 13, or 17 with its form")
            ids.append(int(words[0]))
            if not 1 <= ids[-1] <= LARGEST_ID:
                raise ValueError(f"id {words[0]} is not from 1 to {LARGEST_ID}")
            kinds.append(int(words[1]))
            if abs(kinds[-1]) > LARGEST_ID:
                raise ValueError(f"kind {words[1]} is none of 0, 1, 2")
            numbers.append([float(word) for word in words[2:12]])
            if "" in words[12].split(","):
                raise ValueError(f"a group without a name in '{words[12]}'")
            forms.append([float(word) for word in words[13:]] or [0.0, 0.0, 0.0, LEAST_EXPONENT])
        except ValueError as fault:
            raise FaultError(
                "E502",
                f"a row is no grain: {fault}",
                f"rows are: {TEXT_COLUMNS}",
                f"{path}:{number}",
            ) from fault
        for name in words[12].split(",") if words[12] != "-" else ():
            groups.setdefault(name, []).append(ids[-1])
    values = np.array(numbers)
    packing = make_packing(
        values[:, 3:6], values[:, 0:3], values[:, 6:10], np.array(kinds), np.array(ids),
        {name: np.array(g) for name, g in groups.items()},
    )  # fmt: skip
    packing.skew, packing.exponent = np.array(forms)[:, :3], np.array(forms)[:, 3]
    return packing


def read_packing(path: Path) -> Packing:
    """Read packing.h5 or the text form, by the ending of the name, and check every grain."""
    packing = read_text(path) if path.suffix in TEXT_ENDINGS else read_h5(path)
    check_packing(packing, str(path))
    return packing


def write_packing_file(path: Path, packing: Packing, header: str = "") -> None:
    """Check every grain; write packing.h5 or the text form, by the ending of the name."""
    check_packing(packing, str(path))
    if path.suffix in TEXT_ENDINGS:
        write_text(path, packing, header)
    else:
        write_h5(path, packing)
