"""Liquid that enters a lattice through a layer, against the series of the third kind."""

import h5py
import numpy as np
from same_bits import judge

from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

D, STIFFNESS, LAYERS, SIDE = 1.0e-3, 1.0e5, 48, 3
FLUID, MOBILITY, PRESSURE, RAMP, STRESS = 2.2e9, 5.0e-10, 1.0e4, 2.0e-4, 2.0e4
HEIGHT, MODULUS, LAYER = LAYERS * D, STIFFNESS / D, 6.0e-3
STORAGE = (1.0 - np.pi / 6.0) / FLUID
COMPRESSED = STORAGE + 1.0 / MODULUS  # volume that a pressure takes in, by volume [1/Pa]
SPEED = MOBILITY / COMPRESSED
FACTORS = 0.01 * np.arange(1, 11)  # of time
BRICKS = {4: "o-", 8: "s--", 16: "^:"}


class Series:
    """Pressure over the floor's depth after a ramp of the pressure outside; the top is drained."""

    def __init__(self, layer: float) -> None:
        """Find the waves of a layer [m]: tan b = -b layer/height."""
        self.layer = layer
        high = np.pi * np.arange(1, 401)
        low = high - 0.5 * np.pi
        for _ in range(60):
            b = 0.5 * (low + high)
            above = (np.sin(b) + layer / HEIGHT * b * np.cos(b)) * np.sin(low) < 0.0
            low, high = np.where(above, low, b), np.where(above, b, high)
        self.wave = b = high
        steady = HEIGHT / (HEIGHT + layer) * (np.sin(b) - b * np.cos(b)) / b**2
        self.part = steady / (0.5 - np.sin(2.0 * b) / (4.0 * b))

    def fading(self, time: float) -> np.ndarray:
        """Return how much of each wave is left after the ramp."""
        rate = self.wave**2 * SPEED / HEIGHT**2
        return (np.exp(-rate * (time - RAMP)) - np.exp(-rate * time)) / (rate * RAMP)

    def pressure(self, z: np.ndarray, time: float) -> np.ndarray:
        """Return the pressure at heights [Pa]."""
        down = 1.0 - z / HEIGHT
        waves = np.sin(np.outer(down, self.wave)) @ (self.part * self.fading(time))
        return PRESSURE * (down * HEIGHT / (HEIGHT + self.layer) - waves)

    def taken(self, time: float) -> float:
        """Return what the column has taken in by its area: the integral of its pressure [m]."""
        b = self.wave
        whole = 0.5 * HEIGHT / (HEIGHT + self.layer)
        left = np.sum((1.0 - np.cos(b)) / b * self.part * self.fading(time))
        return float(COMPRESSED * PRESSURE * HEIGHT * (whole - left))


def make_lattice(case: Case) -> None:
    """Write the lattice, pressed by its load."""
    places = np.meshgrid(*(np.arange(n) for n in (SIDE, SIDE, LAYERS)), indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    x[:, 2] *= 1.0 - STRESS / MODULUS
    write_h5(case.folder / "lattice.h5", make_packing(x, np.full((len(x), 3), 0.5 * D)))


def run_column(case: Case, name: str, bricks: int, layer: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and pressures at the nodes (times, nodes) [Pa]."""
    deck = (case.folder / "column.nml").read_text()
    every = FACTORS[0] * HEIGHT**2 / SPEED
    words = {"bricks": bricks, "layer": f", layer = {layer}" if layer else "",
             "every": f"{every:.12g}", "t_end": f"{len(FACTORS) * every:.12g}"}  # fmt: skip
    for word, value in words.items():
        deck = deck.replace(f"@{word}@", str(value))
    (case.folder / f"{name}.nml").write_text(deck)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    with h5py.File(case.folder / f"{name}_pore.h5") as file:
        steps = [file["steps"][name] for name in sorted(file["steps"])]
        p = np.array([step["excess_pressure"][::4] for step in steps])
    times = np.array([step.time for step in field_steps(case.folder / f"{name}.h5")])
    return times[1:], p[1:]


def taken_in(p: np.ndarray) -> np.ndarray:
    """Return the volume that pressures have brought in, by area [m]."""
    inner = p.sum(1) - 0.5 * (p[:, 0] + p[:, -1])
    return COMPRESSED * HEIGHT / (p.shape[1] - 1) * inner


def run(case: Case) -> None:
    """Let pressure in with and without a layer, in coarse and fine bricks."""
    make_lattice(case)
    fig, axes = case.figure(figsize=(5.6, 4.0))
    off = {}
    for name, layer in (("layer", LAYER), ("held", 0.0)):
        series = Series(layer)
        for bricks, style in BRICKS.items():
            times, p = run_column(case, f"{name}_{bricks}", bricks, layer)
            wanted = np.array([series.taken(t) for t in times])
            off[name, bricks] = np.abs(taken_in(p) / wanted - 1.0)
            style = f"C{int(name == 'held')}{style}"
            axes.semilogy(FACTORS, off[name, bricks], style, label=f"{name}, {bricks} bricks")
            if name == "layer" and bricks == max(BRICKS):
                wanted = series.pressure(np.linspace(0.0, HEIGHT, bricks + 1), times[-1])
                error = float(np.abs(p[-1] - wanted).max() / PRESSURE)
                case.below("T = 0.1: pressures, error / that outside", error, 0.01)
    judge_orders(case, off)
    rows = read_history(case.folder / f"layer_{max(BRICKS)}_pore.csv")
    case.below("liquid from nowhere / pores", float(rows["balance"].max()), 1e-12, "rounding")
    energy = read_history(case.folder / f"layer_{max(BRICKS)}_energy.csv")
    case.below("closure of the ledger", float(energy["relative_closure"][-1]), 1e-4)
    deck = (case.folder / "layer_4.nml").read_text()
    (case.folder / "bits.nml").write_text(deck + "&checkpoint every_time = 1.0e-3, keep = 9 /\n")
    case.run("talus-dem", "bits.nml", "--threads=1")
    judge(case, "bits")
    axes.set(xlabel="time factor T", ylabel="what came in, relative error")
    axes.legend(fontsize=7)
    case.save(fig)


def judge_orders(case: Case, off: dict[tuple[str, int], np.ndarray]) -> None:
    """Judge errors of what came in over the time factors, by name and bricks."""
    for k in (4, 9):
        coarse, middle, fine = (off["layer", bricks][k] for bricks in BRICKS)
        order = float(np.log2((coarse - middle) / (middle - fine)))
        title = f"T = {FACTORS[k]:.2f}: order in the bricks of what came in"
        case.above(title, order, 1.7, "second order")
        case.below(f"{title}, not more", order, 2.3, "second order")
    case.below("T = 0.01, 4 bricks: what came in, error", float(off["layer", 4][0]), 0.2)
    gain = float(off["held", 4][0] / off["layer", 4][0])
    case.above("T = 0.01, 4 bricks: error of a held side / that of the layer", gain, 5.0)
