"""Consolidation in one dimension against Terzaghi's series and a transform of two layers."""

import shutil
from pathlib import Path

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of, same_arrays
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

VISCOSITY = 1.0e-3
# young, poisson, biot, porosity, K_f (0: infinite), permeability, height, load
SOIL = (1.0e7, 0.3, 1.0, 0.4, 0.0, 1.0e-12, 1.0, 1.0e4)
ROCK = (6.0e9, 0.2, 0.8, 0.2, 2.2e9, 1.0e-15, 5.0, 1.0e6)
# two layers: times, p at 0.25, 0.5, 0.75 and 1 m from the top, settlement
LAYERS = (
    (1.0, (8724.00292658, 9991.55908679, 9999.29505611, 9999.92444459), 9.72540534318e-05),
    (5.0, (5292.72813584, 9308.48301555, 9557.74960152, 9638.24277573), 2.18135100254e-04),
    (20.0, (3510.37548088, 6658.10321042, 6873.21597746, 6945.41976272), 4.77342065539e-04),
    (100.0, (583.416191268, 1106.5964076, 1142.35127382, 1154.35274646), 1.0084240724e-03),
)
SKEMPTON = ((1.0e7, 0.36, 0.998366309675), (1.0e8, 0.45, 0.97995545657),
            (5.0e8, 0.45, 0.907216494845))  # fmt: skip


class Column:
    """Constants of a column, and Terzaghi's series for it."""

    def __init__(self, data: tuple[float, ...]) -> None:
        """Derive storage, moduli and c_v from the constants of the deck."""
        self.young, self.poisson, self.biot, self.porosity, self.fluid = data[:5]
        self.permeability, self.height, self.load = data[5:]
        bulk = self.young / 3 / (1 - 2 * self.poisson)
        self.grains = 0.0 if self.biot == 1 else bulk / (1 - self.biot)
        self.storage = self.porosity / self.fluid if self.fluid else 0.0
        if self.grains:
            self.storage += (self.biot - self.porosity) / self.grains
        shear = self.young / 2 / (1 + self.poisson)
        self.confined = bulk + 4 / 3 * shear
        self.c = self.permeability / VISCOSITY / (self.storage + self.biot**2 / self.confined)
        self.p0 = self.load * self.biot / (self.biot**2 + self.confined * self.storage)

    def time(self, factor: float) -> float:
        """Time of a time factor [s]."""
        return factor * self.height**2 / self.c

    def pressure(self, depth: np.ndarray, factor: float) -> np.ndarray:
        """Pressure at depths [Pa]."""
        m = np.arange(400) * 2 + 1
        waves = np.sin(np.outer(depth, m) * np.pi / 2 / self.height)
        return self.p0 * 4 / np.pi * waves @ (np.exp(-((m * np.pi / 2) ** 2) * factor) / m)

    def settlement(self, factor: float) -> float:
        """Settlement of the top [m]."""
        m = np.arange(2000) * 2 + 1
        mean = self.p0 * 8 / np.pi**2 * np.sum(np.exp(-((m * np.pi / 2) ** 2) * factor) / m**2)
        return self.height / self.confined * (self.load - self.biot * mean)

    def run(self, case: Case, element: str, n: int, factor: float, steps: int, name: str,
            go: bool = True) -> Path:  # fmt: skip
        """Run n elements over `steps` steps to a time factor; four fields are written."""
        kind = element.split("_")[0]
        path = case.folder / f"{kind}_{n}_{self.height:.0f}.h5"
        width = 0.1 * self.height
        mesh = meshes.box(np.zeros(3), np.array([width, width, self.height]), (1, 1, n))
        meshes.write_mesh(path, converted(mesh, kind))
        values = {"T_END": self.time(factor), "MESH": path.stem, "YOUNG": self.young,
                  "POISSON": self.poisson, "ELEMENT": element, "FLUID": self.fluid,
                  "POROSITY": self.porosity, "PERMEABILITY": self.permeability, "BIOT": self.biot,
                  "GRAINS": self.grains, "LOAD": self.load, "STEP": self.time(factor) / steps,
                  "OUTPUT": self.time(factor) / 4}  # fmt: skip
        write_deck(case, "deck.nml", name, values)
        if go:
            case.run("talus-fem", f"{name}.nml")
        return case.folder / name


def write_deck(case: Case, source: str, name: str, values: dict[str, object]) -> None:
    """Write the deck of a run with its values."""
    text = (case.folder / source).read_text()
    for key, value in values.items():
        text = text.replace(key, str(value) if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)


def nodes_of(path: Path) -> np.ndarray:
    """Return the nodes of a mesh file [m]."""
    return meshes.read_mesh(path).x


def judge_column(case: Case, data: tuple[float, ...], element: str, title: str, ax: object) -> None:
    """Judge pressure, settlement, mass and ledger of 20 elements and 100 steps to T = 0.2."""
    column = Column(data)
    name = f"{title}_{element}"
    stem = column.run(case, element, 20, 0.2, 100, name)
    x = nodes_of(case.folder / f"{element.split('_')[0]}_20_{column.height:.0f}.h5")
    depth = column.height - x[:, 2]
    off, sink = [], []
    for step in field_steps(stem.with_suffix(".h5"))[1:]:
        factor = step.time * column.c / column.height**2
        exact = column.pressure(depth, factor)
        off.append(np.abs(step.solid["pore_pressure"] - exact).max() / column.p0)
        top = -step.solid["u"][depth < 1e-9, 2].mean()
        sink.append(abs(top - column.settlement(factor)) / column.settlement(np.inf))
        order = np.argsort(depth)
        ax.plot(exact[order] / column.p0, depth[order] / column.height, "k-", lw=1)
        mark = "o" if element == "hex20" else "x"
        found = step.solid["pore_pressure"] / column.p0
        ax.plot(found, depth / column.height, mark, ms=4, mfc="none")
    case.below(f"{title}, {element}: pressure, error / p0", max_of(off), 0.01)
    case.below(f"{title}, {element}: settlement, error / final one", max_of(sink), 0.01)
    judge_books(case, stem, f"{title}, {element}")
    stress = field_steps(stem.with_suffix(".h5"))[-1].solid["total_stress"][:, 2]
    case.metric(f"{title}, {element}: total stress / load", float(-stress.mean() / column.load),
                1.0, 1e-9)  # fmt: skip


def judge_books(case: Case, stem: Path, title: str) -> None:
    """Judge mass and energy."""
    books = read_history(Path(f"{stem}_pore.csv"))
    scale = abs(books["z1 entered"]).max()
    off = float(abs(books["balance"]).max() / scale)
    case.below(f"{title}: liquid unaccounted for", off, 1e-12)
    energy = read_history(Path(f"{stem}_energy.csv"))
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{title}: ledger", float(abs(energy["closure"]).max() / largest), 1e-12)


def judge_order(case: Case, element: str, ax: object) -> None:
    """Judge the order of the pressure at T = 0.2, steps as the square of the element."""
    column = Column(SOIL)
    errors, sizes = [], (5, 10, 20)
    for n in sizes:
        stem = column.run(case, element, n, 0.2, n * n // 4, f"order_{element}_{n}")
        x = nodes_of(case.folder / f"{element.split('_')[0]}_{n}_1.h5")
        last = field_steps(stem.with_suffix(".h5"))[-1].solid["pore_pressure"]
        exact = column.pressure(1.0 - x[:, 2], 0.2)
        errors.append(float(np.sqrt(np.mean((last - exact) ** 2)) / column.p0))
    order = float(np.log2(errors[1] / errors[2]))
    case.metric(f"{element}: order of the pressure", order, 2.0, 0.2)
    ax.loglog([1 / n for n in sizes], errors, "o-", mfc="none", label=element)


def judge_layers(case: Case) -> None:
    """Judge two layers at four times, a run each."""
    mesh = meshes.box(np.zeros(3), np.array([0.1, 0.1, 1.0]), (1, 1, 20))
    centre = mesh.x[mesh.hex8].mean(axis=1)[:, 2]
    mesh.volumes |= {"upper": np.flatnonzero(centre > 0.5), "lower": np.flatnonzero(centre < 0.5)}
    mesh = converted(mesh, "hex20")
    meshes.write_mesh(case.folder / "layers.h5", mesh)
    off, sink = [], []
    for time, pressure, settlement in LAYERS:
        write_deck(case, "layers.nml", f"layers_{time:.0f}",
                   {"T_END": time, "STEP": time / 60, "OUTPUT": time})  # fmt: skip
        case.run("talus-fem", f"layers_{time:.0f}.nml")
        last = field_steps(case.folder / f"layers_{time:.0f}.h5")[-1].solid
        for depth, p in zip((0.25, 0.5, 0.75, 1.0), pressure, strict=True):
            at = np.isclose(mesh.x[:, 2], 1.0 - depth)
            off.append(abs(last["pore_pressure"][at].mean() - p) / 1e4)
        top = -last["u"][np.isclose(mesh.x[:, 2], 1.0), 2].mean()
        sink.append(abs(top / settlement - 1))
    case.below("two layers: pressure, error / load", max_of(off), 0.01)
    case.below("two layers: settlement, error", max_of(sink), 0.01)


def judge_sealed(case: Case) -> None:
    """Judge Skempton's B of a sealed cube."""
    mesh = meshes.box(np.zeros(3), np.ones(3), (2, 2, 2))
    meshes.write_mesh(case.folder / "cube.h5", converted(mesh, "hex20"))
    off = []
    for k, (bulk, porosity, skempton) in enumerate(SKEMPTON):
        write_deck(case, "sealed.nml", f"sealed_{k}",
                   {"YOUNG": 1.5 * bulk, "POROSITY": porosity, "AIR": 0.0})  # fmt: skip
        case.run("talus-fem", f"sealed_{k}.nml")
        last = field_steps(case.folder / f"sealed_{k}.h5")[-1].solid["pore_pressure"]
        off.append(np.abs(last / 1e5 / skempton - 1).max())
    case.below("sealed cube: Skempton's B, error", max_of(off), 1e-10)
    write_deck(case, "sealed.nml", "sealed_air", {"YOUNG": 1.5e7, "POROSITY": 0.36, "AIR": 0.01})
    case.run("talus-fem", "sealed_air.nml")
    last = field_steps(case.folder / "sealed_air.h5")[-1].solid["pore_pressure"]
    skempton = 1 / (1 + 0.36 * 1.0e7 * (0.99 / 2.2e9 + 0.01 / 101325.0))
    off = float(np.abs(last / 1e5 / skempton - 1).max())
    case.below("sealed cube with 1 % of air: Skempton's B, error", off, 1e-10)


def judge_restart(case: Case) -> None:
    """Judge a run that goes on from a checkpoint half-way against a whole one."""
    column = Column(ROCK)
    stem = column.run(case, "hex20", 10, 0.2, 20, "restart", go=False)
    deck = stem.with_suffix(".nml")
    every = column.time(0.2) / 2
    deck.write_text(deck.read_text() + f"&checkpoint every_time = {every!r} /\n")
    case.run("talus-fem", "restart.nml")
    whole = field_steps(stem.with_suffix(".h5"))
    kept = {p: p.read_bytes() for p in case.folder.glob("restart_*.csv")}
    shutil.copy(case.folder / "restart.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", "restart.nml", "--restart=half.chk.h5")
    again = field_steps(stem.with_suffix(".h5"))
    same = len(kept) > 0 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    case.metric("restart: every bit", float(same), 1.0, 0)


def judge_control(case: Case) -> None:
    """Judge steps that find their lengths, to T = 1, and a restart among them."""
    column = Column(SOIL)
    stem = column.run(case, "hex20", 20, 1.0, 2000, "control", go=False)
    deck = stem.with_suffix(".nml")
    every = column.time(0.5)
    text = deck.read_text().replace("kind = 'static'", "kind = 'static', step_error = 1.0e-3")
    deck.write_text(text + f"&checkpoint every_time = {every!r} /\n")
    case.run("talus-fem", "control.nml")
    x = nodes_of(case.folder / "hex20_20_1.h5")
    whole = field_steps(stem.with_suffix(".h5"))
    off = [
        np.abs(s.solid["pore_pressure"] - column.pressure(1.0 - x[:, 2], s.time / column.time(1.0)))
        for s in whole[1:]
    ]
    case.below("steps of their own: pressure, error / p0", float(np.max(off) / column.p0), 0.01)
    table = read_history(Path(f"{stem}_newton.csv"))
    case.below("steps of their own: number", float(len(np.unique(table["time"]))), 200.0)
    judge_books(case, stem, "steps of their own")
    kept = {p: p.read_bytes() for p in case.folder.glob("control_*.csv")}
    shutil.copy(case.folder / "control.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", "control.nml", "--restart=half.chk.h5")
    again = field_steps(stem.with_suffix(".h5"))
    same = len(kept) > 0 and len(whole) == len(again)
    for a, b in zip(whole, again, strict=True):
        same = same and same_arrays(a.solid, b.solid)
    same = same and all(p.read_bytes() == data for p, data in kept.items())
    case.metric("steps of their own, restart: every bit", float(same), 1.0, 0)


def run(case: Case) -> None:
    """Judge columns, order, layers, the sealed cube and a restart; plot isochrones and errors."""
    fig, (ax, bx) = case.figure(ncols=2)
    judge_column(case, SOIL, "hex20", "Terzaghi", ax)
    judge_column(case, SOIL, "hex8_bbar", "Terzaghi", ax)
    judge_column(case, ROCK, "hex20", "compressible", ax)
    ax.set(xlabel="p / p0 [-]", ylabel="depth / height [-]", title="T = 0.05 to 0.2")
    ax.invert_yaxis()
    for element in ("hex20", "hex8_bbar", "tet4"):
        judge_order(case, element, bx)
    line = np.array([0.05, 0.2])
    bx.loglog(line, 0.02 * (line / 0.2) ** 2, "k--", lw=1, label="second order")
    bx.set(xlabel="element / height [-]", ylabel="error of p / p0 [-]")
    bx.legend()
    judge_layers(case)
    judge_sealed(case)
    judge_restart(case)
    judge_control(case)
    case.save(fig)
