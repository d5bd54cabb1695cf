"""What comes back of micro-rotations and of shear from an absorbing face."""

import numpy as np
from solid import save

from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

LENGTH, CELLS = 6.0, 240
SIDE = LENGTH / CELLS
SPEED, CUT = 100.0, 200.0  # sqrt((alpha + beta + gamma)/(rho j)), sqrt(2 kappa/(rho j))
SHEAR_SPEED = np.sqrt((1.0e8 + 0.5 * 2.0e5) / 1000.0)
RATIOS = (1.5, 2.0, 3.0)
ELEMENTS = ("hex8/hex8", "hex20/hex8")


def deck(case: Case, name: str, stem: str, words: dict[str, str]) -> None:
    """Write and run a deck with its words replaced."""
    text = (case.folder / f"{name}.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml")


def listed(values: np.ndarray) -> str:
    """Return numbers as a deck lists them."""
    return ", ".join(f"{float(v):.12g}" for v in values)


def reflected(case: Case, z: np.ndarray, line: np.ndarray, element: str, ratio: float) -> float:
    """Drive at a frequency; return |R| from the standing wave in the middle of the column."""
    omega = ratio * CUT
    period = 2.0 * np.pi / omega
    slow = np.sqrt(1.0 - 1.0 / ratio**2)
    end = np.ceil((3.0 * LENGTH / (SPEED * slow) + 18.0 * period) / period) * period
    t = np.arange(0.0, end + period / 40, period / 40)
    ramp = np.where(t < 10 * period, 0.5 - 0.5 * np.cos(np.pi * t / (10 * period)), 1.0)
    stem = f"spin_{element.replace('/', '_')}_{ratio}".replace(".", "_")
    drive = ramp * np.sin(omega * t)
    words = {"END": repr(float(end)), "TIMES": listed(t), "VALUES": listed(drive),
             "ELEMENT": element, "EVERY": repr(float(period / 4))}  # fmt: skip
    deck(case, "spin", stem, words)
    steps = field_steps(case.folder / f"{stem}.h5")[-25:-1]  # six periods, four samples each
    phase = np.exp(-1j * omega * np.array([s.time for s in steps]))
    wave = np.array([s.solid["phi"][line, 2] for s in steps]).T @ phase
    middle = (z > 0.2 * LENGTH) & (z < 0.8 * LENGTH)
    best = (np.inf, 0.0)
    for k in omega * slow / SPEED * np.linspace(0.97, 1.03, 241):  # that of the mesh
        basis = np.exp(1j * k * np.outer(z[middle], [1.0, -1.0]))
        amplitude, *_ = np.linalg.lstsq(basis, wave[middle], rcond=None)
        rest = np.linalg.norm(basis @ amplitude - wave[middle])
        low, high = sorted(abs(amplitude))
        best = min(best, (rest, low / high))
    energy = read_history(case.folder / f"{stem}_energy.csv")
    error = float(abs(energy["closure"]).max() / abs(energy["load"]).max())
    case.below(f"{element}, {ratio} x cut-off: ledger, error / largest", error, 1e-9)
    return best[1]


def judge_shear(case: Case, middle: int, element: str) -> None:
    """Send a pulse of shear down the column."""
    length = 0.005
    t = np.linspace(0.0, length, 61)
    stem = f"shear_{element.replace('/', '_')}"
    words = {"TIMES": listed(t), "VALUES": listed(np.sin(np.pi * t / length) ** 2),
             "ELEMENT": element}  # fmt: skip
    deck(case, "shear", stem, words)
    steps = field_steps(case.folder / f"{stem}.h5")
    time = np.array([s.time for s in steps])
    v = np.array([s.solid["v"][middle, 0] for s in steps])
    back = time > LENGTH / 2 / SHEAR_SPEED + length + 0.001
    case.below(f"{element}, shear pulse: reflected / incident",
               float(abs(v[back]).max() / abs(v).max()), 1e-2)  # fmt: skip


def run(case: Case) -> None:
    """Judge all frequencies with equal and mixed orders; plot |R|."""
    size = np.array([SIDE, SIDE, LENGTH])
    fig, ax = case.figure()
    for element, mark in zip(ELEMENTS, "os", strict=True):
        mesh = converted(box(np.zeros(3), size, (1, 1, CELLS)), element.split("/")[0])
        save(mesh, case.folder / "column.h5")
        corner = np.isclose(mesh.x[:, :2], 0.0).all(axis=1)
        whole = np.isclose((mesh.x[:, 2] / SIDE + 0.25) % 1.0, 0.25, atol=1e-6)
        line = np.flatnonzero(corner & whole)
        z = mesh.x[line, 2]
        found = []
        for ratio in RATIOS if element == "hex8/hex8" else RATIOS[1:2]:
            slow = np.sqrt(1.0 - 1.0 / ratio**2)
            found.append((ratio, reflected(case, z, line, element, ratio)))
            wanted = float((1.0 - slow) / (1.0 + slow))
            case.metric(f"{element}, {ratio} x cut-off: |R|", float(found[-1][1]), wanted, 5e-3)
        judge_shear(case, int(line[np.argmin(abs(z - LENGTH / 2))]), element)
        ax.plot(*np.array(found).T, mark, label=element, mfc="none")
    x = np.linspace(1.02, 3.4, 200)
    s = np.sqrt(1.0 - 1.0 / x**2)
    ax.plot(x, (1.0 - s) / (1.0 + s), "-", label="(1 - s)/(1 + s)")
    ax.set(xlabel="frequency / cut-off [1]", ylabel="reflected / incident [1]")
    ax.legend()
    case.save(fig)
