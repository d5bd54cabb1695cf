"""Waves of micromorphic solids: three branches, implicit and explicit, and a thrown block."""

import numpy as np
from solid import save

from talus.compare import max_of
from talus.mesh import Mesh, boundary_faces, structured
from talus.orders import converted
from talus.verification import Case, field_steps, read_history

MU, KAPPA, NU, SIGMA, TAU, RHO, INERTIA = 7.0, 10.0, 8.0, 5.0, 0.5, 2.0, 0.02
LENGTH, WAVE = 1.0, np.pi
SIZE = 1.0e-5  # strain of the motion
SPIN = 2.5  # of the thrown block [rad/s]
NAMES = ("acoustic", "optical 1", "optical 2")


def branches(k: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the three frequencies and the modes (U, S, D) as columns."""
    mass = np.diag([RHO, RHO * INERTIA / 2, RHO * INERTIA / 2])
    stiff = np.array([
        [(MU + SIGMA + KAPPA) * k * k, (KAPPA + NU) * k / 2, (KAPPA - NU) * k / 2],
        [(KAPPA + NU) * k / 2, (TAU * k * k + KAPPA + NU - 2 * SIGMA) / 2, 0.0],
        [(KAPPA - NU) * k / 2, 0.0, (TAU * k * k + KAPPA - NU) / 2],
    ])  # fmt: skip
    square, modes = np.linalg.eig(np.linalg.solve(mass, stiff))
    order = np.argsort(square)
    return np.sqrt(square[order]), modes[:, order]


def wave(case: Case, branch: int, kind: str, elements: int) -> tuple[float, float]:
    """Run a standing wave; return errors by the exact and by the step's own frequency."""
    frequency, modes = branches(WAVE)
    w, (a, s, d) = float(frequency[branch]), modes[:, branch] / abs(modes[:, branch]).max()
    side = np.array([0.0, LENGTH / elements])
    x, hex8 = structured((side, side, np.linspace(0.0, LENGTH, elements + 1)))
    mesh = converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), "hex20")
    z = mesh.x[:, 2]
    mesh.nodes["faces"] = np.flatnonzero(np.isclose(z * (LENGTH - z), 0.0))
    lines = ""
    for n, height in enumerate(np.unique(z.round(9))):
        mesh.nodes[f"z{n}"] = np.flatnonzero(np.isclose(z, height))
        values = {"chi13": (s - d) / 2 * np.cos(WAVE * height),
                  "chi31": (s + d) / 2 * np.cos(WAVE * height)}  # fmt: skip
        values = {} if n % 2 else values
        if 0 < n < 2 * elements:
            values["x"] = a * np.sin(WAVE * height)
        for c, v in values.items():
            lines += (
                f"&initial group = 'z{n}', component = '{c}', value = {float(SIZE * w * v)!r} /\n"
            )
    save(mesh, case.folder / "column.h5")
    end = 1.25 * 2 * np.pi / w
    step = end / 50
    analysis = "kind = 'explicit'" if kind == "explicit" else f"kind = 'newmark', dt = {step!r}"
    text = (case.folder / "wave.nml").read_text().replace("ANALYSIS", analysis)
    text = text.replace("END", repr(end)).replace("EVERY", repr(end / 10)) + lines
    name = f"{kind}_{branch}_{elements}"
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml")
    slow = w if kind == "explicit" else 2 / step * np.arctan(w * step / 2)
    worst = {w: 0.0, slow: 0.0}
    for found in field_steps(case.folder / f"{name}.h5"):
        for rate in worst:
            wanted = SIZE * np.sin(rate * found.time)
            u = found.solid["u"][:, 0] - wanted * a * np.sin(WAVE * z)
            chi = found.solid["phi"][:, 6] - wanted * (s + d) / 2 * np.cos(WAVE * z)
            off = max_of(abs(u).max(), abs(chi[mesh.nodes["faces"]]).max()) / SIZE
            worst[rate] = max_of(worst[rate], float(off))
    return worst[w], worst[slow]


def block(case: Case, analysis: str, name: str) -> dict[str, np.ndarray]:
    """Throw a block that hangs on springs; return its ledger, deformation and yields."""
    line = np.linspace(0.0, 1.0, 3)
    x, hex8 = structured((line, line, line))
    mesh = Mesh(x, hex8, {"all": np.arange(len(hex8))})
    faces = [nodes for _, nodes in boundary_faces(mesh.cells).values()]
    mesh.facets["x0"] = np.array([q for q in faces if (x[q][:, 0] < 1e-9).all()])
    spin = np.array([[0.0, -SPIN, 0.0], [SPIN, 0.0, 0.0], [0.0, 0.0, 0.0]])
    lines = "".join(
        f"&initial group = 'all', component = '{c}', value = {rate!r} /\n"
        for c, rate in (("chi12", -SPIN), ("chi21", SPIN))
    )
    for n, v in enumerate((x - 0.5) @ spin.T + np.array([0.3, 0.0, 0.1])):
        mesh.nodes[f"n{n}"] = np.array([n])
        for c, value in zip("xyz", v, strict=True):
            lines += f"&initial group = 'n{n}', component = '{c}', value = {float(value)!r} /\n"
    save(mesh, case.folder / "block_mesh.h5")
    text = (case.folder / "block.nml").read_text().replace("ANALYSIS", analysis)
    (case.folder / f"{name}.nml").write_text(text + lines)
    case.run("talus-fem", f"{name}.nml")
    steps = field_steps(case.folder / f"{name}.h5")
    energy = read_history(case.folder / f"{name}_energy.csv")
    turned = np.arctan2(steps[-1].solid["phi"][:, 3], 1 + steps[-1].solid["phi"][:, 0])
    return energy | {"u": steps[-1].solid["u"], "turned": turned}


def judge_block(case: Case) -> None:
    """Judge ledgers at finite rotation."""
    found = {
        "newmark": block(case, "kind = 'newmark', dt = 1.0e-2", "thrown_newmark"),
        "explicit": block(case, "kind = 'explicit', dt_factor = 0.9", "thrown_explicit"),
    }
    for name, energy in found.items():
        off = float(abs(energy["closure"]).max() / energy["kinetic"][0])
        case.below(f"block, {name}: ledger, error / energy at the start", off, 1e-8)
        case.above(
            f"block, {name}: dissipation / start",
            energy["plastic"][-1] / energy["kinetic"][0],
            0.02,
        )
        turned = float(np.degrees(np.median(energy["turned"])))
        case.above(f"block, {name}: chi has turned [deg]", turned, 20.0)


def run(case: Case) -> None:
    """Judge waves and the block; plot the branches."""
    runs = {}
    for branch, name in enumerate(NAMES):
        for kind, limit in (("newmark", 0.02), ("explicit", 0.05)):
            off, slow = wave(case, branch, kind, 8)
            case.below(f"{name}, {kind}, 8 elements: error / amplitude", off, limit)
            runs[name, kind] = off
    for kind in ("newmark", "explicit"):
        _, coarse = wave(case, 2, kind, 8)
        _, fine = wave(case, 2, kind, 16)
        order = float(np.log2(coarse / fine))
        case.metric(f"optical 2, {kind}: order in space", order, 2.0, 0.3)
    judge_block(case)
    fig, ax = case.figure()
    k = np.linspace(0.0, 6.0, 100)
    lines = np.array([branches(value)[0] for value in k])
    for n, name in enumerate(NAMES):
        ax.plot(k, lines[:, n], "-", label=f"{name}, exact")
        ax.plot([WAVE], [branches(WAVE)[0][n]], "o", mfc="none", color="k")
    ax.set(xlabel="wave number [1/m]", ylabel="circular frequency [1/s]")
    ax.legend()
    case.save(fig)
