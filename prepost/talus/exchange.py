"""Packings of other codes: data files of LAMMPS and LIGGGHTS (spheres), particle files of ELLIP3D.

Lengths in metres, densities in kg/m3, all SI as in packing.h5; quaternions are (w, x, y, z).
"""

from pathlib import Path

import numpy as np

from talus.faults import FaultError
from talus.files import write_text_file
from talus.packing import DRIVEN, FIXED, FREE, Packing, make_packing

SPHERES = ("refuse", "bounding", "volume")  # what becomes of grains that are no spheres
ROUND = 1.0e-12  # relative difference of semi-axes up to which a grain is a sphere
UNSQUARE = 1.0e-3  # how far axes in a file of text may be from a right-angled frame
ELLIP3D_COLUMNS = 29
ELLIP3D_POLY_COLUMNS = 32  # six semi-axes instead of three
# kinds of ELLIP3D: free, free at the boundary; fixed; moved along z (pile, penetrator), ghost
ELLIP3D_KIND = {0: FREE, 5: FREE, 1: FIXED, 3: DRIVEN, 4: DRIVEN, 10: DRIVEN}
LAMMPS_TYPES = {FREE: 1, FIXED: 2, DRIVEN: 3}


def sphere_radii(packing: Packing, spheres: str = "refuse") -> np.ndarray:
    """Return the radius of each grain (n,) [m].

    `spheres` sets the treatment of ellipsoids: 'refuse' raises E505, 'bounding' takes the sphere
    around the grain, 'volume' the sphere of the same volume.
    """
    axes = packing.axes
    largest = axes.max(axis=1)
    long = largest - axes.min(axis=1) > ROUND * largest
    if spheres == "refuse" and long.any():
        row = np.flatnonzero(long)[0]
        text = f"grain {packing.id[row]} is no sphere: semi-axes {axes[row]} ({long.sum()} such)"
        hint = "--spheres=bounding or --spheres=volume puts spheres in their place"
        raise FaultError("E505", text, hint)
    return np.where(long, np.cbrt(axes.prod(axis=1)), largest) if spheres == "volume" else largest


def write_lammps(
    path: Path, packing: Packing, density: float, spheres: str = "refuse",
    box: np.ndarray | None = None,
) -> None:  # fmt: skip
    """Write a data file for `atom_style sphere` (LAMMPS) or `granular` (LIGGGHTS), units si.

    Types are 1 free, 2 fixed, 3 driven; density in kg/m3; `box` is xlo xhi ylo yhi zlo zhi [m],
    by default what holds all grains. Numbers have 17 digits and read back to the same bits,
    save radii, which go through the diameter and halve exactly.
    """
    packing.check_loose()
    radii = sphere_radii(packing, spheres)
    if box is None:
        low = (packing.x - radii[:, None]).min(axis=0)
        high = (packing.x + radii[:, None]).max(axis=0)
        box = np.column_stack([low, high]).ravel()
    lines = [
        "Talus packing for atom_style sphere, units si; types 1 free, 2 fixed, 3 driven",
        "",
        f"{packing.count} atoms",
        f"{len(LAMMPS_TYPES)} atom types",
        "",
    ]
    for k, axis in enumerate("xyz"):
        lines.append(f"{float(box[2 * k])!r} {float(box[2 * k + 1])!r} {axis}lo {axis}hi")
    types = [LAMMPS_TYPES[int(kind)] for kind in packing.kind]
    lines += ["", "Atoms", ""]
    for i, kind, radius, x in zip(packing.id, types, radii, packing.x, strict=True):
        place = " ".join(repr(float(value)) for value in x)
        lines.append(f"{i} {kind} {2.0 * float(radius)!r} {float(density)!r} {place}")
    lines += ["", "Velocities", ""]
    for i, row in zip(packing.id, np.hstack([packing.v, packing.omega]), strict=True):
        lines.append(f"{i} " + " ".join(repr(float(value)) for value in row))
    write_text_file(path, "\n".join(lines) + "\n")


def read_lammps(path: Path) -> Packing:
    """Read a data file of `atom_style sphere` (also as `write_data` writes it) into a packing."""
    sections: dict[str, list[list[str]]] = {}
    rows: list[list[str]] = []
    for line in _lines(path)[1:]:
        words = line.split("#")[0].split()
        if words and words[0][0].isalpha():
            rows = sections.setdefault(words[0], [])
        elif words:
            rows.append(words)
    atoms = _numbers(path, sections.get("Atoms", []), (7, 10), "id type diameter density x y z")
    speeds = _numbers(path, sections.get("Velocities", []), (7,), "id vx vy vz wx wy wz")
    ids = atoms[:, 0].astype(np.int64)
    kinds = {number: kind for kind, number in LAMMPS_TYPES.items()}
    kind = np.array([kinds.get(int(number), FREE) for number in atoms[:, 1]])
    v, omega = np.zeros((len(ids), 3)), np.zeros((len(ids), 3))
    row_of = {int(i): row for row, i in enumerate(ids)}
    for speed in speeds:
        if int(speed[0]) not in row_of:
            text = f"atom {int(speed[0])} has a velocity and no place"
            raise FaultError("E506", text, "", str(path))
        v[row_of[int(speed[0])]], omega[row_of[int(speed[0])]] = speed[1:4], speed[4:7]
    axes = np.repeat(0.5 * atoms[:, 2:3], 3, axis=1)
    return make_packing(atoms[:, 4:7], axes, kind=kind, ids=ids, v=v, omega=omega)


def read_ellip3d(path: Path) -> Packing:
    """Read a particle file of ELLIP3D or ParaEllip3d (text form) into a packing.

    The first line has the number of particles (older files: and the kind of container, then a
    line with its centre and edges); a row of titles follows, then 29 numbers a particle: id, type,
    a b c, centre, the angles of the three axes with x, y, z [rad], velocity, spin, force, moment.
    Force and moment are left out; types other than free and fixed become groups `type_<number>`.
    """
    lines = _lines(path)
    try:
        count = int(lines[0].split()[0])
    except (IndexError, ValueError) as fault:
        text = "no number of particles in the first line"
        raise FaultError("E506", text, "", str(path)) from fault
    title = next((k for k, line in enumerate(lines[:4]) if line.split()[:1] == ["ID"]), None)
    if title is None:
        hint = "titles begin with 'ID type a b c'; the XML form of ParaEllip3d is not read"
        raise FaultError("E506", "no row of titles in the first lines", hint, str(path))
    if len(lines[title].split()) == ELLIP3D_POLY_COLUMNS:
        hint = "only ellipsoids with three semi-axes are read"
        raise FaultError("E506", "the particles are poly-ellipsoids (a_plus a_minus ...)", hint)
    rows = [line.split() for line in lines[title + 1 : title + 1 + count]]
    if len(rows) < count:
        raise FaultError("E506", f"{len(rows)} rows instead of {count} particles", "", str(path))
    values = _numbers(path, rows, (ELLIP3D_COLUMNS,), "id type a b c x y z, 9 angles, 12 more")
    types = values[:, 1].astype(int)
    strange = ~np.isin(types, list(ELLIP3D_KIND))
    if strange.any():
        row = np.flatnonzero(strange)[0]
        text = f"particle {int(values[row, 0])} has the type {types[row]}"
        hint = "read are 0 and 5 (free), 1 (fixed), 3, 4 and 10 (driven)"
        raise FaultError("E506", text, hint, str(path))
    ids = values[:, 0].astype(np.int64)
    groups = {f"type_{number}": ids[types == number] for number in set(types) - {0, 1}}
    return make_packing(
        values[:, 5:8], values[:, 2:5], _orientations(path, ids, np.cos(values[:, 8:17])),
        np.array([ELLIP3D_KIND[number] for number in types]), ids, groups, values[:, 17:20],
        values[:, 20:23],
    )  # fmt: skip


def _orientations(path: Path, ids: np.ndarray, cosines: np.ndarray) -> np.ndarray:
    """Return quaternions (n, 4) from the direction cosines of the axes a, b, c (n, 9)."""
    frame = cosines.reshape(-1, 3, 3).transpose(0, 2, 1)  # columns are the axes
    left, stretch, right = np.linalg.svd(frame)
    bad = np.abs(stretch - 1.0).max(axis=1) > UNSQUARE
    if bad.any():
        text = f"the axes of particle {ids[np.flatnonzero(bad)[0]]} are not at right angles"
        raise FaultError("E506", text, "angles with x, y, z in radians are wanted", str(path))
    nearest = left @ right
    nearest[:, :, 2] *= np.linalg.det(nearest)[:, None]  # an ellipsoid has no hands: turn c over
    return quaternions(nearest)


def quaternions(frames: np.ndarray) -> np.ndarray:
    """Return unit quaternions (n, 4), w >= 0, of rotation matrices (n, 3, 3), body to space."""
    diagonal = np.diagonal(frames, axis1=1, axis2=2)
    trace = diagonal.sum(axis=1)
    # the four numbers 4 q_k^2; the largest decides the signs of the others
    square = np.column_stack([1.0 + trace, 1.0 + 2.0 * diagonal - trace[:, None]])
    best = square.argmax(axis=1)
    off = {(i, j): frames[:, i, j] for i in range(3) for j in range(3) if i != j}
    skew = [off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]
    even = [off[1, 0] + off[0, 1], off[0, 2] + off[2, 0], off[2, 1] + off[1, 2]]
    product = np.empty((len(frames), 4, 4))  # 4 q_i q_j
    for k in range(4):
        product[:, k, k] = square[:, k]
    for k in range(3):
        product[:, 0, k + 1] = product[:, k + 1, 0] = skew[k]
    for k, (i, j) in enumerate([(1, 2), (1, 3), (2, 3)]):
        product[:, i, j] = product[:, j, i] = even[k]
    quat = product[np.arange(len(frames)), best]
    quat = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    return np.where(quat[:, :1] < 0.0, -quat, quat)


def _lines(path: Path) -> list[str]:
    """Return the lines of a text file."""
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as fault:
        raise FaultError("E506", f"{path} is no text file") from fault
    except OSError as fault:
        raise FaultError("E501", f"cannot read {path}: {fault.strerror}") from fault


def _numbers(path: Path, rows: list[list[str]], widths: tuple[int, ...], text: str) -> np.ndarray:
    """Return rows of words as numbers; all rows have one of the widths."""
    if not rows and text.startswith("id type"):
        raise FaultError("E506", f"{path} holds no grains", f"rows are: {text}")
    hint = f"rows are: {text}"
    for number, row in enumerate(rows, 1):
        if len(row) not in widths:
            raise FaultError("E506", f"row {number} has {len(row)} words", hint, str(path))
    try:
        return np.array([row[: min(widths)] for row in rows], float).reshape(-1, min(widths))
    except ValueError as fault:
        raise FaultError("E506", f"a row is no grain: {fault}", hint, str(path)) from fault
