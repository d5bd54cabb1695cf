"""Amplitude and phase of rods, a block and travelling waves against closed forms."""

import numpy as np
from solid import save, shape_of

from talus.mesh import box, read_mesh
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

LENGTH, SIDE, PULL = 1.0, 0.1, 1.0e4
YOUNG, DENSITY = 1.0e9, 1000.0
DAMPINGS = {  # deck, complex modulus / E and density / rho at w
    "loss": ("loss_factor = 0.1", lambda w: (1 + 0.1j, 1.0)),
    "rayleigh": ("rayleigh_mass = 80.0, rayleigh_stiffness = 2.0e-5",
                 lambda w: (1 + 2.0e-5j * w, 1 - 80.0j / w)),
}  # fmt: skip


def bar(case: Case, axis: int, n: int, element: str) -> str:
    """Write the mesh of a bar of n elements along an axis; return its file."""
    size, cells = np.full(3, SIDE), [1, 1, 1]
    size[axis], cells[axis] = LENGTH, n
    name = f"bar_{'xyz'[axis]}_{n}_{shape_of(element)}.h5"
    save(converted(box(np.zeros(3), size, tuple(cells)), shape_of(element)), case.folder / name)
    return name


def respond(case: Case, deck: str, stem: str, words: dict[str, str]) -> dict[str, np.ndarray]:
    """Run a deck with its words replaced; return its table."""
    text = (case.folder / f"{deck}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")
    return read_history(case.folder / f"{stem}_harmonic.csv")


def complex_of(table: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Return a column's complex amplitudes."""
    return table[name] * np.exp(1j * table[f"{name} phase"])


def far(found: np.ndarray, wanted: np.ndarray) -> float:
    """Return the largest distance of complex amplitudes over the largest amplitude."""
    return float(abs(found - wanted).max() / abs(wanted).max())


def judge_rod(case: Case, ax) -> None:
    """Both dampings by hex8 and hex20; the order of each, reactions, one curve."""
    for damping, (deck, parts) in DAMPINGS.items():
        for element, sizes, order in (("hex8_full", (16, 32), 2.0), ("hex20", (4, 8), 4.0)):
            errors = []
            for n in sizes:
                words = {"MESH": bar(case, 0, n, element), "ELEMENT": element, "DAMPING": deck}
                table = respond(case, "rod", f"rod_{damping}_{element}_{n}", words)
                w = 2 * np.pi * table["frequency"]
                soft, heavy = parts(w)
                modulus, wave = YOUNG * soft, w * np.sqrt(DENSITY * heavy / (YOUNG * soft))
                tip = PULL / (modulus * wave) * np.tan(wave * LENGTH)
                foot = -PULL * SIDE**2 / np.cos(wave * LENGTH)
                errors.append(far(complex_of(table, "x1 x"), tip))
                reaction = far(complex_of(table, "x0 force x"), foot)
                case.below(f"rod, {damping}, {element}, {n}: residual",
                           float(table["residual"].max()), 1e-9)  # fmt: skip
            where = f"rod, {damping}, {element}"
            limit = 2e-2 if order < 3 else 2e-3  # kL (kh)^2/24 = 7e-3 at the top; a tenth
            case.below(f"{where}: motion of the end", errors[-1], limit)
            case.below(f"{where}: reaction", reaction, limit)
            case.metric(
                f"{where}: observed order", float(np.log2(errors[0] / errors[1])), order, 0.3
            )
        if damping == "loss":
            ax.plot(table["frequency"], abs(tip) * 1e3, "-", label="complex wave number")
            ax.plot(table["frequency"], table["x1 x"] * 1e3, "o", mfc="none", label="8 hex20")


def judge_block(case: Case) -> None:
    """At its frequency the block answers with 1/(2 zeta) or 1/eta, a quarter of a period late."""
    save(box(np.zeros(3), np.ones(3), (1, 1, 1)), case.folder / "block.h5")
    stiff, mass, force, zeta, eta = 4.0e6, 1000.0, 1.0e3, 0.02, 0.05
    own = float(np.sqrt(stiff / mass))
    near = own / (2 * np.pi) * np.array([0.5, 0.98, 1.0, 1.02, 2.0])
    runs = {
        "rayleigh_mass": (f"rayleigh_mass = {2 * zeta * own!r}", lambda w: 2j * zeta * w / own),
        "rayleigh_stiffness": (f"rayleigh_stiffness = {2 * zeta / own!r}",
                               lambda w: 2j * zeta * w / own),
        "loss_factor": (f"loss_factor = {eta!r}", lambda w: 1j * eta),
    }  # fmt: skip
    for name, (deck, part) in runs.items():
        words = {"FREQUENCIES": ", ".join(repr(float(f)) for f in near), "DAMPING": deck}
        table = respond(case, "block", f"block_{name}", words)
        w = 2 * np.pi * near
        wanted = force / stiff / (1 - (w / own) ** 2 + part(w))
        found = complex_of(table, "z1 z")
        case.below(f"block, {name}: largest error", far(found, wanted), 1e-5)
        peak = float(abs(found[2]) * stiff / force)
        exact = 1 / eta if name == "loss_factor" else 1 / (2 * zeta)
        case.metric(f"block, {name}: peak / static", peak, exact, 1e-4 * exact)
        late = float(-np.angle(found[2]) / np.pi)
        case.metric(f"block, {name}: delay of the peak [half turns]", late, 0.5, 1e-4)


def judge_waves(case: Case) -> None:
    """Waves of pressure and shear run out: one amplitude everywhere, the phase of the wave."""
    lame, shear = 0.4e9, 0.4e9
    runs = {
        "pressure": ("'x', 'y'", "0.0, 0.0, 1.0e4", 2, np.sqrt((lame + 2 * shear) / DENSITY)),
        "shear": ("'y', 'z'", "1.0e4, 0.0, 0.0", 0, np.sqrt(shear / DENSITY)),
    }
    w = 2 * np.pi * 2000.0
    for name, (held, value, c, speed) in runs.items():
        uneven = []
        for n in (80, 160):
            words = {"MESH": bar(case, 2, n, "hex8_full"), "HELD": held, "VALUE": value}
            stem = f"{name}_{n}"
            respond(case, "column", stem, words)
            real, imaginary = field_steps(case.folder / f"{stem}.h5")
            u = real.solid["u"][:, c] + 1j * imaginary.solid["u"][:, c]
            z = np.linspace(0.0, LENGTH, n + 1)
            height = read_mesh(case.folder / words["MESH"]).x[:, 2]
            u = np.array([u[np.isclose(height, at)].mean() for at in z])
            wanted = PULL / (1j * w * DENSITY * speed) * np.exp(-1j * w / speed * z)
            uneven.append(float(abs(u).max() / abs(u).min() - 1))
        wave = w / speed
        late = (wave * LENGTH / n) ** 2 / 24  # of the phase, per radian, with consistent mass
        case.below(f"{name} wave: error / amplitude", far(u, wanted), 1.2 * late * wave * LENGTH)
        case.below(f"{name} wave: largest / least amplitude - 1", uneven[-1], 2 * late)
        rate = float(np.log2(uneven[0] / uneven[1]))
        case.metric(f"{name} wave: order of what comes back", rate, 2.0, 0.3)


def judge_spin(case: Case) -> None:
    """A micropolar rod that is turned at its end, below and above the cut-off."""
    stiff, kappa, inertia, couple, eta = 1.0e5, 2.0e5, 0.01, 100.0, 0.1
    for element in ("hex8/hex8", "hex20/hex8"):
        errors = []
        for n in (20, 40):
            words = {"MESH": bar(case, 2, n, element), "ELEMENT": element}
            table = respond(case, "spin", f"spin_{element.replace('/', '_')}_{n}", words)
            w = 2 * np.pi * table["frequency"]
            b = stiff * (1 + 1j * eta)
            q = np.sqrt((DENSITY * inertia * w**2 - 2 * kappa * (1 + 1j * eta)) / b)
            wanted = couple / (b * q) * np.tan(q * LENGTH)
            errors.append(far(complex_of(table, "z1 rz"), wanted))
        case.below(f"micropolar rod, {element}: end", errors[-1], 1e-3)
        rate = float(np.log2(errors[0] / errors[1]))
        case.metric(f"micropolar rod, {element}: observed order", rate, 2.0, 0.3)


def run(case: Case) -> None:
    """Judge rods, block, waves and micro-rotations; plot the rod with a loss factor."""
    fig, ax = case.figure()
    judge_rod(case, ax)
    judge_block(case)
    judge_waves(case)
    judge_spin(case)
    ax.set(xlabel="frequency [Hz]", ylabel="amplitude of the end [mm]")
    ax.legend()
    case.save(fig)
