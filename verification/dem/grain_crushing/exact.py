"""Single grains that break: strength, place of fragments, mass, momentum, energy."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

STRENGTH, SIZE, MODULUS, DENSITY, YOUNG = 40.0e6, 2.0e-3, 3.0, 2650.0, 70.0e9
GRAINS = (1, 2, 1000000007)  # ids
AXES = np.array([1.25e-3, 1.0e-3, 0.75e-3])  # [m]
KEPT, KEPT_INERTIA = 0.5238612304555293, 0.4184633846915321  # of a sphere by fourteen fragments
SIX, EIGHT = np.sqrt(2.0) - 1.0, 0.2300931878706982  # radii of fragments of a unit sphere
SPINS = np.array([[900.0, -500.0, 2000.0], [-400.0, 1500.0, 700.0]])  # [rad/s]
TURNS = {"a": [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0], "b": [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0],
         "c": [1.0, 0.0, 0.0, 0.0]}  # axis that is upright  # fmt: skip


def unit_number(grain: int, seed: int) -> float:
    """Return the number between 0 and 1 of an id and a seed."""
    most = (1 << 64) - 1
    z = (grain * 0x9E3779B97F4A7C15 + seed * 0xD1B54A32D192ED03) & most
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & most
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & most
    z ^= z >> 31
    return ((z >> 11) + 0.5) * 2.0**-53


def strength(grain: int, diameter: float) -> float:
    """Return the strength of a grain [Pa]."""
    return (
        STRENGTH
        * (diameter / SIZE) ** (-3.0 / MODULUS)
        * (-np.log(unit_number(grain, 1))) ** (1.0 / MODULUS)
    )


def run_platens(case: Case, name: str, axes: np.ndarray, quat: list, height: float, words: str,
                grain: int = 1, level: float = STRENGTH) -> dict:  # fmt: skip
    """Squeeze one grain until it has broken; return rows and fields."""
    x = np.array([[0.0, 0.0, 0.5 * height]])
    write_packing(case.folder / "pack.h5", x, axes[None], quat=np.array([quat]),
                  ids=np.array([grain]))  # fmt: skip
    speed = 0.15
    t_end = 0.04 * height / speed
    words = {"HEIGHT": f"{float(height)!r}", "SPEED": f"{speed}", "T_END": f"{t_end:.6e}",
             "OUTPUT": f"{t_end / 50:.6e}", "WORDS": words,
             "40.0e6": f"{level}"}  # fmt: skip
    text = (case.folder / "platens.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    return {
        "events": read_history(case.folder / f"{name}_broken.csv"),
        "rows": read_history(case.folder / f"{name}_breakage.csv"),
        "energy": read_history(case.folder / f"{name}_energy.csv"),
        "steps": field_steps(case.folder / f"{name}.h5"),
    }


def check_spheres(case: Case) -> None:
    """Judge spheres of several ids between platens, and the place of their fragments."""
    found = [
        run_platens(case, f"sphere_{grain}", np.full(3, 1.0e-3), TURNS["c"], 2.0e-3,
                    f"modulus = {MODULUS}", grain)
        for grain in GRAINS
    ]  # fmt: skip
    for grain, item in zip(GRAINS, found, strict=True):
        events = item["events"]
        case.metric(f"strength of grain {grain} / the hash's", events["strength"][0],
                    strength(grain, SIZE), 1e-12 * STRENGTH)  # fmt: skip
        ratio = events["stress"][0] / events["strength"][0]
        case.metric(f"stress of grain {grain} at its break / strength", ratio, 1.0, 1e-3,
                    "of one step")  # fmt: skip
        case.metric(f"force of grain {grain} / (stress d^2)",
                    events["force"][0] / (events["stress"][0] * SIZE**2), 1.0, 1e-12)  # fmt: skip
        case.below(f"closure of the ledger, grain {grain}", item["energy"]["relative_closure"][-1],
                   1e-6)  # fmt: skip
    case.metric("pieces of a sphere", found[0]["rows"]["fragments"][-1], 14.0, 0.0)
    first = next(s for s in found[0]["steps"] if len(s.grains["id"]) == 14)
    x, radius = first.grains["x"], first.grains["axes"][:, 0]
    event = found[0]["events"]
    centre = np.array([event["x"][0], event["y"][0], event["z"][0]])
    gap = min(
        np.linalg.norm(x[i] - x[j]) - radius[i] - radius[j] for i in range(14) for j in range(i)
    )
    case.above("least gap of two fragments / radius", gap / 1.0e-3, -1e-6, "they have begun to fly")
    out = max_of(np.linalg.norm(x - centre, axis=1) + radius) - 1.0e-3
    case.below("farthest point of a fragment out of the grain / radius", out / 1.0e-3, 1e-3,
               "they have moved since the break")  # fmt: skip
    volume = (radius**3).sum() / 1.0e-9
    case.metric("volume kept", volume, KEPT, 1e-8)


def check_ellipsoid(case: Case) -> None:
    """Judge an ellipsoid along each axis, under two criteria."""
    for k, name in enumerate("abc"):
        other = sorted(AXES[[j for j in range(3) if j != k]])
        item = run_platens(case, f"along_{name}", AXES, TURNS[name], 2.0 * AXES[k],
                           "size_exponent = 0.0")  # fmt: skip
        event = item["events"]
        area = event["force"][0] / event["stress"][0]
        case.metric(f"force / stress along {name}, over 4 a_i a_k", area / (4 * AXES[k] * other[0]),
                    1.0, 1e-9)  # fmt: skip
        case.metric(f"strength along {name}", event["strength"][0], STRENGTH, 1e-6)
    item = run_platens(case, "octahedral", np.full(3, 1.0e-3), TURNS["c"], 2.0e-3,
                       "size_exponent = 0.0, criterion = 'octahedral'")  # fmt: skip
    event = item["events"]
    ratio = event["force"][0] / SIZE**2 / event["stress"][0]
    case.metric("octahedral: F/d^2 / stress of a sphere", ratio, 0.9 * np.pi / (2 * np.sqrt(2.0)),
                3e-2, "the arms are shorter by the overlap")  # fmt: skip
    item = run_platens(case, "hertz", np.full(3, 1.0e-3), TURNS["c"], 2.0e-3,
                       "size_exponent = 0.0, criterion = 'hertz'", level=1.9e9)  # fmt: skip
    event = item["events"]
    modulus = YOUNG / (2.0 * (1.0 - 0.25**2))
    limit = 9.0 / 16.0 * np.pi**3 * event["stress"][0] ** 3 * (1.0e-3 / modulus) ** 2
    case.metric("hertz: force / (9/16 pi^3 p^3 (R/E*)^2)", event["force"][0] / limit, 1.0, 1e-9)


def moments(grains: dict) -> np.ndarray:
    """Return mass, momentum and angular momentum of spheres about the origin."""
    mass = DENSITY * 4.0 / 3.0 * np.pi * grains["axes"].prod(1)
    inertia = 0.4 * mass * grains["axes"][:, 0] ** 2
    push = mass[:, None] * grains["v"]
    spin = np.cross(grains["x"], push) + inertia[:, None] * grains["omega"]
    return np.array([mass.sum(), *push.sum(0), *spin.sum(0)])


def fines(rows: dict) -> np.ndarray:
    """Return the same of the fines (7, times)."""
    names = ["fines_mass", *(f"{m}_{k}" for m in ("momentum", "angular_momentum") for k in "xyz")]
    return np.array([rows[name] for name in names])


def check_flight(case: Case) -> tuple:
    """Judge the balances of two spheres that meet in flight, and the energy of the fines."""
    x = np.array([[0.0, 0.0, 0.0], [2.02e-3, 0.6e-3, 0.0]])
    v = np.array([[2.0, 0.5, -0.3], [-4.0, 0.0, 0.2]])
    omega = np.array([[500.0, -300.0, 900.0], [0.0, 1000.0, -200.0]])
    write_packing(case.folder / "pack.h5", x, np.array([[1.0e-3] * 3, [1.1e-3] * 3]), v=v,
                  omega=omega)  # fmt: skip
    text = (case.folder / "flight.nml").read_text()
    words = text.replace("FRICTION", "0.5").replace("WORDS", "modulus = 3.0, strength = 2.0e6")
    (case.folder / "met.nml").write_text(words)
    case.run("talus-dem", "met.nml", "--threads=1")
    rows = read_history(case.folder / "met_breakage.csv")
    steps = field_steps(case.folder / "met.h5")
    whole = np.array([moments(s.grains) for s in steps]).T + fines(rows)
    scale = np.abs(moments(steps[0].grains))
    size, spin = np.linalg.norm(scale[1:4]), np.linalg.norm(scale[4:])
    scale = np.array([scale[0], size, size, size, spin, spin, spin])
    drift = np.abs(whole - whole[:, :1]) / scale[:, None]
    case.above("grains broken in flight", rows["broken"][-1], 1.0)
    case.below("mass of grains and fines, drift", drift[0].max(), 1e-14)
    case.below("momentum of grains and fines, drift", drift[1:4].max(), 1e-12)
    case.below("angular momentum of grains and fines, drift", drift[4:].max(), 1e-12)
    energy = read_history(case.folder / "met_energy.csv")
    case.below("closure of the ledger in flight", energy["relative_closure"][-1], 1e-4)
    check_fines(case)
    for mass in ("parent", "scaled"):
        check_masses(case, mass)
    return rows["time"], rows["broken"], energy


def check_fines(case: Case) -> None:
    """Judge the energy that fines take along: a smooth sphere that grazes another and breaks."""
    x = np.array([[0.0, 0.0, 0.0], [2.0e-3 + 1e-9, 0.0, 0.0]])
    v = np.array([[1e-4, 3.0, -2.0], [0.0, 3.0, -2.0]])
    write_packing(case.folder / "pack.h5", x, np.full((2, 3), 1.0e-3), v=v, omega=SPINS)
    text = (case.folder / "flight.nml").read_text()
    words = text.replace("FRICTION", "0.0").replace("WORDS", "modulus = 0.1, strength = 1.0e-9")
    (case.folder / "graze.nml").write_text(words)
    case.run("talus-dem", "graze.nml", "--threads=1")
    rows = read_history(case.folder / "graze_breakage.csv")
    broken = read_history(case.folder / "graze_broken.csv")["id"].astype(int) - 1
    mass = DENSITY * 4.0 / 3.0 * np.pi * 1.0e-9
    inertia = 0.4 * mass * 1.0e-6
    wanted = sum(
        (1.0 - KEPT) * 0.5 * mass * (v[k] ** 2).sum()
        + (1.0 - KEPT_INERTIA) * 0.5 * inertia * (SPINS[k] ** 2).sum()
        for k in broken
    )
    case.above("grains broken in grazing", rows["broken"][-1], 1.0)
    case.metric("energy of the fines / of their motion", rows["fines"][-1] / wanted, 1.0, 1e-6)
    area = 4.0 * np.pi * 1.0e-6 * len(broken)
    created = 6.0 * SIX**2 + 8.0 * EIGHT**2 - 1.0
    case.metric("surface created / that of the grains", rows["surface"][-1] / area, created, 1e-8)


def check_masses(case: Case, mass: str) -> None:
    """Judge mass, momentum and energy where fragments share the mass of the grain, or more.

    Scaled fragments of radius r R weigh r of the grain: their Rayleigh time is that of the grain.
    """
    text = (case.folder / "flight.nml").read_text()
    words = f"modulus = 0.1, strength = 1.0e-9, fragment_mass = '{mass}'"
    text = text.replace("FRICTION", "0.0").replace("WORDS", words)
    if mass == "scaled":
        text = text.replace("&dynamics", "&relaxation")
    (case.folder / f"graze_{mass}.nml").write_text(text)
    case.run("talus-dem", f"graze_{mass}.nml", "--threads=1")
    rows = read_history(case.folder / f"graze_{mass}_breakage.csv")
    broken = read_history(case.folder / f"graze_{mass}_broken.csv")["id"].astype(int) - 1
    single = DENSITY * 4.0 / 3.0 * np.pi * 1.0e-9
    lost = 0.0 if mass == "parent" else len(broken) * (1.0 - KEPT) * single
    case.metric(f"'{mass}': mass of the fines / of a grain", rows["fines_mass"][-1] / single,
                lost / single, 1e-8)  # fmt: skip
    push = max_of(np.abs([rows[f"momentum_{k}"][-1] for k in "xyz"]))
    case.below(f"'{mass}': momentum that leaves / of a grain", push / (single * np.sqrt(13.0)),
               1e-12)  # fmt: skip
    kept = (1.0, KEPT_INERTIA / KEPT)
    if mass == "scaled":
        radii = ((6.0, SIX), (8.0, EIGHT))
        weight = sum(n * r for n, r in radii)
        turn = sum(n * r * (r**2 + 5.0 / 3.0 * (1.0 - r) ** 2) for n, r in radii)
        kept = (1.0 / weight, turn / weight**2)
    move, spin = 0.5 * single * 13.0, 0.2 * single * 1.0e-6 * (SPINS**2).sum(1)
    wanted = sum((1.0 - kept[0]) * move + (1.0 - kept[1]) * spin[k] for k in broken)
    case.metric(f"'{mass}': energy that leaves / of its motion", rows["fines"][-1] / wanted, 1.0,
                1e-6)  # fmt: skip


def check_column(case: Case) -> dict:
    """Judge the ledger of a column of five grains that is crushed."""
    text = (case.folder / "platens.nml").read_text()
    radius = 1.0e-3
    x = np.column_stack([np.zeros(5), np.zeros(5), radius * (1.0 + 2.0 * np.arange(5))])
    write_packing(case.folder / "pack.h5", x, np.full((5, 3), radius))
    words = {"HEIGHT": "10.0e-3", "SPEED": "2.0", "T_END": "4.0e-4", "OUTPUT": "4.0e-6",
             "WORDS": "modulus = 3.0", "dt_factor = 0.1": "dt_factor = 0.01"}  # fmt: skip
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / "column.nml").write_text(text)
    case.run("talus-dem", "column.nml", "--threads=1")
    energy = read_history(case.folder / "column_energy.csv")
    rows = read_history(case.folder / "column_breakage.csv")
    case.above("grains of a column that broke", rows["broken"][-1], 1.0)
    case.below("closure of the ledger of the column", energy["relative_closure"][-1], 1e-6)
    return energy


def run(case: Case) -> None:
    """Run all, draw force over closure of platens and the ledger of the column."""
    check_spheres(case)
    check_ellipsoid(case)
    check_flight(case)
    column = check_column(case)
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.0))
    for grain in GRAINS:
        walls = read_history(case.folder / f"sphere_{grain}_walls.csv")
        top = walls["wall"] == 2
        closed = (walls["z"][top][0] - walls["z"][top]) / SIZE
        line = ax.plot(closed, walls["force_z"][top] / SIZE**2 / 1e6, ".-", ms=3,
                       label=f"id {grain}")  # fmt: skip
        ax.axhline(strength(grain, SIZE) / 1e6, color=line[0].get_color(), lw=0.8, ls="--")
    ax.set(xlabel="closure / diameter [-]", ylabel="force / d$^2$ [MPa]")
    ax.legend(title="dashed: strength of the id")
    time = column["time"] * 1e3
    losses = ("released", "fines", "contact_damping", "friction")
    ax2.plot(time, column["boundary"], "k-", label="work of the platens")
    ax2.stackplot(time, column["kinetic"] + column["elastic"], *(column[n] for n in losses),
                  labels=["kinetic and elastic", *(n.replace("_", " ") for n in losses)],
                  alpha=0.6)  # fmt: skip
    ax2.set(xlabel="time [ms]", ylabel="energy [J]", title="column of five grains")
    ax2.legend(fontsize=8)
    case.save(fig)
