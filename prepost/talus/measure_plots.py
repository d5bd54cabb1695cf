"""Figures of measures: histories of a region, orientation rose, slices of coarse-grained fields."""

import json
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fields import FieldFile
from talus.look import new_figure
from talus.measure import rotations
from talus.packing import FREE

KILO, MILLI, MEGA = 1.0e3, 1.0e3, 1.0e6
BINS = 36
ROUND = 1.0e-6  # of an axis, by which those of a sphere may differ
SIX = ["xx", "yy", "zz", "yz", "zx", "xy"]  # rows and columns of a stiffness
PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
LAYERS = {"x": 0, "y": 1, "z": 2}
UNITS = {"solid_fraction": "-", "density": "kg/m3", "momentum": "kg/(m2 s)", "velocity": "m/s",
         "stress": "Pa", "kinetic_stress": "Pa", "fabric": "-"}  # fmt: skip


def history(path: Path) -> object:
    """Stress, solid fraction and coordination, fabric, affine moduli of a region over time."""
    rows = histories.read(path)
    time = rows["time"]
    if not time.size:
        raise FaultError("E545", f"{path} has no rows yet", "the run has measured nothing")
    fig, axes = new_figure(nrows=2, ncols=2, figsize=(10.0, 6.6), sharex=True)
    mark = "o-" if time.size < 4 else "-"
    for name in ("xx", "yy", "zz"):
        axes[0, 0].plot(time, rows[f"stress_{name}"] / KILO, mark, label=f"stress {name}")
    axes[0, 0].plot(time, rows["pressure"] / KILO, "--", color="black", label="pressure")
    axes[0, 0].set(ylabel="stress [kPa], tension positive")
    axes[0, 1].plot(time, rows["solid_fraction"], mark, label="solid fraction")
    for name in ("rattlers", "sliding"):
        axes[0, 1].plot(time, rows[name], "--", label=f"{name}, part")
    axes[0, 1].set(ylabel="part [-]", ylim=(0.0, 1.0))
    for name in ("xx", "yy", "zz"):
        axes[1, 0].plot(time, rows[f"fabric_contact_{name}"], mark, label=f"contacts {name}")
    axes[1, 0].set(xlabel="time [s]", ylabel="fabric [-]")
    twin = axes[1, 0].twinx()
    twin.grid(visible=False)
    twin.plot(time, rows["mechanical_coordination"], ":", color="black")
    twin.set(ylabel="mechanical coordination (dotted) [-]")
    for name, label in (("bulk", "K"), ("shear", "G"), ("kappa", "κ")):
        axes[1, 1].plot(time, rows[f"affine_{name}"] / MEGA, mark, label=f"{label}, affine")
    axes[1, 1].set(xlabel="time [s]", ylabel="upper bound of the modulus [MPa]")
    for ax in axes.flat:
        ax.legend(fontsize=8)
    fig.suptitle(
        f"Region '{path.stem.partition('_measure_')[2]}', {path.stem.split('_measure_')[0]}"
    )
    return fig


def contacts_of(path: Path, step: int) -> tuple[float, dict[str, np.ndarray], dict]:
    """Return time [s], contacts and grains of a step; a file without contacts is a fault."""
    with FieldFile(path) as fields:
        now = fields.read(step)
        group = fields.file["steps"][fields.names[step]]
        if "contacts" not in group:
            hint = "run with &output fields = 'contacts'"
            raise FaultError("E543", f"{path} holds no contacts", hint)
        contacts = {name: data[...] for name, data in group["contacts"].items()}
    return now.time, contacts, now.grains


def rose(path: Path, step: int = -1) -> object:
    """Draw how many contact normals, and how much normal force, point where in three planes.

    Both ends of a normal count; a normal counts in a plane with the square of its length there, so
    that an isotropic pack gives circles; planes are left out. The grey circle is the mean.
    """
    time, contacts, _ = contacts_of(path, step)
    between = contacts["ids"][:, 0] > 0
    normal, force = contacts["normal"][between], contacts["force"][between]
    if not len(normal):
        raise FaultError("E543", f"{path} holds no contacts at {time:g} s", "choose another --step")
    push = np.einsum("ci,ci->c", force, normal)
    fig = petals({"contacts": (normal, np.ones(len(normal))), "normal force": (normal, push)})
    fig.suptitle(
        f"Directions of {len(normal)} contacts between grains over their mean, t = {time:.4g} s"
    )
    return fig


def axes_rose(path: Path, step: int = -1) -> object:
    """Draw how many short and long axes of the free grains point where in three planes, as rose."""
    with FieldFile(path) as fields:
        now = fields.read(step)
    if not {"kind", "axes", "quat"} <= now.grains.keys():
        hint = "give the field file of talus-dem, not that of a solid"
        raise FaultError("E543", f"{path} holds no grains with axes and orientations", hint)
    free = now.grains["kind"] == FREE
    size, turn = now.grains["axes"][free], rotations(now.grains["quat"][free])
    chosen = np.ptp(size, axis=1) > ROUND * size.max(axis=1)
    size, turn = size[chosen], turn[chosen]
    if not len(size):
        hint = "spheres have no axes"
        raise FaultError("E543", f"{path} holds no grains with a longest axis", hint)
    number = np.arange(len(size))
    short, long = (turn[number, :, f(size, axis=1)] for f in (np.argmin, np.argmax))
    one = np.ones(len(size))
    fig = petals({"short axes": (short, one), "long axes": (long, one)})
    fig.suptitle(f"Orientations of {len(size)} free grains over their mean, t = {now.time:.4g} s")
    return fig


def petals(kinds: dict[str, tuple[np.ndarray, np.ndarray]]) -> object:
    """Draw two sets of directions (n, 3) with their weights (n): bars, and a line."""
    fig, axes = new_figure(ncols=3, figsize=(11.0, 4.2), subplot_kw={"projection": "polar"})
    half = np.pi / BINS  # bins lie about the axes, not beside them
    edges = np.linspace(-np.pi, np.pi, BINS + 1) - half
    middle = 0.5 * (edges[1:] + edges[:-1])
    for ax, (name, (a, b)) in zip(axes, PLANES.items(), strict=True):
        for label, (normal, weight) in kinds.items():
            part = weight * (normal[:, a] ** 2 + normal[:, b] ** 2)
            angle = np.arctan2(normal[:, b], normal[:, a])
            both = np.concatenate([angle, angle + np.pi])
            both = np.mod(both - edges[0], 2.0 * np.pi) + edges[0]
            height = np.histogram(both, edges, weights=np.tile(part, 2))[0]
            height = height / max(height.mean(), 1.0e-300)
            if label == next(iter(kinds)):
                ax.bar(middle, height, width=2.0 * np.pi / BINS, alpha=0.6, label=label)
            else:
                closed = np.append(np.arange(BINS), 0)
                ax.plot(middle[closed], height[closed], color="#c0392b", label=label)
        ax.plot(np.linspace(0.0, 2.0 * np.pi, 90), np.ones(90), color="#7b7d7d", lw=0.8)
        ax.set_title(f"{name[0]} to the right, {name[1]} up", fontsize=10)
        ax.set_yticklabels([])
    axes[0].legend(fontsize=8, loc="lower left", bbox_to_anchor=(-0.15, -0.2))
    return fig


def probe(path: Path) -> object:
    """Draw the stiffness found by probes (*_probe.json) beside the affine sum, and both fits."""
    try:
        found = json.loads(path.read_text())
        matrices = {
            label: np.array([found[kind]["stiffness_Pa"][row] for row in SIX])
            for label, kind in (("probed", "probed"), ("affine sum", "affine"))
        }
        fits = {k: (found[k]["bulk_Pa"], found[k]["shear_Pa"]) for k in ("probed", "affine")}
    except (OSError, ValueError, KeyError) as fault:
        text = f"{path} holds no probes"
        raise FaultError("E545", text, "a file *_probe.json is wanted") from fault
    fig, (left, right) = new_figure(ncols=2, figsize=(10.6, 4.4))
    place = np.arange(len(SIX) + 2)
    for k, ((label, matrix), fit) in enumerate(zip(matrices.items(), fits.values(), strict=True)):
        heights = np.append(np.diag(matrix), fit) / MEGA
        left.bar(place + 0.4 * k - 0.2, heights, width=0.4, label=label)
    left.set_xticks(place, [*SIX, "K", "G"])
    left.set(xlabel="diagonal of the stiffness, bulk and shear modulus", ylabel="modulus [MPa]")
    left.legend(fontsize=8)
    image = right.imshow(matrices["probed"] / MEGA, cmap="viridis")
    right.set_xticks(range(len(SIX)), SIX)
    right.set_yticks(range(len(SIX)), SIX)
    right.set(xlabel="strain", ylabel="stress, probed stiffness")
    right.grid(visible=False)
    fig.colorbar(image, ax=right, label="modulus [MPa]")
    name = path.stem.removesuffix("_probe")
    fig.suptitle(f"Probes of {name} at {found['pressure_Pa'] / KILO:.4g} kPa")
    return fig


def component(field: str) -> tuple[str, int | None]:
    """Name of a dataset and its column: 'stress_xy' is column 1 of stress, 'velocity_z' 2."""
    if field in UNITS:
        return field, None
    name, _, ending = field.rpartition("_")
    if name in UNITS and ending and set(ending) <= set("xyz"):
        columns = ["xyz".index(letter) for letter in ending]
        if len(columns) == 1 and name in ("momentum", "velocity"):
            return name, columns[0]
        if len(columns) == 2 and name in ("stress", "kinetic_stress", "fabric"):
            return name, 3 * columns[0] + columns[1]
    known = "solid_fraction, density, momentum_x, velocity_z, stress_xy, fabric_zz, ..."
    raise FaultError("E556", f"there is no field '{field}'", known)


def slice_of(path: Path, field: str, axis: str, at: float | None, step: int = -1) -> object:
    """Draw a field of a grid in the layer of cells across an axis, at a place [m] or the middle.

    Vectors are drawn by their length, stresses by their pressure, the fabric by its trace.
    """
    name, column = component(field)
    with FieldFile(path) as fields:
        if fields.mesh is None or "fabric" not in fields.file["steps"][fields.names[step]]:
            raise FaultError("E543", f"{path} holds no grid", "a file *_grid_*.h5 is wanted")
        corners, now = fields.mesh[0], fields.read(step)
    values = now.solid[name]
    if column is not None:
        values = values[:, column]
    elif values.ndim == 2 and values.shape[1] == 3:
        values = np.linalg.norm(values, axis=1)
    elif values.ndim == 2:
        values = values[:, [0, 4, 8]].sum(axis=1) / (-3.0 if "stress" in name else 1.0)
    places = [np.unique(corners[:, k]) for k in range(3)]
    cells = [len(p) - 1 for p in places]
    k = LAYERS[axis]
    at = 0.5 * (places[k][0] + places[k][-1]) if at is None else at
    layer = int(np.searchsorted(places[k], at, "right")) - 1
    if not 0 <= layer < cells[k]:
        text = f"{axis} = {at:g} m is outside the grid"
        hint = f"from {places[k][0]:g} to {places[k][-1]:g} m"
        raise FaultError("E556", text, hint)
    block = values.reshape(cells[::-1]).take(layer, axis=2 - k)
    a, b = (j for j in range(3) if j != k)
    fig, ax = new_figure(figsize=(6.4, 5.4))
    image = ax.pcolormesh(MILLI * places[a], MILLI * places[b], block, cmap="viridis")
    ax.set(xlabel=f"{'xyz'[a]} [mm]", ylabel=f"{'xyz'[b]} [mm]", aspect="equal")
    ax.grid(visible=False)
    label = what_of(name) if column is None else field
    fig.colorbar(image, ax=ax, label=f"{label} [{UNITS[name]}]")
    middle = 0.5 * (places[k][layer] + places[k][layer + 1])
    ax.set_title(f"{axis} = {MILLI * middle:.3g} mm, t = {now.time:.4g} s", fontsize=10)
    return fig


def what_of(name: str) -> str:
    """Name of what is drawn of a whole field."""
    names = {"stress": "pressure", "kinetic_stress": "kinetic pressure", "velocity": "speed",
             "fabric": "trace of the fabric"}  # fmt: skip
    return names.get(name, name.replace("_", " "))
