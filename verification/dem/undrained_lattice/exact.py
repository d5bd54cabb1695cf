"""Undrained compression of a saturated cubic lattice: Skempton's B and the bulk modulus."""

import numpy as np

from talus.packing import make_packing, write_h5
from talus.verification import Case, read_history

D, SIDE, FLUID, STRAIN = 1.0e-3, 4, 2.2e9, 1.0e-5
SOLID, LIQUID, STIFFNESS, LAYERS, SQUEEZED = 2650.0, 1000.0, 1.0e5, 100, 0.9995
POROSITY = 1.0 - np.pi / 6.0
BULK = (1.0e7, 1.0e8, 5.0e8)  # of the skeleton, those of P18


def run(case: Case) -> None:
    """Compress three lattices by the same strain along all axes."""
    places = np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij")
    x = D * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    write_h5(case.folder / "lattice.h5", make_packing(x, np.full((len(x), 3), 0.5 * D)))
    deck = (case.folder / "box.nml").read_text()
    found, wanted = [], []
    for bulk in BULK:
        stiffness = 3.0 * bulk * D
        text = deck.replace("STIFFNESS", repr(stiffness)).replace("TWICE", repr(2.0 * stiffness))
        (case.folder / "now.nml").write_text(text)
        case.run("talus-dem", "now.nml", "--threads=1")
        rows = read_history(case.folder / "now_pore.csv")
        walls = read_history(case.folder / "now_walls.csv")
        last = walls["time"] == walls["time"].max()
        force = np.column_stack([walls[f"force_{axis}"][last] for axis in "xyz"])
        contact = float(np.abs(force).sum() / 6.0 / (SIDE * D) ** 2)
        pressure = float(rows["pressure_z0"][-1])
        name = f"K = {1e-6 * bulk:.0f} MPa"
        skempton = 1.0 / (1.0 + POROSITY * bulk / FLUID)
        found.append(pressure / (pressure + contact))
        wanted.append(skempton)
        case.below(f"{name}: B, error", abs(found[-1] / skempton - 1.0), 0.005, "P18")
        stiff = (pressure + contact) / (3.0 * STRAIN)
        whole = bulk + FLUID / POROSITY
        case.below(f"{name}: undrained modulus, error", abs(stiff / whole - 1.0), 0.005, "P18")
        spread = float(np.ptp([rows[f"pressure_{side}"][-1] for side in ("x0", "x1", "z0", "z1")]))
        case.below(f"{name}: spread of the pressure", spread / pressure, 1e-6)
        lost = float(rows["balance"].max())
        case.below(f"{name}: liquid that came from nowhere / pores", lost, 1e-12, "P16")
        energy = read_history(case.folder / "now_energy.csv")
        closure = float(energy["relative_closure"][-1])
        case.below(f"{name}: closure of the ledger", closure, 1e-4)
        stored = energy["elastic"][-1] + energy["liquid"][-1]
        exact = 0.5 * whole * (3.0 * STRAIN) ** 2 * (SIDE * D) ** 3
        case.below(f"{name}: energy stored, error", float(abs(stored / exact - 1.0)), 0.01)
    wave(case)
    hold(case)
    fig, axes = case.figure(figsize=(4.6, 3.4))
    axes.semilogx(BULK, wanted, label="1/(1 + n K/K_f)")
    axes.semilogx(BULK, found, "o", label="lattice")
    axes.set(xlabel="bulk modulus of the skeleton [Pa]", ylabel="B [-]")
    axes.legend(fontsize=8)
    case.save(fig)


def wave(case: Case) -> None:
    """Swing a sealed column in its first mode: minima of the kinetic energy are H/c apart."""
    pitch = SQUEEZED * D
    places = np.meshgrid(*(np.arange(n) for n in (SIDE, SIDE, LAYERS)), indexing="ij")
    x = pitch * (np.stack(places, -1).reshape(-1, 3) + 0.5)
    height = LAYERS * pitch
    v = np.zeros_like(x)
    v[:, 2] = 1.0e-3 * np.sin(np.pi * x[:, 2] / height)
    write_h5(case.folder / "column.h5", make_packing(x, np.full((len(x), 3), 0.5 * D), v=v))
    text = (case.folder / "wave.nml").read_text()
    text = text.replace("EDGE", repr(SIDE * pitch)).replace("HEIGHT", repr(height))
    (case.folder / "now.nml").write_text(text)
    case.run("talus-dem", "now.nml", "--threads=1")
    energy = read_history(case.folder / "now_energy.csv")
    time, kinetic = energy["time"], energy["kinetic"]
    low = [k for k in range(1, len(time) - 1) if kinetic[k] < min(kinetic[k - 1], kinetic[k + 1])]
    least = []
    for k in low[:2]:
        a, b, c = kinetic[k - 1 : k + 2]
        least.append(time[k] + 0.5 * (time[k + 1] - time[k]) * (a - c) / (a - 2.0 * b + c))
    solid = np.pi / 6.0 / SQUEEZED**3
    density = solid * SOLID + (1.0 - solid) * LIQUID
    modulus = STIFFNESS / pitch + FLUID / (1.0 - solid)
    speed = np.sqrt(modulus / density)
    found = height / (least[1] - least[0]) if len(least) == 2 else np.inf
    case.below("speed of the undrained wave, error", float(abs(found / speed - 1.0)), 0.01)


def hold(case: Case) -> None:
    """Hold a total stress on the top: grains and liquid share it by their moduli."""
    case.run("talus-dem", "servo.nml", "--threads=1")
    servo = read_history(case.folder / "servo_servos.csv")["stress"][-1]
    case.below("total stress that the servo holds, error", float(abs(servo / 1.0e5 - 1.0)), 1e-3)
    pressure = read_history(case.folder / "servo_pore.csv")["pressure_z1"][-1]
    walls = read_history(case.folder / "servo_walls.csv")
    force = walls["force_z"][walls["wall"] == 6][-1]
    share = pressure / (pressure + force / (SIDE * D) ** 2)
    exact = FLUID / POROSITY / (3.0e8 + FLUID / POROSITY)
    case.below("liquid's share of it, error", float(abs(share / exact - 1.0)), 0.005, "P18")
