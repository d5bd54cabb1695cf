"""Make packings: the containers of the penetration benchmark, lattices, random clouds.

Lengths in metres. The benchmark's numbers are those of the source chapter, sections 1.1 and 4.2.
"""

import numpy as np

from talus.faults import FaultError
from talus.forms import Forms, bounding_radii, volumes
from talus.packing import DRIVEN, FIXED, FREE, Packing, make_packing

PITCH = 5.0e-3
WALL_RADIUS = 2.475e-3
WALL_ROWS = 23
FLOOR_HEIGHT = -25.0e-3
GRAIN_AXES = (2.5e-3, 2.0e-3, 1.5e-3)
TOOL_AXES = (6.0e-3, 6.0e-3, 20.0e-3)
LARGEST = 5_000_000  # grains that a lattice may have
ROOM = 0.25  # of the volume: bounding spheres of a random cloud that find room
FINE = 400  # steps between two sieves where sizes are tabled
GRID = {"small": 7, "medium": 9, "large": 11, "wide": 22}
THIRD = 1.0 / 3.0
# edges of the cell in units of the pitch, and places of grains in units of the edges
LATTICES = {
    "sc": ((1, 1, 1), [(0, 0, 0)]),
    "bcc": ((1, 1, 1), [(0, 0, 0), (0.5, 0.5, 0.5)]),
    "fcc": ((1, 1, 1), [(0, 0, 0), (0.5, 0.5, 0), (0.5, 0, 0.5), (0, 0.5, 0.5)]),
    "hcp": (
        (1, np.sqrt(3.0), np.sqrt(8.0 / 3.0)),
        [(0, 0, 0), (0.5, 0.5, 0), (0.5, 0.5 * THIRD, 0.5), (0, 2.0 * THIRD, 0.5)],
    ),
}


def random_quaternions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Uniformly distributed unit quaternions (n, 4)."""
    quat = rng.normal(size=(n, 4))
    return quat / np.linalg.norm(quat, axis=1, keepdims=True)


def wall_columns(grid: int) -> np.ndarray:
    """Coordinates of the wall columns: -2.5 g ... 2.5 g mm in steps of 5 mm."""
    return np.arange(grid + 1) * PITCH - 0.5 * PITCH * grid


def container(grid: int, rows: int = WALL_ROWS) -> np.ndarray:
    """Centres of the fixed spheres: four walls of (g+1) x rows without corners, and the floor."""
    along = wall_columns(grid)
    half = 25.0e-3 * (grid + 1) / 10.0
    heights = FLOOR_HEIGHT + PITCH * np.arange(rows)
    a, z = (m.ravel() for m in np.meshgrid(along, heights))
    side = np.full_like(a, half)
    walls = [np.column_stack(p) for p in ((-side, a, z), (side, a, z), (a, -side, z), (a, side, z))]
    fx, fy = (m.ravel() for m in np.meshgrid(along, along))
    floor = np.column_stack([fx, fy, np.full_like(fx, FLOOR_HEIGHT)])
    return np.concatenate([*walls, floor])


def penetration(name: str, seed: int, layers: int = 40, guard_rows: int = 0) -> Packing:
    """Container and grains of the benchmark before deposition; groups container, free, guard.

    `guard_rows` more rows of fixed spheres are above the walls (group guard) so that every grain
    falls inside; they are dropped from the deposit.
    """
    if name not in GRID:
        raise FaultError("E510", f"no container '{name}'", f"one of {', '.join(GRID)}")
    grid = GRID[name]
    fixed = container(grid)
    tall = container(grid, WALL_ROWS + guard_rows)
    top = FLOOR_HEIGHT + PITCH * (WALL_ROWS - 0.5)
    guard = tall[tall[:, 2] > top]
    lattice = (np.arange(grid) - 0.5 * (grid - 1)) * PITCH
    heights = 25.0e-3 + PITCH * np.arange(layers)
    z, y, x = (m.ravel() for m in np.meshgrid(heights, lattice, lattice, indexing="ij"))
    free = np.column_stack([x, y, z])
    rng = np.random.default_rng(seed)
    n_fixed, n_free, n_guard = len(fixed), len(free), len(guard)
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (n_fixed + n_free + n_guard, 1))
    quat[n_fixed : n_fixed + n_free] = random_quaternions(rng, n_free)
    axes = np.full((len(quat), 3), WALL_RADIUS)
    axes[n_fixed : n_fixed + n_free] = GRAIN_AXES
    kind = np.full(len(quat), FIXED)
    kind[n_fixed : n_fixed + n_free] = 0
    ids = np.arange(1, len(quat) + 1)
    groups = {"container": ids[:n_fixed], "free": ids[n_fixed : n_fixed + n_free]}
    if n_guard:
        groups["guard"] = ids[n_fixed + n_free :]
    return make_packing(np.concatenate([fixed, free, guard]), axes, quat, kind, ids, groups)


def surface_under(packing: Packing, axes: tuple[float, float, float]) -> float:
    """Height of the centre at which an upright ellipsoid on the axis just clears the bed [m].

    Free grains are taken as their bounding spheres; the outline of ellipsoid plus sphere (their
    Minkowski sum) is followed by the angle of its normal.
    """
    free = packing.kind == 0
    x, radius = packing.x[free], packing.axes[free].max(axis=1)
    distance = np.hypot(x[:, 0], x[:, 1])
    near = np.flatnonzero(distance < axes[0] + radius)
    if not near.size:
        raise FaultError("E511", "no free grain lies under the penetrator")
    angle = np.linspace(0.0, 0.5 * np.pi, 400)
    sine, cosine = np.sin(angle), np.cos(angle)
    support = np.sqrt((axes[0] * sine) ** 2 + (axes[2] * cosine) ** 2)
    highest = -np.inf
    for k in near:
        across = axes[0] ** 2 * sine / support + radius[k] * sine
        up = axes[2] ** 2 * cosine / support + radius[k] * cosine
        highest = max(highest, x[k, 2] + float(np.interp(distance[k], across, up)))
    return highest


def add_tool(packing: Packing, axes: tuple[float, float, float], height: float | None) -> Packing:
    """Add the penetrator (kind driven, group tool) with its centre on the axis at a height [m]."""
    centre = surface_under(packing, axes) if height is None else height
    tool = make_packing(
        np.array([[0.0, 0.0, centre]]),
        np.array([axes]),
        kind=np.array([DRIVEN]),
        ids=np.array([packing.id.max() + 1]),
        groups={"tool": np.array([packing.id.max() + 1])},
    )
    return packing.join(tool)


def lattice(
    kind: str, cells: tuple[int, int, int], pitch: float, axes: np.ndarray, periodic: bool = False
) -> Packing:
    """Grains on a lattice; `pitch` [m] is the cell's edge (hcp: the distance in a layer).

    A periodic packing holds the cell of the infinite lattice.
    """
    if kind not in LATTICES:
        raise FaultError("E510", f"no lattice '{kind}'", f"one of {', '.join(LATTICES)}")
    edges, base = (np.array(part, float) for part in LATTICES[kind])
    if np.prod(cells, dtype=float) * len(base) > LARGEST:
        text = f"{' x '.join(map(str, cells))} cells are too many"
        raise FaultError("E512", text, f"at most {LARGEST} grains")
    corners = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), -1)
    x = (corners.reshape(-1, 1, 3) + base[None]) * edges * pitch
    x = x.reshape(-1, 3)
    packing = make_packing(x, np.tile(axes, (len(x), 1)))
    if periodic:
        packing.cell = np.diag(np.array(cells) * edges * pitch)
    return packing


def uniform_sizes(count: int, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Scale factors (count), uniform by number in 1 +- spread."""
    return 1.0 + spread * rng.uniform(-1.0, 1.0, count)


def sieved_sizes(count: int, openings: np.ndarray, passing: np.ndarray) -> np.ndarray:
    """Sizes (count) [m] that follow a sieve curve: share of the *mass* passing each opening.

    Between sieves the mass is spread evenly over the logarithm of the size. By number a size d
    counts with 1 / d^3; the sizes are the middles of `count` equal shares of the number.
    """
    rising = (np.diff(openings) > 0.0).all() and (np.diff(passing) >= 0.0).all()
    if len(openings) < 2 or not rising or openings[0] <= 0.0 or passing[0] or passing[-1] != 1.0:
        pairs = " ".join(f"{d:g}:{p:g}" for d, p in zip(openings, passing, strict=True))
        hint = "openings above 0 and rising, shares of the mass from 0 to 1: 2e-3:0 3e-3:0.4 5e-3:1"
        raise FaultError("E514", f"{pairs} is no sieve curve", hint)
    edges = np.concatenate(
        [
            np.geomspace(a, b, FINE, endpoint=False)
            for a, b in zip(openings, openings[1:], strict=False)
        ]
    )
    edges = np.append(edges, openings[-1])
    mass = np.diff(np.interp(np.log(edges), np.log(openings), passing))
    number = mass / (edges[1:] * edges[:-1]) ** 1.5
    share = np.concatenate([[0.0], np.cumsum(number)])
    return np.interp((np.arange(count) + 0.5) / count, share / share[-1], edges)


def passing_of(packing: Packing, openings: np.ndarray) -> np.ndarray:
    """Shares of the mass of the free grains that pass openings [m] by their middle axes."""
    free = packing.kind == FREE
    axes = packing.axes[free]
    mass = volumes(axes, packing.skew[free], packing.exponent[free])
    size = 2.0 * np.median(axes, axis=1)
    return np.array([mass[size <= d].sum() for d in openings]) / mass.sum()


def check_gradation(packing: Packing, openings: np.ndarray, passing: np.ndarray) -> float:
    """Largest error of the mass that passes a sieve; a class without a grain is a fault (E514)."""
    middle = 2.0 * np.median(packing.axes, axis=1)
    for low, high, share in zip(openings, openings[1:], np.diff(passing), strict=False):
        if share > 0.0 and not ((middle > low) & (middle <= high)).any():
            text = f"no grain lies between {low:g} and {high:g} m, where {share:.3g} of the mass is"
            raise FaultError("E514", text, f"ask for more than {packing.count} grains")
    return float(np.abs(passing_of(packing, openings) - passing).max())


def roomy(box: np.ndarray, radius: np.ndarray) -> str:
    """Return the hint of a box of the same shape [m] that bounding spheres of these radii fit."""
    need = 4.0 / 3.0 * np.pi * float((radius**3).sum()) / ROOM
    edges = box * max((need / float(box.prod())) ** (1.0 / 3.0), 1.0)
    words = " ".join(f"{edge:.3g}" for edge in edges)
    return f"enlarge the box, --box {words} has room for all, or ask for fewer grains"


def cloud(
    sizes: np.ndarray, box: np.ndarray, axes: np.ndarray, seed: int, tries: int = 2000,
    watch: object = iter, periodic: bool = False, forms: Forms | None = None,
) -> Packing:  # fmt: skip
    """Random grains whose bounding spheres do not overlap, in a box from the origin [m].

    `sizes` (n) multiply `axes` [m]. Larger grains are placed first; ids run through the box layer
    by layer, so that neighbours lie near each other in the solver's memory. In a periodic box
    grains reach through the faces; the packing then holds it as its cell. With `forms` each grain
    draws one of them at random by weight, in place of `axes`.
    """
    rng = np.random.default_rng(seed)
    scale = np.sort(sizes)[::-1]
    radius = scale * float(np.max(axes))
    if forms is not None:
        chosen = forms.choose(np.random.default_rng(seed + 2), len(scale))
        radius = scale * bounding_radii(forms)[chosen]
        largest = np.argsort(-radius, kind="stable")
        scale, chosen, radius = scale[largest], chosen[largest], radius[largest]
    if ((4.0 if periodic else 2.0) * radius[0] > box).any():
        text = f"the largest grain, {2.0 * radius[0]:.4g} m across, is too wide for the box"
        raise FaultError("E512", text, "enlarge the box")
    across = np.maximum(np.floor(box / (2.0 * radius[0])), 1.0)  # cells of the search
    period = box if periodic else np.full(3, np.inf)
    grid: dict[tuple[int, ...], list[int]] = {}
    x = np.zeros((len(scale), 3))
    for k in watch(range(len(scale))):
        for _ in range(tries):
            margin = 0.0 if periodic else radius[k]
            trial = margin + rng.uniform(size=3) * (box - 2.0 * margin)
            home = np.minimum(trial * across // box, across - 1.0).astype(int)
            near = neighbours(home, across.astype(int), periodic)
            if clear_of(trial, radius[k], near, grid, x, radius, period):
                x[k] = trial
                grid.setdefault(tuple(home), []).append(k)
                break
        else:
            text = f"only {k} of {len(scale)} grains found room"
            raise FaultError("E512", text, roomy(box, radius))
    order = np.lexsort((x // (2.0 * radius[0])).astype(int).T)
    own = axes[None, :] if forms is None else forms.axes[chosen[order]]
    packing = make_packing(x[order], scale[order, None] * own, random_quaternions(rng, len(scale)))
    if forms is not None:
        packing.skew = forms.skew[chosen[order]]
        packing.exponent = forms.exponent[chosen[order]]
    if periodic:
        packing.cell = np.diag(box)
    return packing


def neighbours(home: np.ndarray, across: np.ndarray, periodic: bool) -> set[tuple[int, ...]]:
    """Return a cell of the search and those around it, over the faces of a periodic box."""
    around = [home + np.array(d) - 1 for d in np.ndindex(3, 3, 3)]
    return {tuple(cell % across if periodic else cell) for cell in around}


def clear_of(
    trial: np.ndarray, own: float, cells: set[tuple[int, ...]],
    grid: dict[tuple[int, ...], list[int]], x: np.ndarray, radius: np.ndarray, period: np.ndarray,
) -> bool:  # fmt: skip
    """Whether a sphere of radius `own` at `trial` touches none of those placed in some cells."""
    near = [j for cell in cells for j in grid.get(cell, [])]
    if not near:
        return True
    apart = x[near] - trial
    if np.isfinite(period).all():
        apart -= period * np.round(apart / period)
    return bool(np.all(np.linalg.norm(apart, axis=1) > radius[near] + own))
