"""Random packs that are free inside a box of elements.

talus-dem makes, strains and probes a pack in a periodic cell; an overlap holds the same cell free
between its own periodic images as ghosts. Errors of the second against the first.
"""

import itertools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from coupled import audit_of
from overlap_cell import find_contacts

from talus.generate import cloud
from talus.mesh import box, write_mesh
from talus.packing import make_packing, read_h5, write_h5
from talus.verification import Case, Step, field_steps, write_packing

D, PRESSURE, STRAIN = 1.0e-3, 1.0e6, 2.0e-5
GRAINS = 45.5  # to an element, which is then 3.3 diameters wide
DT, BATCH = 3.5e-7, 10  # step [s], steps in an exchange
STATES = {"compressed": ("zz", -1.0), "sheared": ("xz", 1.0)}
SIX = ("xx", "yy", "zz", "yz", "zx", "xy")
GRAIN_DECK = """&run title = 'Random pack', gravity = 0.0, 0.0, 0.0@run@ /
&material  id = 'quartz', density = 2650.0, young = 1.0e9, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'linear', normal_stiffness = 1.0e5,
           tangential_stiffness = 5.0e4, friction = @friction@, damping_ratio = @ratio@ /
&particles file = '@pack@.h5', material = 'quartz' /
&limits    initial_overlap = 0.3 /
"""
PRESS = """&cell /
&cell_stress component = 'mean', stress = @pressure@, rate = 100.0, tolerance = 0.05 /
&relaxation  damping = 'adaptive', dt_factor = 0.7 /
&equilibrium unbalanced = 1.0e-2, energy_ratio = 1.0e-4 /
&output      every_time = 10.0, packing = 'pressed.h5' /
"""
REST = """&cell /
&relaxation  damping = 'adaptive', dt_factor = 0.7 /
&equilibrium unbalanced = 1.0e-8, energy_ratio = 1.0e-12 /
&output      every_time = 10.0, packing = 'rest.h5' /
"""
PROBE = """&cell /
&dynamics dt_factor = 0.3 /
&measure  id = 'all' /
&probe    strain = @strain@, accuracy = 2.0e-3, sides = 'longer' /
"""
TRUTH = """&curve id = 'ramp', times = 0.0, 5.0e-4, 5.001e-4, 1.0, values = 1.0, 1.0, 0.0, 0.0 /
&cell /
&cell_rate   component = '@component@', rate = @rate@, curve = 'ramp' /
&relaxation  damping = 'adaptive', dt_factor = 0.3 /
&equilibrium unbalanced = 1.0e-9, energy_ratio = 1.0e-18 /
&output      every_time = 10.0, fields = 'contacts' /
"""
CUT = """&dynamics dt = @dt@, damping = 8.0e4 /
&output   every_time = @end@, fields = 'contacts' /
"""
SOLID = """&run      title = 'Box around a pack', gravity = 0.0, 0.0, 0.0 /
&mesh     file = 'block.h5' /
&material id = 'soil', law = 'micropolar', density = 1400.0, micro_inertia = 1.0e-7, lambda = 2.0e7,
          mu = 2.0e7, kappa = 3.0e7, alpha = 0.0, beta = 0.0, gamma = 10.0 /
&section  group = 'all', material = 'soil', element = 'hex8/hex8' /
&curve    id = 'ramp', times = 0.0, @ramp@, 1.0, values = 0.0, 1.0, 1.0 /
@motion@
&analysis kind = 'static' /
&output   every_time = @end@ /
"""
COUPLED = """&run     title = 'Random pack in a box', t_end = @end@ /
&program side = 'grains', deck = '@state@_grains.nml', threads = 1 /
&program side = 'solid', deck = '@state@_solid.nml', threads = 1 /
&clock   exchange = @exchange@ /
&overlap free_elements = 'free', ghost_elements = 'ghosts', scheme = 'static', settled = 1.0e-5,
         partition = @partition@, initial = 'stress', moduli = 'probed',
         probe = 'probe_probe.json' /
"""


def write(case: Case, name: str, text: str, **values: object) -> str:
    """Write a deck with @key@ replaced; return its name."""
    for key, value in values.items():
        value = f"{value:.17g}" if isinstance(value, float) else value
        text = text.replace(f"@{key}@", str(value))
    (case.folder / f"{name}.nml").write_text(text)
    return f"{name}.nml"


def grains(case: Case, name: str, pack: str, rest: str, **values: object) -> None:
    """Run talus-dem on a pack, rough unless friction says otherwise."""
    given = {"run": ", t_end = 2.0", "friction": 1.0e9, "ratio": 0.5, "pack": pack} | values
    case.run("talus-dem", write(case, name, GRAIN_DECK + rest, **given), "--threads=1")


@dataclass
class Cell:
    """A pack at rest in a periodic cell of n elements a side."""

    n: int
    x: np.ndarray
    radius: np.ndarray
    length: np.ndarray

    @property
    def h(self) -> np.ndarray:
        """Size of an element [m]."""
        return self.length / self.n


def make_cell(case: Case, n: int, seed: int) -> Cell:
    """Compress a cloud without friction, let it rest, take out what touches nothing; probe it."""
    count = int(GRAINS * n**3)
    sizes = np.random.default_rng(seed).uniform(0.95, 1.05, count)
    edge = (np.pi / 6.0 * D**3 * (sizes**3).sum() / 0.28) ** (1.0 / 3.0)
    loose = cloud(sizes, np.full(3, edge), np.full(3, 0.5 * D), seed=seed, periodic=True)
    write_h5(case.folder / "cloud.h5", loose)
    grains(case, "press", "cloud", PRESS, friction=0.0, pressure=PRESSURE)
    grains(case, "settle", "pressed", REST, friction=0.0)
    pack = read_h5(case.folder / "rest.h5")
    length = np.diag(pack.cell).copy()
    x, radius = pack.x % length, pack.axes[:, 0]
    while True:
        pair, _ = find_contacts(x, radius, length, 0.0)
        kept = np.bincount(pair.ravel(), minlength=len(x)) >= 4
        if kept.all():
            break
        x, radius = x[kept], radius[kept]
    pack = make_packing(x, np.repeat(radius[:, None], 3, 1))
    pack.cell = np.diag(length)
    write_h5(case.folder / "cell.h5", pack)
    grains(case, "probe", "cell", PROBE, run=", t_end = 1.0e-6", strain=STRAIN)
    for state, (component, sign) in STATES.items():
        grains(case, f"truth_{state}", "cell", TRUTH, component=component,
               rate=sign * STRAIN / 5.0e-4)  # fmt: skip
    return Cell(n, x, radius, length)


def write_overlap(case: Case, cell: Cell) -> None:
    """Write the cell with a layer of its images around, and elements two layers farther."""
    x, radius = [cell.x], [cell.radius]
    for shift in itertools.product((-1, 0, 1), repeat=3):
        image = cell.x + np.array(shift) * cell.length
        near = ((image > -cell.h) & (image < cell.length + cell.h)).all(1)
        if shift != (0, 0, 0):
            x.append(image[near])
            radius.append(cell.radius[near])
    axes = np.repeat(np.concatenate(radius)[:, None], 3, 1)
    write_packing(case.folder / "pack.h5", np.concatenate(x), axes)
    wide = cell.n + 4
    mesh = box(-2 * cell.h, cell.length + 2 * cell.h, (wide,) * 3)
    layer = np.abs(mesh.x[mesh.cells["hex8"]].mean(1) / cell.h - 0.5 * cell.n).max(1) - 0.5 * cell.n
    mesh.volumes.update(
        free=np.flatnonzero(layer < 0), ghosts=np.flatnonzero(abs(layer - 0.5) < 0.1)
    )
    place = np.rint(mesh.x / cell.h).astype(int) + 2
    outer = ((place == 0) | (place == wide)).any(1)
    for level in range(wide + 1):
        mesh.nodes[f"level{level}"] = np.flatnonzero(outer & (place[:, 2] == level))
    write_mesh(case.folder / "block.h5", mesh)


def overlap(case: Case, cell: Cell, state: str, partition: str = "ramp") -> float:
    """Run the overlap, its outer nodes moved as the strain says; return what is not balanced.

    partition: how energy is shared, 'ramp' with the rho of the probe or 'share'.
    """
    component, sign = STATES[state]
    held = ", ".join(f"'{c}'" for c in "xyz" if c != component[0])
    lines = []
    for level in range(cell.n + 5):
        way = sign * STRAIN * (level - 2) * cell.h[2]
        lines.append(f"&support group = 'level{level}', fix = {held} /")
        lines.append(
            f"&motion group = 'level{level}', component = '{component[0]}', curve = 'ramp',"
            f" scale = {way:.17g} /"
        )
    end = max(900, 100 * cell.n**2) * DT  # slow modes come to rest as they diffuse
    probe = json.loads((case.folder / "probe_probe.json").read_text())
    trace = [np.trace([probe[k]["stiffness_Pa"][c] for c in SIX]) for k in ("probed", "affine")]
    write(case, f"{state}_grains", GRAIN_DECK + CUT, run="", friction=1.0e9, ratio=0.0, pack="pack",
          dt=DT, end=end)  # fmt: skip
    write(case, f"{state}_solid", SOLID, motion="\n".join(lines), ramp=0.3 * end, end=end)
    rho = f", rho = {trace[0] / trace[1]:.17g}" if partition == "ramp" else ""
    deck = write(case, state, COUPLED, state=state, end=end, exchange=BATCH * DT,
                 partition=f"'{partition}'{rho}")  # fmt: skip
    case.run("talus-couple", deck)
    return float(audit_of(case, state)["unbalanced"][-1])


# --- errors -----------------------------------------------------------------------------------
def spread(u: np.ndarray) -> float:
    """Root mean square about the mean."""
    return float(np.sqrt(((u - u.mean(0)) ** 2).sum(1).mean()))


def inside(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Share of each line from a to b that lies in a box."""
    first, last = np.zeros(len(a)), np.ones(len(a))
    for k in range(3):
        way = np.where(b[:, k] == a[:, k], 1e-300, b[:, k] - a[:, k])
        u, v = (low[k] - a[:, k]) / way, (high[k] - a[:, k]) / way
        first, last = np.maximum(first, np.minimum(u, v)), np.minimum(last, np.maximum(u, v))
    return np.maximum(last - first, 0.0)


def stress(step: Step, cell: Cell, margin: float, periodic: bool) -> np.ndarray:
    """Mean stress of the cell less a margin [m], Love and Weber: branches cut at faces [Pa]."""
    row = np.searchsorted(step.grains["id"], step.contacts["ids"])
    a = step.grains["x"][row[:, 0]]
    branch = step.grains["x"][row[:, 1]] - a
    shifts = [(0, 0, 0)]
    if periodic:
        branch -= cell.length * np.round(branch / cell.length)
        shifts = list(itertools.product((-1, 0, 1), repeat=3))
    low, high = np.full(3, margin), cell.length - margin
    part = sum(inside(a + s * cell.length, a + s * cell.length + branch, low, high)
               for s in map(np.array, shifts))  # fmt: skip
    total = np.einsum("c,ci,cj->ij", part, branch, step.contacts["force"])
    return -total / np.prod(high - low)


def steps_of(path: Path) -> tuple[Step, Step]:
    """First and last step of a field file."""
    steps = list(field_steps(path))
    return steps[0], steps[-1]


def errors(case: Case, cell: Cell, state: str) -> dict[str, object]:
    """Errors of stress, relative, and of motion over the non-affine motion of the truth."""
    component, sign = STATES[state]
    i, j = ("xyz".index(c) for c in component)
    affine = np.zeros_like(cell.x)
    affine[:, i] = sign * STRAIN * cell.x[:, j]
    truth = steps_of(case.folder / f"truth_{state}.h5")
    cut = steps_of(case.folder / f"{state}_grains.h5")
    moved = truth[1].grains["x"] - truth[0].grains["x"]
    exact = moved - cell.length * np.round(moved / cell.length) - affine
    own = (cut[1].grains["x"] - cut[0].grains["x"])[: len(cell.x)] - affine
    wrong = own - exact
    wrong -= wrong.mean(0)
    size = np.linalg.norm(wrong, axis=1) / spread(exact)
    depth = np.minimum(cell.x, cell.length - cell.x)
    out: dict[str, object] = {}
    for margin in (0.0, D):
        gained = [
            (stress(pair[1], cell, margin, p) - stress(pair[0], cell, margin, p))[j, i]
            for pair, p in ((truth, True), (cut, False))
        ]
        out["stress" if margin else "stress of all"] = abs(gained[1] / gained[0] - 1.0)
    arms = [(np.delete(depth, k, 1) > 3 * D).all(1) for k in range(3)]
    out["motion of all"] = rms(size)
    out["motion"] = float(np.sqrt(np.mean([rms(size[arm]) ** 2 for arm in arms])))
    out["motion 2 d inside"] = rms(size[depth.min(1) > 2 * D])
    row = np.floor(depth.min(1) / (0.5 * D)).astype(int)
    out["profile"] = np.array([rms(size[row == k]) for k in range(row.max() + 1)])
    return out


def rms(size: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt((size**2).mean()))
