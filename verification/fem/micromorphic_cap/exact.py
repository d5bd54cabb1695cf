"""Closed surfaces and breakage of a micromorphic point against an independent integration."""

import json

import numpy as np

from talus.compare import max_of
from talus.verification import Case, read_history

MICRO = "eta = 60.0, tau = 10.0, kappa = 10.0, nu = 8.0, sigma = 5.0,"
AXES = (1, 2, 3)
NINE = [f"{i}{j}" for i in AXES for j in AXES]
MANY = [f"{i}{j}{k}" for i in AXES for j in AXES for k in AXES]

Found = dict[str, np.ndarray]


def surface_rows(surfaces: dict) -> str:
    """Return the groups of the surfaces; slopes of the deck are q over p."""
    text = ""
    for level, s in surfaces.items():
        if s is None:
            continue
        row = f"&cone level = '{level}', kind = '{s['kind']}'"
        if s["kind"] == "cone":
            row += f", friction_deg = {float(np.degrees(s['yield_'][0]))!r}, shape = -1.0"
            row += f", dilation_deg = {float(np.degrees(s['flow'][0]))!r}, cohesion = {s['c0']!r}"
            if "pressure" in s:
                row += f", pressure = 'macro', length = {s['length']!r}"
        else:
            row += f", critical_slope = {s['M'] * 1.5**0.5!r}"
        if s["kind"] == "ellipse":
            row += f", preconsolidation = {s['pc0']!r}, tension = {s['pt']!r}"
            row += f", exponent = {s['zeta']!r}"
            if "Mg" in s:
                row += f", flow_slope = {s['Mg'] * 1.5**0.5!r}"
        if s["kind"] == "breakage":
            row += f", breakage_energy = {s['Ec']!r}, breakage_angle_deg = {s['omega']!r}"
            theta = (s["theta_strain"], s["theta_gradient"], 0.9)
            row += ", grading_indices = {!r}, {!r}, {!r}".format(*theta)
        text += row + " /\n"
    return text


def control_rows(reference: dict, squeezed: bool) -> str:
    """Return the path: straight, or isotropic compression before shear."""
    text = ""
    names = {"F": NINE, "chi": NINE, "grad_chi": MANY}
    for field, places in names.items():
        ends = np.array(reference[field], float)
        if field != "grad_chi":
            ends = ends - np.eye(3)
        for place, value in zip(places, ends.ravel(), strict=True):
            if value == 0.0:
                continue
            curve = "path"
            if squeezed:
                curve = "squeeze" if place[0] == place[1] else "shear"
            text += f"&micro_control component = '{field}{place}', curve = '{curve}', "
            text += f"scale = {float(value)!r} /\n"
    return text


def follow(case: Case, name: str, reference: dict, update: str) -> Found:
    """Run a path of the reference."""
    text = (case.folder / "point.nml").read_text()
    for word, value in {
        "MICRO": MICRO if reference["micro"] else "",
        "UPDATE": update,
        "SURFACES": surface_rows(reference["surfaces"]),
        "STEPS": str(reference["steps"]),
    }.items():
        text = text.replace(word, value)
    squeezed = "isotropic" in reference["path"] or reference["F"][0][1] > 0.25 or name == "crushed"
    text += control_rows(reference, squeezed)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-fem", f"{name}.nml", "--point")
    return read_history(case.folder / f"{name}_point.csv")


def tensor(found: Found, name: str, order: int = 2) -> np.ndarray:
    """Return a field, rows first."""
    places = NINE if order == 2 else MANY
    return np.stack([found[f"{name} {p}"] for p in places], -1).reshape((-1,) + (3,) * order)


def measures(found: Found) -> Found:
    """Return pressures and deviators of the intermediate configuration, and volumes."""
    plastic, micro = tensor(found, "Fp"), tensor(found, "chi_p")
    elastic = tensor(found, "F") @ np.linalg.inv(plastic)
    back = np.linalg.inv(elastic)
    c = np.swapaxes(elastic, 1, 2) @ elastic
    rows = {"det_Fp": np.linalg.det(plastic), "det_chip": np.linalg.det(micro)}
    for level, name in (("macro", "cauchy"), ("micro", "micro")):
        stress = back @ tensor(found, name) @ np.swapaxes(back, 1, 2)
        stress = stress * np.linalg.det(elastic)[:, None, None]
        p = np.einsum("nij,nij->n", c, stress) / 3
        dev = stress - p[:, None, None] * np.linalg.inv(c)
        rows[f"p_{level}"], rows[f"dev_{level}"] = p, np.linalg.norm(dev, axis=(1, 2))
    rows["B"], rows["EB"] = found["breakage"], found["breakage energy"]
    return rows


def largest(values: list) -> float:
    """Return the largest size of numbers in arrays, NaN if one is."""
    return max_of(float(abs(np.asarray(v)).max()) for v in values)


def judge_path(case: Case, name: str, reference: dict, update: str) -> Found:
    """Judge stresses, volumes and breakage along a path and all tensors at its end."""
    found = follow(case, name, reference, update)
    rows, wanted, end = measures(found), reference["rows"], reference["end"]
    at = np.rint(np.array(wanted["t"]) * reference["steps"]).astype(int)
    names = ("p_macro", "dev_macro", "p_micro", "dev_micro", "EB")
    stress = largest([wanted[k] for k in names])
    errors = [(rows[k][at] - wanted[k]) / stress for k in names]
    errors += [rows[k][at] - wanted[k] for k in ("det_Fp", "det_chip", "B")]
    case.below(f"{name}: stress / largest, volumes, breakage", largest(errors), 1e-7)
    active = np.stack([found[f"active {k}"] for k in range(1, 6)], -1)[at] > 0
    case.metric(
        f"{name}: all rows have the same surfaces",
        float((active == wanted["active"]).all()),
        1.0,
        0,
    )
    pairs = (("Fp", "Fp"), ("chi_p", "chip"), ("grad_chi_p", "grad_chip"))
    errors = [tensor(found, a, 3 if "grad" in a else 2)[-1] - end[b] for a, b in pairs]
    errors += [(tensor(found, "cauchy")[-1] - end["cauchy"]) / stress]
    errors += [(tensor(found, "micro")[-1] - end["micro_stress"]) / stress]
    errors += [(tensor(found, "couple", 3)[-1] - end["couple_stress"]) / stress]
    case.below(f"{name}: tensors at the end", largest(errors), 1e-7)
    case.metric(f"{name}: parts of a step", float(found["substeps"].max()), 1.0, 0)
    growth = float(np.diff(found["dissipated"]).min())
    case.above(f"{name}: least growth of the dissipation", growth, -1e-14)
    for k, (level, det) in enumerate((("macro", "det_Fp"), ("micro", "det_chip")), 1):
        surface = reference["surfaces"][level]
        if surface is None or surface["kind"] != "ellipse":
            continue
        kept = found[f"cap {k}"] * rows[det] ** surface["zeta"] / surface["pc0"] - 1
        case.below(f"{name}: p_c det^zeta of level {level}, change", largest([kept]), 1e-12)
    return found | rows


def judge_critical(case: Case, exact: Found, euler: Found) -> None:
    """Judge the critical state that both updates reach [MPa]."""
    slope, tension = 0.98, 0.005
    top = 0.5 * (tension - exact["cap 1"][-1])
    case.metric("exact: p - p_o at the end", float(exact["p_macro"][-1] - top), 0.0, 1e-8)
    radius = 0.5 * (tension + exact["cap 1"][-1])
    off = float(exact["dev_macro"][-1] - slope * radius)
    case.metric("exact: dev - M R at the end", off, 0.0, 1e-8)
    off = float(euler["p_macro"][-1] / (0.5 * (tension - euler["cap 1"][-1])) - 1)
    case.metric("shear: p/p_o - 1 at the end, backward Euler", off, 5.5e-3, 2e-4)


def judge_drift(case: Case, reference: dict) -> None:
    """Judge what a macro-ellipse alone does where chi follows F with all moduli."""
    rows = measures(follow(case, "drift", reference | {"micro": True}, "euler"))
    for row, wanted in ((24, 0.989), (40, 1.033)):
        ratio = float(-rows["dev_macro"][row] / rows["p_macro"][row])
        case.metric(f"drift: dev/p after {row} steps, chi held to F", ratio, wanted, 0.001)


def judge_crushing(case: Case, reference: dict) -> Found:
    """Judge isotropic crushing at small strains, without micro-moduli, by the closed line."""
    energy, theta, bulk = 1e-7, 0.8, 29.0 + 2 * 7.0 / 3
    surface = reference["surfaces"]["macro"] | {"Ec": energy}
    ends = (np.eye(3) * (1 - 4e-4)).tolist()
    path = reference | {"micro": False, "steps": 100, "F": ends, "chi": ends, "path": "",
                        "surfaces": {"macro": surface}}  # fmt: skip
    found = follow(case, "crushing", path, "euler")
    rows = measures(found)
    crushed = np.flatnonzero(found["active 1"] > 0)
    x = -rows["p_macro"][crushed] / (2 * bulk * energy / theta) ** 0.5
    off = largest([rows["B"][crushed] - (x - 1) / (x - theta)])
    case.below("crushing: B from the closed line, strains of 1e-4", off, 2e-3)
    case.above("crushing: last B", float(rows["B"][-1]), 0.5)
    released = np.diff(found["dissipated"]).sum()
    case.above("crushing: dissipated energy", float(released), 0.0)
    return {"x": x, "B": rows["B"][crushed]}


def run(case: Case) -> None:
    """Judge all paths."""
    reference = json.loads((case.folder / "reference.json").read_text())
    found = {name: judge_path(case, name, path, "exact_volume" if name == "exact" else "euler")
             for name, path in reference.items()}  # fmt: skip
    judge_critical(case, found["exact"], found["shear"])
    judge_drift(case, reference["shear"])
    judge_crushing(case, reference["crushed"])
    fig, ax = case.figure()
    for name, mark in (("shear", "-"), ("exact", "--"), ("dilating", "-")):
        ax.plot(
            -1e3 * found[name]["p_macro"],
            1e3 * found[name]["dev_macro"],
            mark,
            label=f"Talus, {name}",
        )
        rows = reference[name]["rows"]
        p, dev = -1e3 * np.array(rows["p_macro"]), 1e3 * np.array(rows["dev_macro"])
        ax.plot(p, dev, "o", mfc="none", label="independent" if name == "dilating" else None)
    ax.set(xlabel="pressure [kPa]", ylabel="|dev| [kPa]")
    ax.legend()
    case.save(fig)
