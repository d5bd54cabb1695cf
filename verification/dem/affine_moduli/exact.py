"""Affine moduli, stress and solid fraction of fcc lattices against closed forms."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, read_history, write_packing

RADIUS, YOUNG, POISSON, CELLS = 1.0e-3, 29.0e9, 0.25, 6
NINE = [a + b for a in "xyz" for b in "xyz"]
OVERLAPS = (1e-6, 1e-5, 1e-4, 1e-3)  # of the diameter


def lattice(edge: float) -> np.ndarray:
    """Centres of CELLS^3 cubic cells [m]."""
    base = np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) * 0.5 * edge
    at = np.stack(np.meshgrid(*3 * [np.arange(CELLS)], indexing="ij"), -1).reshape(-1, 3)
    return (base[None] + at[:, None] * edge).reshape(-1, 3)


def closed_form(edge: float, kn: float, ks: float) -> np.ndarray:
    """C as 9 x 9 [Pa]: the 24 contacts of a cell, 2 to each of 12 directions."""
    half = np.array([[0, 1, 1], [0, 1, -1], [1, 0, 1], [1, 0, -1], [1, 1, 0], [1, -1, 0]])
    c = np.zeros((3, 3, 3, 3))
    for n in half / np.sqrt(2.0):
        branch = n * edge / np.sqrt(2.0)
        spring = ks * np.eye(3) + (kn - ks) * np.outer(n, n)
        c += 4.0 * np.einsum("i,k,jl->ijkl", branch, branch, spring)
    return c.reshape(9, 9) / edge**3


def measure(case: Case, name: str, overlap: float) -> dict[str, float]:
    """Run one lattice; return what was measured and what is exact."""
    edge = np.sqrt(2.0) * 2.0 * RADIUS * (1.0 - overlap)
    x = lattice(edge)
    folder = case.folder / name
    folder.mkdir(exist_ok=True)
    write_packing(folder / "pack.h5", x, np.full((len(x), 3), RADIUS))
    lower = np.array([1.13, 1.21, 1.37]) * edge
    upper = lower + 3.0 * edge
    deck = (case.folder / "deck.nml").read_text()
    for word, corner in (("LOWER", lower), ("UPPER", upper)):
        deck = deck.replace(word, ", ".join(f"{v:.17g}" for v in corner))
    (folder / "deck.nml").write_text(deck)
    case.run("talus-dem", f"{name}/deck.nml", "--threads=1")
    rows = {k: v[0] for k, v in read_history(folder / "deck_measure_cells.csv").items()}
    full = read_history(folder / "deck_moduli_cells.csv")
    rows["C"] = np.array([[full[f"C_{a}_{b}"][0] for b in NINE] for a in NINE])
    rows["D"] = max_of(abs(full[f"D_{a}_{b}"][0]) for a in NINE for b in NINE)
    micro = read_history(folder / "deck_micromorphic_cells.csv")
    rows["micro"] = {k: float(v[0]) for k, v in micro.items()}
    modulus = 0.5 * YOUNG / (1.0 - POISSON**2)
    radius = np.sqrt(0.5 * RADIUS * 2.0 * RADIUS * overlap)
    kn = 2.0 * modulus * radius
    ks = kn * 2.0 * (1.0 - POISSON) / (2.0 - POISSON)
    rows["exact"] = closed_form(edge, kn, ks)
    force = 2.0 / 3.0 * kn * 2.0 * RADIUS * overlap
    rows["exact_p"] = 24.0 * force * edge / np.sqrt(2.0) / 3.0 / edge**3
    phi = 16.0 / 3.0 * np.pi * RADIUS**3 / edge**3
    rows["exact_phi"] = phi
    rows["walton_k"] = ((12.0 * phi * modulus) ** 2 * rows["pressure"] / (18.0 * np.pi**2)) ** (
        1.0 / 3.0
    )
    rows["walton_g"] = 0.6 * rows["walton_k"] * (1.0 + 1.5 * ks / kn)
    return rows


def micromorphic(case: Case, first: dict) -> None:
    """Judge the micromorphic moduli: both limits, no gradient moduli of spheres."""
    m = first["micro"]
    polar = (m["lambda"] + m["eta"] + m["tau"]) / first["affine_lambda"]
    case.metric("lambda + eta + tau / micropolar lambda", polar, 1.0, 1e-6, "rounding")
    polar = (m["kappa"] - m["nu"]) / first["affine_kappa"]
    case.metric("kappa - nu / micropolar kappa", polar, 1.0, 1e-8)
    free = m["mu"] - 2.0 * m["sigma"] ** 2 / (m["kappa"] + m["nu"] - 2.0 * m["sigma"])
    grain = first["solid_fraction"] * 0.5 * YOUNG / (1.0 + POISSON)
    series = 1.0 / (1.0 / first["affine_shear"] + 1.0 / grain)
    case.metric("G with free micro-deformation / contacts and grains in series", free / series,
                1.0, 1e-6)  # fmt: skip
    taus = max_of(abs(m[f"tau_{k}"]) for k in range(1, 12)) / (first["affine_bulk"] * RADIUS**2)
    case.below("gradient moduli / (K R^2)", taus, 1e-8, "contacts in the middle of the branch")


def run(case: Case) -> None:
    """Judge one lattice closely, then the growth with pressure."""
    found = [measure(case, f"overlap{k}", overlap) for k, overlap in enumerate(OVERLAPS)]
    first = found[0]
    error = np.abs(first["C"] - first["exact"]).max() / np.abs(first["exact"]).max()
    case.below("C, largest component", float(error), 1e-8)
    coupling = first["D"] / (np.abs(first["exact"]).max() / RADIUS * RADIUS**2)
    case.below("coupling D / (C R)", float(coupling), 1e-8, "zero by symmetry")
    case.metric("pressure / closed form", first["pressure"] / first["exact_p"], 1.0, 1e-8)
    case.metric("solid fraction / closed form", first["solid_fraction"] / first["exact_phi"],
                1.0, 1e-3, "40 points to a grain that is cut")  # fmt: skip
    case.metric("coordination", first["coordination"], 12.0, 1e-12)
    case.metric("lambda / mu", first["affine_lambda"] / first["affine_mu"], 1.0, 1e-8)
    case.metric("K / Walton", first["affine_bulk"] / first["walton_k"], 1.0, 1e-5,
                "overlap 1e-6 of the diameter")  # fmt: skip
    case.metric("G / Walton, rough", first["affine_shear"] / first["walton_g"], 1.0, 1e-5)
    micromorphic(case, first)
    p = np.array([row["pressure"] for row in found])
    k = np.array([row["affine_bulk"] for row in found])
    g = np.array([row["affine_shear"] for row in found])
    case.metric("exponent of pressure", np.log(k[1] / k[0]) / np.log(p[1] / p[0]), 1 / 3, 1e-4)
    fig, ax = case.figure()
    line = np.logspace(np.log10(p[0]), np.log10(p[-1]), 50)
    ax.loglog(line, found[0]["walton_k"] * (line / p[0]) ** (1 / 3), "-", label="K, Walton")
    ax.loglog(line, found[0]["walton_g"] * (line / p[0]) ** (1 / 3), "-", label="G rough, Walton")
    ax.loglog(p, k, "o", label="K, Talus")
    ax.loglog(p, g, "s", label="G, Talus")
    ax.set(xlabel="pressure [Pa]", ylabel="affine modulus [Pa]")
    ax.legend()
    case.save(fig)
