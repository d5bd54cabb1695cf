"""Probed moduli: an fcc lattice against its closed stiffness, random packs against Walton."""

import itertools
import json

import numpy as np

from talus.compare import max_of
from talus.generate import cloud
from talus.packing import make_packing, write_h5
from talus.verification import Case, read_history

RADIUS, YOUNG, POISSON = 1.0e-3, 2.9e9, 0.25
MODULUS = 0.5 * YOUNG / (1.0 - POISSON**2)
SIX = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)]
NAMES = ["xx", "yy", "zz", "yz", "zx", "xy"]
OVERLAP = 1.0e-2  # of the lattice, over the diameter
EDGE = 2.0 * np.sqrt(2.0) * RADIUS * (1.0 - OVERLAP)
CELLS = 4
COUNT, BOX, SEED = 300, 18.5e-3, 3
PRESSURES = (5.0e4, 2.5e5, 1.25e6)


def closed_stiffness() -> np.ndarray:
    """Stiffness 6 x 6 [Pa] of the lattice, with what turning and stretching the forces adds."""
    depth = 2.0 * RADIUS * OVERLAP
    kn = 2.0 * MODULUS * np.sqrt(0.5 * RADIUS * depth)
    ks = kn * 2.0 * (1.0 - POISSON) / (2.0 - POISSON)
    size = 2.0 / 3.0 * kn * depth
    half = [(0, a, b) for a, b in itertools.product((-1.0, 1.0), repeat=2)]
    c, sigma = np.zeros((3, 3, 3, 3)), np.zeros((3, 3))
    for branch in 0.5 * EDGE * np.array([np.roll(v, k) for v in half for k in range(3)]):
        n = branch / np.linalg.norm(branch)
        spring = (ks - size / np.linalg.norm(branch)) * (np.eye(3) - np.outer(n, n))
        spring += kn * np.outer(n, n)
        c += 2.0 / EDGE**3 * np.einsum("i,jl,k->ijlk", branch, spring, branch)
        c -= 2.0 / EDGE**3 * np.einsum("il,k,j->ijlk", np.eye(3), branch, size * n)
        sigma -= 2.0 / EDGE**3 * np.outer(branch, size * n)
    c -= np.einsum("ij,lk->ijlk", sigma, np.eye(3))
    return np.array(
        [
            [
                0.25 * sum(c[i, j, k, m] for i, j in (a, a[::-1]) for k, m in (b, b[::-1]))
                for b in SIX
            ]
            for a in SIX
        ]
    )


def probe(case: Case, pack: str, friction: float, periodic: str = "") -> dict:
    """Probe a pack; return the file of the probe with the measures of the pack."""
    deck = (case.folder / "probe.nml").read_text()
    words = {"PACK": pack, "FRICTION": f"{friction}", "PERIODIC": periodic}
    for word, value in words.items():
        deck = deck.replace(word, value)
    (case.folder / f"probe_{pack}.nml").write_text(deck)
    case.run("talus-dem", f"probe_{pack}.nml", "--threads=1")
    found = json.loads((case.folder / f"probe_{pack}_probe.json").read_text())
    rows = read_history(case.folder / f"probe_{pack}_measure_all.csv")
    return found | {name: float(rows[name][-1]) for name in ("solid_fraction", "coordination")}


def stiffness(found: dict) -> np.ndarray:
    """Probed stiffness 6 x 6 [Pa]."""
    return np.array([found["probed"]["stiffness_Pa"][name] for name in NAMES])


def lattices(case: Case) -> None:
    """Probe the lattice without end, and a block of it between fixed spheres."""
    base = np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) * 0.5
    at = np.array(list(itertools.product(range(CELLS), repeat=3)), float)
    x = EDGE * (base[None] + at[:, None]).reshape(-1, 3)
    packing = make_packing(x, np.full((len(x), 3), RADIUS))
    packing.cell = np.eye(3) * CELLS * EDGE
    write_h5(case.folder / "lattice.h5", packing)
    exact = closed_stiffness()
    error = np.abs(stiffness(probe(case, "lattice", 10.0)) - exact).max() / exact.max()
    case.below("fcc lattice, error of the stiffness / C_xxxx", float(error), 1e-4,
               "strain 1e-6 against an overlap of 1e-2")  # fmt: skip
    outer = ((x < 0.75 * EDGE) | (x > (CELLS - 1.25) * EDGE)).any(axis=1)
    block = make_packing(x, np.full((len(x), 3), RADIUS), kind=outer.astype(int))
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    pairs = np.argwhere(np.triu(apart < 2.0 * RADIUS, 1))
    held = (~outer[pairs]).any(axis=1).sum()  # contacts of a free sphere: six to each cell volume
    block.cell = np.eye(3) * (held * EDGE**3 / 24.0) ** (1.0 / 3.0)
    write_h5(case.folder / "block.h5", block)
    found = stiffness(probe(case, "block", 10.0, "periodic = 'none'"))
    error = np.abs(found - exact).max() / exact.max()
    case.below("block between fixed spheres, error / C_xxxx", float(error), 5e-4,
               "springs remember the way at strain over overlap")  # fmt: skip


def run(case: Case) -> None:
    """Probe lattices, then random packs at three pressures."""
    lattices(case)
    pack = cloud(np.ones(COUNT), np.full(3, BOX), np.full(3, RADIUS), seed=SEED, periodic=True)
    write_h5(case.folder / "cloud.h5", pack)
    source, rows = "cloud", []
    deck = (case.folder / "prepare.nml").read_text()
    for k, pressure in enumerate(PRESSURES):
        text = deck.replace("SOURCE", source).replace("PRESSURE", f"{pressure}")
        source = f"pack{k}"
        (case.folder / f"prepare{k}.nml").write_text(text.replace("PACK", source))
        case.run("talus-dem", f"prepare{k}.nml", "--threads=1")
        energy = read_history(case.folder / f"prepare{k}_energy.csv")
        closure = float(energy["relative_closure"].max())
        case.below(f"ledger of the compression to {1e-3 * pressure:g} kPa", closure, 1e-4)
        rows.append(probe(case, source, 0.3))
    judge(case, rows)


def judge(case: Case, rows: list[dict]) -> None:
    """Compare with Walton and with the affine sums."""
    p = np.array([row["pressure_Pa"] for row in rows])
    zphi = np.array([row["coordination"] * row["solid_fraction"] for row in rows])
    walton = ((zphi * MODULUS) ** 2 * p / (18.0 * np.pi**2)) ** (1.0 / 3.0)
    ratio = 2.0 * (1.0 - POISSON) / (2.0 - POISSON)
    rough = 0.6 * walton * (1.0 + 1.5 * ratio)
    bulk, shear = (np.array([row["probed"][f"{m}_Pa"] for row in rows]) for m in ("bulk", "shear"))
    affine = [np.array([row["affine"][f"{m}_Pa"] for row in rows]) for m in ("bulk", "shear")]
    for k, pressure in enumerate(PRESSURES):
        case.metric(f"K / Walton at {1e-3 * pressure:g} kPa", float(bulk[k] / walton[k]), 1.0, 0.15)
    slope = np.polyfit(np.log(p), np.log(bulk / zphi ** (2.0 / 3.0)), 1)[0]
    case.metric("exponent of the pressure in K / (Z phi)^(2/3)", float(slope), 1.0 / 3.0, 0.02)
    case.below("largest K / affine K", float((bulk / affine[0]).max()), 1.0)
    case.below("largest G / affine G", float((shear / affine[1]).max()), 1.0)
    case.metric("G / affine G at the least pressure", float(shear[0] / affine[1][0]), 0.65, 0.25,
                "measured on sphere packs: 0.4 to 0.9")  # fmt: skip
    worst = max_of(row["probed"]["asymmetry"] for row in rows)
    case.below("skew part of the stiffness", float(worst), 1e-3)
    case.below("what is not isotropic", float(max_of(r["probed"]["misfit"] for r in rows)), 0.1)
    fig, ax = case.figure()
    line = np.array([p[0], p[-1]])
    grow = (line / p[0]) ** (1.0 / 3.0)
    ax.loglog(1e-6 * line, 1e-6 * walton[0] * grow, "-", label="K, Walton at the first Z and phi")
    ax.loglog(1e-6 * line, 1e-6 * rough[0] * grow, "--", label="G rough, Walton")
    ax.loglog(1e-6 * p, 1e-6 * bulk, "o", label="K, probed")
    ax.loglog(1e-6 * p, 1e-6 * shear, "s", label="G, probed")
    ax.loglog(1e-6 * p, 1e-6 * affine[0], "o", mfc="none", label="K, affine sum")
    ax.loglog(1e-6 * p, 1e-6 * affine[1], "s", mfc="none", label="G, affine sum")
    ax.set(xlabel="pressure [MPa]", ylabel="modulus [MPa]")
    ax.legend(fontsize=8)
    case.save(fig)
