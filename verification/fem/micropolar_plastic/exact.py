"""Micropolar Drucker-Prager: strength of a point, its classical and its elastic limit."""

import numpy as np

from talus.mesh import structured
from talus.verification import Case, field_steps, read_history, write_hex_mesh

COHESION, LENGTH, CONFINED = 2.0e4, 2.0e-3, 1.0e5
INVARIANTS = {
    "de Borst": (0.25, 0.25, 0.5),
    "static": (0.75, -0.25, 0.125),
    "kinematic": (0.375, 0.125, 0.25),
}


def follow(case: Case, stem: str, angles: tuple[float, float], shares: tuple, rows: list[str],
           start: float = 0.0) -> dict[str, np.ndarray]:  # fmt: skip
    """Run a path of a point; return its table."""
    text = (case.folder / "point.nml").read_text()
    for word, value in (
        ("WHAT", stem),
        ("FRICTION", str(angles[0])),
        ("DILATION", str(angles[1])),
        ("INVARIANT", ", ".join(map(str, shares))),
        ("START", ", ".join([str(start)] * 3 + ["0.0"] * 3)),
        ("CONTROLS", "\n".join(f"&control {r} /" for r in rows)),
    ):
        text = text.replace(word, value)
    (case.folder / f"{stem}.nml").write_text(text)
    case.run("talus-fem", f"{stem}.nml", "--point")
    return read_history(case.folder / f"{stem}_point.csv")


def free(*but: str) -> list[str]:
    """Rows that leave all stresses and couple stresses zero but those of some components."""
    names = [f"{k}{c}{d}" for k in ("", "k") for c in "123" for d in "123"]
    return [f"component = '{n}', kind = 'stress'" for n in names if n not in but]


def judge_strength(case: Case, name: str, shares: tuple[float, float, float]) -> None:
    """Judge the stress that flow ends at, without friction: q = A c."""
    limit = 2 * np.sqrt(6) / 3 * COHESION
    ramp = "curve = 'ramp', scale ="
    paths = {
        "one shear": (["12"], 0.02, "sigma 12", limit / np.sqrt(2 * shares[0])),
        "both shears": (["12", "21"], 0.02, "sigma 12", limit / np.sqrt(2)),
        "twist": (["k33"], 20.0, "m 33", limit * LENGTH / np.sqrt(2 * shares[2])),
        "bend": (["k13"], 20.0, "m 13", limit * LENGTH / np.sqrt(2 * shares[2])),
    }
    for path, (parts, scale, column, wanted) in paths.items():
        rows = free(*parts) + [f"component = '{p}', {ramp} {scale}" for p in parts]
        found = follow(case, f"{name} {path}".replace(" ", "_"), (0.0, 0.0), shares, rows)
        label = f"{name}, {path}"
        case.metric(f"{label}: strength / exact", float(found[column][-1] / wanted), 1.0, 1e-8)
        growth = float(np.diff(found["dissipation"]).min())
        case.above(f"{label}: least growth of the dissipation", growth, 0.0)
        work = 0.0
        for kl in (f"{c}{d}" for c in "123" for d in "123"):
            for a, b in (("sigma", "gamma"), ("m", "kappa")):
                stress, strain = found[f"{a} {kl}"], found[f"{b} {kl}"]
                work += np.sum(0.5 * (stress[1:] + stress[:-1]) * np.diff(strain))
        parts = found["stored_energy"] + found["dissipation"] + found["numerical"]
        case.metric(f"{label}: works / path", float(parts[-1] / work), 1.0, 1e-10)


def judge_tangent(case: Case, found: dict[str, np.ndarray]) -> None:
    """Judge slopes before yield against the constants, and those of flow by the steps."""
    shear, coupling, length = 4.0e7, 0.6, 2.0e-3  # G, N, l_t = l_b of point.nml
    both = shear / (1 - coupling**2)  # mu + kappa
    gamma = 4 * shear * length**2
    for label, column, wanted in (
        ("12 by gamma 12", "sigma 12 by gamma 12", both),
        ("12 by gamma 21", "sigma 12 by gamma 21", both * (1 - 2 * coupling**2)),
        ("13 by kappa 13", "m 13 by kappa 13", gamma),
        ("13 by kappa 31", "m 13 by kappa 31", 2 * shear * length**2 - gamma),
    ):
        case.metric(f"tangent: {label} / exact", float(found[column][0] / wanted), 1.0, 1e-12)
    kl = [f"{k}{c}" for k in "123" for c in "123"]
    strains = [f"gamma {c}" for c in kl] + [f"kappa {c}" for c in kl]
    stresses = [f"sigma {c}" for c in kl] + [f"m {c}" for c in kl]
    tangent = np.array([[found[f"{s} by {e}"] for e in strains] for s in stresses])
    step = np.diff(np.array([found[e] for e in strains]), axis=1)
    change = np.diff(np.array([found[s] for s in stresses]), axis=1)
    flowing = np.flatnonzero((found["yield"][1:] > 0) & (found["yield"][:-1] > 0))
    off = max(abs(tangent[..., k + 1] @ step[:, k] - change[:, k]).max() for k in flowing)
    case.below("triaxial: tangent of flow by the step, error / cohesion", off / COHESION, 1e-8)


def judge_triaxial(case: Case) -> dict[str, np.ndarray]:
    """Judge friction and dilation in triaxial compression: Mohr and Coulomb's strength."""
    rows = [f"component = '{c}', kind = 'stress', scale = {-CONFINED}" for c in ("11", "22")]
    rows.append("component = '33', curve = 'ramp', scale = -0.02")
    found = follow(case, "triaxial", (35.0, 10.0), INVARIANTS["static"], rows, -CONFINED)
    s = np.sin(np.deg2rad(35.0))
    wanted = CONFINED * (1 + s) / (1 - s) + 2 * COHESION * np.sqrt((1 + s) / (1 - s))
    case.metric("triaxial: strength / Mohr-Coulomb", float(-found["sigma 33"][-1] / wanted), 1.0,
                1e-8)  # fmt: skip
    plastic = found["yield"] > 0
    radial = np.polyfit(found["gamma 33"][plastic], found["gamma 11"][plastic], 1)[0]
    b = 2 * np.sqrt(6) / (3 - np.sin(np.deg2rad(10.0))) * np.sin(np.deg2rad(10.0))
    flow = np.sqrt(2 / 3)  # n of the cone: -2, 1, 1 over the root of six
    wanted = (flow / 2 + b / 3) / (-flow + b / 3)
    case.metric("triaxial: radial over axial flow / exact", float(radial / wanted), 1.0, 1e-6)
    judge_tangent(case, found)
    return found


def judge_elastic(case: Case) -> None:
    """Judge a strength out of reach: the fields of the elastic layer."""
    line = np.array([0.0, 0.1])
    x, hex8 = structured((line, np.linspace(-0.5, 0.5, 21), line))
    nodes = {
        "bottom": np.flatnonzero(np.isclose(x[:, 1], -0.5)),
        "top": np.flatnonzero(np.isclose(x[:, 1], 0.5)),
        "faces": np.flatnonzero(np.isclose(abs(x[:, 1]), 0.5)),
    }
    write_hex_mesh(case.folder / "layer.h5", x, hex8, nodes=nodes)
    fields = []
    strong = ", cohesion = 1.0e9, friction_deg = 30.0, plastic_length = 0.1"
    for law, strength in (("micropolar", ""), ("micropolar_drucker_prager", strong)):
        text = (case.folder / "layer.nml").read_text()
        text = text.replace("LAW", law).replace("STRENGTH", strength)
        (case.folder / f"{law}.nml").write_text(text)
        case.run("talus-fem", f"{law}.nml")
        fields.append(field_steps(case.folder / f"{law}.h5")[-1].solid)
    for name in ("u", "phi", "stress_points", "couple_stress_points", "reaction_couple"):
        off = abs(fields[1][name] - fields[0][name]).max() / abs(fields[0][name]).max()
        case.below(f"out of reach: {name}, difference / largest", float(off), 1e-11)


def run(case: Case) -> None:
    """Judge all; plot the path of one-sided shear for the three invariants."""
    for name, shares in INVARIANTS.items():
        judge_strength(case, name.replace(" ", ""), shares)
    judge_triaxial(case)
    judge_elastic(case)
    fig, ax = case.figure()
    for (name, shares), colour in zip(INVARIANTS.items(), ("C0", "C1", "C2"), strict=True):
        found = read_history(case.folder / f"{name.replace(' ', '')}_one_shear_point.csv")
        ax.plot(100 * found["gamma 12"], found["sigma 12"] / 1e3, "o", c=colour, ms=4, mfc="none",
                label=name)  # fmt: skip
        limit = 2 * np.sqrt(6) / 3 * COHESION / np.sqrt(2 * shares[0])
        ax.axhline(limit / 1e3, color=colour, lw=1)
    ax.set(xlabel="shear strain of one face [%]", ylabel="its shear stress [kPa]")
    ax.legend()
    case.save(fig)
