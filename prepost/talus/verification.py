"""What a verification case needs: input writers, readers of results, and the Case that judges.

A case is a folder verification/<area>/<id>/ with case.toml (id, title, quick, claim, source),
decks, and exact.py with `def run(case: Case) -> None`.
"""

import csv
import os
import re
import shlex
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from talus import mesh as meshes
from talus.compare import difference, extent, max_of
from talus.packing import make_packing, write_h5


def write_packing(
    path: Path,
    x: np.ndarray,
    axes: np.ndarray,
    quat: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    ids: np.ndarray | None = None,
    groups: dict[str, np.ndarray] | None = None,
    v: np.ndarray | None = None,
    omega: np.ndarray | None = None,
) -> None:
    """Write packing.h5 from arrays with one row a grain."""
    write_h5(Path(path), make_packing(x, axes, quat, kind, ids, groups, v, omega))


def write_hex_mesh(
    path: Path,
    x: np.ndarray,
    hex8: np.ndarray,
    facets: dict[str, np.ndarray] | None = None,
    nodes: dict[str, np.ndarray] | None = None,
    volumes: dict[str, np.ndarray] | None = None,
) -> None:
    """Write mesh.h5 from nodes (n, 3), hexahedra (m, 8) from 0, and groups."""
    volumes = volumes or {"all": np.arange(len(hex8))}
    meshes.write_mesh(Path(path), meshes.Mesh(x, hex8, volumes, facets or {}, nodes or {}))


def read_history(path: Path) -> dict[str, np.ndarray]:
    """Read a CSV history; keys are the column names without unit."""
    with Path(path).open() as file:
        rows = list(csv.reader(file))
    names = [name.split("[")[0].strip() for name in rows[0]]
    values = np.array([[float(cell) for cell in row] for row in rows[1:]]).reshape(-1, len(names))
    return {name: values[:, k] for k, name in enumerate(names)}


def history_difference(one: Path, other: Path) -> float:
    """Return the largest difference of two histories over the largest value of the same unit.

    Plain numbers count by their difference where all are below 1. Heads, shapes or places of NaN
    that differ count as infinite.
    """
    heads, others = (heads_of(path) for path in (one, other))
    a, b = (np.genfromtxt(path, delimiter=",", skip_header=1, ndmin=2) for path in (one, other))
    if heads != others or difference(a, b) == np.inf:
        return np.inf
    units = np.array([head.partition("[")[2].rstrip("]") for head in heads])
    found = 0.0
    for unit in set(units):
        part = units == unit
        scale = max_of(extent(a[:, part]), 1.0 if unit == "-" else 1e-300)
        found = max_of(found, difference(a[:, part], b[:, part]) / scale)
    return found


def heads_of(path: Path) -> list[str]:
    """Return the heads of the columns of a CSV file."""
    with Path(path).open() as file:
        return next(csv.reader(file))


@dataclass
class Step:
    """One step of a field file: time [s] and the arrays of grains, contacts or the solid."""

    time: float
    grains: dict[str, np.ndarray] = field(default_factory=dict)
    clumps: dict[str, np.ndarray] = field(default_factory=dict)
    contacts: dict[str, np.ndarray] = field(default_factory=dict)
    solid: dict[str, np.ndarray] = field(default_factory=dict)


def field_steps(path: Path) -> list[Step]:
    """Read all steps of run.h5; grains are sorted by id."""
    steps = []
    with h5py.File(path) as file:
        for name in sorted(file["steps"]):
            group = file["steps"][name]
            step = Step(float(np.ravel(group.attrs["time"])[0]))
            step.solid = {k: d[...] for k, d in group.items() if isinstance(d, h5py.Dataset)}
            if "grains" in group:
                grains = {k: d[...] for k, d in group["grains"].items()}
                order = np.argsort(grains["id"])
                step.grains = {k: d[order] for k, d in grains.items()}
            if "clumps" in group:
                step.clumps = {k: d[...] for k, d in group["clumps"].items()}
            if "contacts" in group:
                step.contacts = {k: d[...] for k, d in group["contacts"].items()}
            steps.append(step)
    return steps


def launcher(ranks: int) -> list[str]:
    """Return the command that starts a program with ranks; none for 0."""
    if ranks == 0:
        return []
    options = ["--oversubscribe", "--allow-run-as-root", "--bind-to", "none"]
    return ["mpirun", *options, "--mca", "mpi_yield_when_idle", "1", "-n", str(ranks)]


def start_on_ranks(deck: Path, side: str, ranks: int, program: Path) -> None:
    """Rewrite a deck of talus-couple so that it starts a side ('grains', 'solid') by mpirun.

    A deck whose &program of that side has a launch of its own stays as it is.
    """
    command = shlex.join([*launcher(ranks), str(program)])
    text = re.sub(
        rf"(&program\s+side\s*=\s*'{side}',)(?![^/]*\blaunch\b)",
        rf"\1 launch = 'command', command = '{command}',",
        deck.read_text(),
    )
    deck.write_text(text)


@dataclass
class Case:
    """One verification case at work: runs programs in its scratch folder and gathers judgements."""

    id: str
    title: str
    folder: Path
    binaries: Path
    ranks: int = 0  # of every run of talus-dem that sets none itself
    solid_ranks: int = 0  # of talus-fem in coupled runs
    metrics: list[dict] = field(default_factory=list)
    figures: list[str] = field(default_factory=list)

    def bin(self, program: str) -> Path:
        """Path of a program."""
        return self.binaries / program

    def run(
        self, program: str, deck: str, *args: str, expect: int = 0, timeout: float = 1800.0,
        ranks: int = 0,
    ) -> subprocess.CompletedProcess:  # fmt: skip
        """Run a program on a deck in the case's folder; an unexpected exit code raises.

        With ranks mpirun starts it; waiting ranks yield, as there may be fewer processors. Of
        coupled runs the grains have as many as the case, and the solid its own number.
        """
        if program == "talus-dem":
            ranks = ranks or self.ranks
        if program == "talus-couple" and "--weights" not in args:
            self.spread_sides(self.folder / deck)
        environment = dict(os.environ)
        environment.setdefault("OMP_NUM_THREADS", "1")
        done = subprocess.run(
            [*launcher(ranks), str(self.bin(program)), deck, *args], cwd=self.folder,
            env=environment, capture_output=True, text=True, timeout=timeout,
        )  # fmt: skip
        if done.returncode != expect:
            tail = (done.stdout + done.stderr)[-1500:]
            raise RuntimeError(
                f"{program} {deck} ended with {done.returncode}, not {expect}\n{tail}"
            )
        return done

    def spread_sides(self, deck: Path) -> None:
        """Give both sides of a coupled deck the ranks of the case."""
        if self.ranks:
            start_on_ranks(deck, "grains", self.ranks, self.bin("talus-dem"))
        if self.solid_ranks:
            start_on_ranks(deck, "solid", self.solid_ranks, self.bin("talus-fem"))

    def metric(
        self, name: str, value: float, expected: float, limit: float, note: str = ""
    ) -> None:
        """Judge |value - expected| <= limit."""
        good = abs(value - expected) <= limit
        self.judge(name, value, expected, limit, good, note)

    def below(self, name: str, value: float, limit: float, note: str = "") -> None:
        """Judge value <= limit."""
        self.judge(name, value, None, limit, value <= limit, note)

    def above(self, name: str, value: float, limit: float, note: str = "") -> None:
        """Judge value >= limit."""
        self.judge(name, value, None, limit, value >= limit, note)

    def judge(
        self, name: str, value: float, expected: float | None, limit: float, good: bool, note: str
    ) -> None:
        """Keep one judgement; a value that is no finite number fails."""
        finite = float(value) if np.isfinite(value) else None
        wanted = None if expected is None else float(expected)
        entry = {"metric": name, "value": finite, "expected": wanted, "limit": float(limit)}
        self.metrics.append(entry | {"pass": finite is not None and bool(good), "note": note})

    def same_histories(self, title: str, kept: dict[str, str], rounding: float) -> None:
        """Judge histories against their text of before: every row the same, digit by digit.

        On ranks sums of their parts go on in another order after a restart: then the largest
        difference must be below `rounding`, over the largest value of the same unit.
        """
        now = {name: (self.folder / name).read_text() for name in kept}
        if not self.ranks:
            both = [(text.splitlines(), now[name].splitlines()) for name, text in kept.items()]
            rows = sum(a != b for one, two in both for a, b in zip(one, two, strict=True))
            self.below(f"{title}, rows that differ", float(rows), 0.0)
            return
        off = 0.0
        for name, text in kept.items():
            (self.folder / "kept.csv").write_text(text)
            off = max_of(off, history_difference(self.folder / "kept.csv", self.folder / name))
        self.below(f"{title}, largest difference on ranks", off, rounding)

    def figure(self, **options: object) -> tuple:
        """Return (fig, ax) in the common style."""
        from talus.look import new_figure

        return new_figure(**options)

    def save(self, fig: object, name: str = "figure.png") -> None:
        """Save a figure beside the results and keep its name."""
        from talus.look import save_figure

        save_figure(fig, self.folder / name)
        self.figures.append(name)
