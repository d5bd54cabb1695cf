"""Linear field on a distorted cube: displacements and stresses must be exact."""

import numpy as np

from talus.mesh import structured
from talus.verification import Case, field_steps, write_hex_mesh

GRADIENT = 1e-3 * np.array([[1.0, 0.4, -0.2], [0.3, -0.6, 0.5], [0.1, 0.7, 0.8]])
BRICKS = ("hex8_bbar", "hex8_full", "hex8_incompatible", "hex8_one_point")
YOUNG, POISSON = 1.0e6, 0.3


def run(case: Case) -> None:
    """Judge both elements; plot the error of every node."""
    line = np.linspace(0.0, 1.0, 5)
    x, hex8 = structured((line, line, line))
    inner = np.all((x > 1e-9) & (x < 1 - 1e-9), axis=1)
    x[inner] += np.random.default_rng(2).uniform(-0.06, 0.06, size=(inner.sum(), 3))
    boundary = np.flatnonzero(~inner)
    nodes = {f"b{n}": np.array([n]) for n in boundary}
    write_hex_mesh(case.folder / "patch.h5", x, hex8, nodes=nodes)
    deck = (case.folder / "deck.nml").read_text()
    exact = x @ GRADIENT.T
    lines = [
        f"&motion group = 'b{n}', component = '{c}', curve = 'on', scale = {float(exact[n, k])!r} /"
        for n in boundary
        for k, c in enumerate("xyz")
    ]
    strain = 0.5 * (GRADIENT + GRADIENT.T)
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    stress = lame * np.trace(strain) * np.eye(3) + YOUNG / (1 + POISSON) * strain
    wanted = stress[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    fig, ax = case.figure()
    for element in BRICKS:
        text = deck.replace("hex8_bbar", element) + "\n".join(lines) + "\n"
        (case.folder / f"{element}.nml").write_text(text)
        case.run("talus-fem", f"{element}.nml")
        last = field_steps(case.folder / f"{element}.h5")[-1].solid
        error = np.abs(last["u"] - exact).max(axis=1) / np.abs(exact).max()
        case.below(f"{element}: displacement error / largest", float(error.max()), 1e-12)
        off = np.abs(last["stress"] - wanted).max() / np.abs(wanted).max()
        case.below(f"{element}: stress error / largest", float(off), 1e-11)
        ax.semilogy(np.maximum(error[inner], 1e-18), "o", ms=4, label=element)
    ax.set(xlabel="inner node [-]", ylabel="displacement error / largest [-]")
    ax.legend()
    case.save(fig)
