"""Flow through a bed of fixed spheres by each law; a free one that is lifted."""

import numpy as np

from talus.packing import FIXED, make_packing, write_h5
from talus.verification import Case, read_history

D, SIDE, VISCOSITY, LIQUID, SOLID, GRAVITY = 1.0e-3, 3, 1.0e-3, 1000.0, 2650.0, 9.81
POROSITY = 1.0 - np.pi / 6.0
LEVELS = ((0.25, 0.039), (0.5, 0.064), (0.75, 0.089), (0.9, 0.114), (0.95, 0.134))


def gradient(law: str, n: float, speed: float) -> float:
    """Pressure gradient of a bed at a superficial velocity [Pa/m]."""
    phi, re = 1.0 - n, LIQUID * D * speed / VISCOSITY
    viscous = VISCOSITY * speed / D**2
    if law == "kozeny_carman":
        return 180.0 * phi**2 / n**3 * viscous
    if law == "ergun":
        return (150.0 * phi**2 + 1.75 * re * phi) / n**3 * viscous
    if law == "koch_hill":  # dense: phi above 0.4
        return 18.0 * phi / n * n * viscous * (
            10.0 * phi / n**3 + 0.5 * re * (0.0673 + 0.212 * phi + 0.0232 / n**5)
        )  # fmt: skip
    if law == "beetstra":
        slow = 10.0 * phi / n**2 + n**2 * (1.0 + 1.5 * np.sqrt(phi))
        fast = (1.0 / n + 3.0 * n * phi + 8.4 * re**-0.343) / (
            1.0 + 10.0 ** (3.0 * phi) * re ** (-0.5 - 2.0 * phi)
        )
        return 18.0 * phi / n * viscous * (slow + 0.413 * re / 24.0 / n**2 * fast)
    chi = 3.7 - 0.65 * np.exp(-0.5 * (1.5 - np.log10(re)) ** 2)
    force = (0.63 + 4.8 / np.sqrt(re)) ** 2 * LIQUID * np.pi * D**2 / 8.0 * speed**2 * n**-chi
    return phi * force / (np.pi / 6.0 * D**3) / n  # drag without the pressure gradient's force


def lattice(layers: int) -> np.ndarray:
    """Return the centres of a simple cubic lattice [m]."""
    places = np.meshgrid(*(np.arange(k) for k in (SIDE, SIDE, layers)), indexing="ij")
    return D * (np.stack(places, -1).reshape(-1, 3) + 0.5)


def run(case: Case) -> None:
    """Five laws at two speeds; then the quick condition."""
    x = lattice(12)
    kind = np.full(len(x), FIXED)
    write_h5(case.folder / "still.h5", make_packing(x, np.full((len(x), 3), 0.5 * D), kind=kind))
    deck = (case.folder / "flow.nml").read_text()
    for law in ("kozeny_carman", "ergun", "koch_hill", "beetstra", "di_felice"):
        for speed in (1.0e-4, 0.05):
            text = deck.replace("LAW", law).replace("SPEED", repr(speed))
            (case.folder / "now.nml").write_text(text)
            case.run("talus-dem", "now.nml", "--threads=1")
            rows = read_history(case.folder / "now_pore.csv")
            found = rows["pressure_z0"][-1] / 0.012
            off = abs(found / gradient(law, POROSITY, speed) - 1.0)
            case.below(f"{law}, {speed} m/s: gradient, error", float(off), 1e-6, "P14")
    quick(case)


def quick(case: Case) -> None:
    """Lift a column by the flow through it."""
    x = lattice(12)
    write_h5(case.folder / "free.h5", make_packing(x, np.full((len(x), 3), 0.5 * D)))
    height = 12 * D
    weight = (1.0 - POROSITY) * (SOLID - LIQUID) * GRAVITY * height  # Pa, buoyant
    text = (case.folder / "quick.nml").read_text().replace("CRITICAL", repr(float(weight)))
    (case.folder / "now.nml").write_text(text)
    case.run("talus-dem", "now.nml", "--threads=1")
    walls = read_history(case.folder / "now_walls.csv")
    floor = walls["wall"] == 1
    time, stress = walls["time"][floor], -walls["force_z"][floor] / (SIDE * D) ** 2 / weight
    for level, at in LEVELS:
        off = abs(float(np.interp(at, time, stress)) - (1.0 - level))
        case.below(f"i = {level} i_c: stress on the floor, error / weight", off, 0.02, "P13")
    energy = read_history(case.folder / "now_energy.csv")
    energy_time, contacts = energy["time"], energy["contacts"]
    settled = energy_time > 0.039
    gone = energy_time[settled & (contacts < 0.5 * contacts[settled][0])]
    onset = float(np.interp(gone[0], [0.135, 0.14], [0.95, 1.05])) if len(gone) else np.inf
    off = abs(onset - 1.0)
    case.below("gradient at which half of the contacts are gone / i_c, error", off, 0.05, "P13")
    lost = read_history(case.folder / "now_pore.csv")["balance"].max()
    case.below("liquid that came from nowhere / pores", float(lost), 1e-12)
    fig, axes = case.figure(figsize=(5.2, 3.6))
    axes.plot(1e3 * time, stress, label="floor")
    times = [0.0, 0.04, 0.05, 0.065, 0.075, 0.09, 0.10, 0.115, 0.12, 0.135, 0.1375]
    levels = [0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 0.9, 0.9, 0.95, 0.95, 1.0]
    wanted = 1.0 - np.interp(time, times, levels)
    axes.plot(1e3 * time, wanted, ":", color="black", label="1 - i/i_c")
    axes.set(xlabel="time [ms]", ylabel="stress on the floor / buoyant weight [-]")
    axes.legend(fontsize=8)
    case.save(fig)
