"""A saturated column in dynamics against the exact solution of the u-p equations."""

import shutil

import numpy as np

from talus import mesh as meshes
from talus.compare import max_of, same_arrays
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

# time, displacement of the top, pressures at 0, 5 and 9 m from the base
COLUMN = (
    (0.02, -5.42503112258e-05, (2414.88216041, 2414.96803495, 2295.53358972)),
    (0.05, -0.000250023622371, (5661.60942879, 5661.26266943, 3749.04342793)),
    (0.1, -0.000170847708709, (1614.3280896, 1591.87102209, 508.05489861)),
    (0.15, -0.00033818140439, (2612.16401976, 2500.15960604, -175.040950266)),
    (0.2, -0.000346690443779, (5020.44115968, 4806.16795356, 3350.64791212)),
    (0.3, -0.00049422820707, (5768.21195861, 5354.67999555, 3079.95487185)),
)
# frequency [Hz], amplitudes and phases of the top [m/Pa], [rad] and of the pressure at the base [-]
HARMONIC = (
    (5.0, (2.52541486897e-09, 2.63484225704), (0.985130640255, -0.000596453309777)),
    (20.0, (1.75766883237e-09, 2.78328263442), (1.06107423492, -0.00247534609876)),
    (50.0, (1.9231095512e-09, 2.93016828843), (1.76322601234, -0.00809847701599)),
)
CYCLES, RAMP, STEPS = 14, 8, 60
POISSON = 0.2
CONFINED = (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)


def write_run(case: Case, name: str, values: dict[str, object]) -> None:
    """Write the deck of a run with its values, and run it."""
    text = (case.folder / "deck.nml").read_text()
    for key, value in values.items():
        text = text.replace(key, value if isinstance(value, str) else repr(float(value)))
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")


def listed(values: np.ndarray) -> str:
    """Return values as a deck has them."""
    return ", ".join(repr(float(v)) for v in values)


def write_column(case: Case, name: str, height: float, n: int) -> np.ndarray:
    """Write a column of n elements; return the height of its nodes."""
    mesh = meshes.box(np.zeros(3), np.array([0.5, 0.5, height]), (1, 1, n))
    mesh = converted(mesh, "hex20")
    meshes.write_mesh(case.folder / f"{name}.h5", mesh)
    return mesh.x[:, 2]


def judge_ledger(case: Case, name: str, title: str) -> None:
    """Judge energy and mass."""
    energy = read_history(case.folder / f"{name}_energy.csv")
    largest = max_of(abs(v).max() for k, v in energy.items() if k not in ("time", "closure"))
    case.below(f"{title}: ledger", float(abs(energy["closure"]).max() / largest), 1e-6)
    books = read_history(case.folder / f"{name}_pore.csv")
    off = abs(books["balance"]).max() / abs(books["z1 entered"]).max()
    case.below(f"{title}: liquid unaccounted for", float(off), 1e-9)


def judge_column(case: Case, kind: str, ax: object) -> None:
    """Judge the column under A (1 - cos w t) in 100 elements and steps of 1 ms."""
    title = kind.split("'")[1]
    z = write_column(case, "column", 10.0, 100)
    times = np.linspace(0.0, 0.3, 301)
    write_run(case, title, {
        "T_END": 0.3, "MESH": "column", "YOUNG": 19.541e6 / CONFINED, "DENSITY": 0.67 * 2000.0,
        "FLUID": 0.33e12, "POROSITY": 0.33, "PERMEABILITY": 1.0e-9, "TIMES": listed(times),
        "VALUES": listed(1 - np.cos(75.0 * times)), "LOAD": 3000.0, "STEP": 1e-3, "THETA": 0.5,
        "OUTPUT": 1e-3, "KIND": kind,
    })  # fmt: skip
    steps = field_steps(case.folder / f"{title}.h5")
    top = np.array([s.solid["u"][np.isclose(z, 10.0), 2].mean() for s in steps])
    time = np.array([s.time for s in steps])
    p = np.array([[s.solid["pore_pressure"][np.isclose(z, at)].mean() for at in (0.0, 5.0, 9.0)]
                  for s in steps])  # fmt: skip
    off_u, off_p = [], []
    for t, u, pressures in COLUMN:
        k = int(np.argmin(abs(time - t)))
        off_u.append(abs(top[k] - u) / abs(top).max())
        off_p.append(np.abs(p[k] - pressures).max() / abs(p).max())
    case.below(f"{title}: top, error / largest", max_of(off_u), 0.02)
    case.below(f"{title}: pressures, error / largest", max_of(off_p), 0.02)
    judge_ledger(case, title, title)
    if ax is None:
        return
    for k, name in enumerate(("0 m", "5 m", "9 m")):
        ax.plot(time, p[:, k] / 1e3, lw=1, label=f"Talus, {name}")
        ax.plot([row[0] for row in COLUMN], [row[2][k] / 1e3 for row in COLUMN], "k+", ms=10)
    ax.set(xlabel="time [s]", ylabel="p [kPa]", title="+ exact")
    ax.legend()


def judge_half_space(case: Case) -> None:
    """Judge the top of a half space under a pulse: its impulse over the undrained impedance."""
    mesh = meshes.box(np.zeros(3), np.array([0.5, 0.5, 10.0]), (1, 1, 100))
    meshes.write_mesh(case.folder / "half.h5", mesh)
    times = np.linspace(0.0, 4e-3, 81)
    pulse = np.sin(np.pi * times / 4e-3) ** 2
    text = (case.folder / "half_space.nml").read_text()
    text = text.replace("TIMES", listed(times)).replace("VALUES", listed(pulse))
    (case.folder / "half_space.nml").write_text(text)
    case.run("talus-fem", "half_space.nml")
    density, modulus = 1990.0, 1.0e8 * CONFINED + 2.0e9 / 0.4
    impulse = 1.0e4 * np.r_[0.0, np.cumsum((pulse[1:] + pulse[:-1]) / 2 * np.diff(times))]
    z = mesh.x[:, 2]
    highest, off = np.isclose(z, z.max()), []
    for step in field_steps(case.folder / "half_space.h5"):
        top = step.solid["u"][highest, 2].mean()
        off.append(abs(top + np.interp(step.time, times, impulse) / np.sqrt(density * modulus)))
    scale = impulse[-1] / np.sqrt(density * modulus)
    case.below("half space: top, error / final", float(max_of(off) / scale), 0.01)


def judge_restart(case: Case) -> None:
    """Judge a run of 40 steps that goes on from its middle against the whole one."""
    text = (case.folder / "newmark.nml").read_text()
    text = text.replace("t_end = 0.3", "t_end = 0.04")
    text = text.replace("every_time = 0.001", "every_time = 0.02")
    deck = case.folder / "again.nml"
    deck.write_text(text + "&checkpoint every_time = 0.02 /\n")
    case.run("talus-fem", "again.nml")
    whole = field_steps(deck.with_suffix(".h5"))[-1].solid
    kept = {p: p.read_bytes() for p in case.folder.glob("again_*.csv")}
    shutil.copy(case.folder / "again.chk.1.h5", case.folder / "half.chk.h5")
    case.run("talus-fem", "again.nml", "--restart=half.chk.h5")
    same = same_arrays(whole, field_steps(deck.with_suffix(".h5"))[-1].solid)
    same = same and len(kept) > 0 and all(p.read_bytes() == data for p, data in kept.items())
    case.metric("restart: every bit", float(same), 1.0, 0)


def judge_harmonic(case: Case, ax: object) -> None:
    """Judge amplitudes after a load that grows to a harmonic one over eight cycles."""
    for frequency, top, base in HARMONIC:
        # three elements over the depth to which the drained top is felt, sqrt(2 c_v/omega)
        z = write_column(case, "harmonic", 5.0, round(60 * np.sqrt(frequency / 5.0)))
        period = 1 / frequency
        times = np.linspace(0.0, CYCLES * period, CYCLES * STEPS + 1)
        growth = np.clip(times / (RAMP * period), 0.0, 1.0)
        load = np.sin(2 * np.pi * frequency * times) * growth**2 * (3 - 2 * growth)
        name = f"harmonic_{frequency:.0f}"
        write_run(case, name, {
            "T_END": times[-1], "MESH": "harmonic", "YOUNG": 1.0e8 / CONFINED,
            "DENSITY": 0.6 * 2650.0, "FLUID": 2.0e9, "POROSITY": 0.4, "PERMEABILITY": 1.0e-11,
            "TIMES": listed(times), "VALUES": listed(load), "LOAD": 1000.0,
            "STEP": period / STEPS, "THETA": 0.5, "OUTPUT": 2 * period / STEPS,
            "KIND": "'newmark'",
        })  # fmt: skip
        steps = field_steps(case.folder / f"{name}.h5")
        late = [s for s in steps if s.time > (CYCLES - 4.01) * period]
        t = np.array([s.time for s in late])
        u = np.array([s.solid["u"][np.isclose(z, 5.0), 2].mean() for s in late])
        p = np.array([s.solid["pore_pressure"][np.isclose(z, 0.0)].mean() for s in late])
        phase = 2 * np.pi * frequency * t
        basis = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(t), t])
        for what, values, exact in (("top", u, top), ("base", p, base)):
            fit = np.linalg.lstsq(basis, values / 1000.0, rcond=None)[0]
            case.metric(f"{frequency:.0f} Hz: amplitude of the {what} / exact",
                        float(np.hypot(*fit[:2]) / exact[0]), 1.0, 0.01)  # fmt: skip
            late_by = np.arctan2(fit[1], fit[0]) - exact[1]
            case.below(f"{frequency:.0f} Hz: phase of the {what}, error [rad]",
                       float(abs((late_by + np.pi) % (2 * np.pi) - np.pi)), 0.01)  # fmt: skip
        ax.plot(phase / 2 / np.pi, p / 1000.0 / base[0], label=f"{frequency:.0f} Hz, p at the base")
    ax.set(xlabel="cycles", ylabel="p / exact amplitude [-]")
    ax.legend()


def run(case: Case) -> None:
    """Judge the shaken column and harmonic motions; plot pressures."""
    fig, (ax, bx) = case.figure(ncols=2)
    judge_column(case, "'newmark'", ax)
    judge_column(case, "'hht', alpha = -0.05", None)
    judge_restart(case)
    judge_half_space(case)
    judge_harmonic(case, bx)
    case.save(fig)
