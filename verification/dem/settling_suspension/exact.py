"""Velocities of settling suspensions against Richardson and Zaki."""

import numpy as np

from talus.packing import make_packing, write_h5
from talus.verification import Case, field_steps, read_history

SIDE, TALL, BRICKS = 6, 36, 9
LIQUID, SOLID, VISCOSITY, GRAVITY = 1000.0, 2650.0, 1.0e-3, 9.81
# diameter [m], solid fraction, velocity of P17 [m/s]
TABLE = (
    (2.0e-4, 0.2, 0.0105352265338), (2.0e-4, 0.3, 0.00631239302146),
    (2.0e-4, 0.4, 0.00349457630961), (1.0e-3, 0.3, 0.0609133844321),
)  # fmt: skip


def steady(d: float, solid: float, guess: float) -> float:
    """Velocity at which the pressure gradient bears the buoyant weight: w = -v [m/s]."""
    n, v = 1.0 - solid, guess
    for _ in range(200):
        re = LIQUID * d * v / VISCOSITY
        chi = 3.7 - 0.65 * np.exp(-0.5 * (1.5 - np.log10(re)) ** 2)
        drag = (0.63 + 4.8 / np.sqrt(re)) ** 2 * LIQUID * np.pi * d**2 / 8.0 * v**2 * n**-chi
        wanted = np.pi / 6.0 * d**3 * (SOLID - LIQUID) * GRAVITY * n
        v *= 1.0 + 0.5 * (wanted / drag - 1.0)
    return float(v)


def run(case: Case) -> None:
    """Let four suspensions settle."""
    deck = (case.folder / "column.nml").read_text()
    found, wanted = [], []
    for d, solid, velocity in TABLE:
        pitch = d * (np.pi / 6.0 / solid) ** (1.0 / 3.0)
        places = np.meshgrid(*(np.arange(n) for n in (SIDE, SIDE, TALL)), indexing="ij")
        x = pitch * (np.stack(places, -1).reshape(-1, 3) + 0.5)
        write_h5(case.folder / "lattice.h5", make_packing(x, np.full((len(x), 3), 0.5 * d)))
        end = (12.0 if d < 1.0e-3 else 8.0) * velocity / GRAVITY
        brick = TALL / BRICKS * pitch
        words = {
            "T_END": end, "STEP": end / 2000.0, "EDGE": SIDE * pitch,
            "UPPER": TALL * pitch + brick, "LAYERS": BRICKS + 1,
        }  # fmt: skip
        text = deck
        for word, value in words.items():
            text = text.replace(word, repr(value if isinstance(value, int) else float(value)))
        (case.folder / "now.nml").write_text(text)
        case.run("talus-dem", "now.nml", "--threads=1")
        last = field_steps(case.folder / "now.h5")[-1].grains
        z = x[:, 2] / (TALL * pitch)
        middle = (z > 1.0 / 3.0) & (z < 2.0 / 3.0)
        found.append(-float(last["v"][middle, 2].mean()))
        wanted.append(velocity)
        name = f"d = {1e3 * d:.1f} mm, c = {solid}"
        off = abs(found[-1] / steady(d, solid, velocity) - 1.0)
        case.below(f"{name}: velocity / that of the law, error", off, 0.01)
        if solid <= 0.3:
            off = abs(found[-1] / velocity - 1.0)
            case.below(f"{name}: velocity / Richardson and Zaki, error", off, 0.1, "P17")
        lost = float(read_history(case.folder / "now_pore.csv")["balance"].max())
        case.below(f"{name}: liquid that came from nowhere / pores", lost, 1e-12)
    fig, axes = case.figure(figsize=(4.4, 3.4))
    axes.loglog(wanted, wanted, label="Richardson and Zaki")
    axes.loglog(wanted, found, "o", label="suspension")
    axes.set(xlabel="velocity [m/s]", ylabel="velocity [m/s]")
    axes.legend(fontsize=8)
    case.save(fig)
