"""Micromorphic elasticity at a point: a far state, and free components in equilibrium."""

import numpy as np

from talus.verification import Case, read_history

KL = [f"{k}{j}" for k in (1, 2, 3) for j in (1, 2, 3)]
# unit tests of tardigrade_micromorphic_linear_elasticity: displacement gradient, chi - 1, grad chi,
# and what follows from them
GRAD_U = """-1.07901185 -1.09656192 -0.04629144 -0.77749189 -1.27877771 -0.82648234 0.66484637
-0.05552567 -1.65125738"""
PHI = """-1.40391532 -0.42715691 0.75393369 0.2849511 -2.06484257 -0.52190902 1.07238446 0.19155907
-0.39704566"""
GRAD_PHI = """0.14940184 0.12460812 0.31971128 0.67550862 0.61095383 0.87972732
0.30872424 0.32158187
0.25480281 0.45570006 0.69090695 0.72388584 0.14880964 0.67520596 0.15106516 0.77810545
0.07641724 0.09367471 0.15905979 0.0651695 0.52150417 0.91873444 0.5622355 0.50199447
0.26729942 0.89858519 0.09043229"""
FAR = {
    "consistent": {
        "S": """-34.9050076642 99.3588415488 135.854796427 -57.4274690109 140.660274547 183.42580874
-40.1845667499 126.9304566 147.288873518""",
        "Sigma": """-63.8296950811 34.4697940079 96.1942470643 34.4697940079 284.388117504
309.459049177 96.1942470643 309.459049177 306.067535083""",
        "cauchy": """166.276843746 153.999301714 173.066421665 219.627537067 204.589364004
215.074715316 23.7737519279 13.2594967968 13.8379103665""",
        "micro": """334.639351705 368.740920586 201.234327146 368.740920586 416.857902929
231.831618767 201.234327146 231.831618767 34.3264461483""",
    },
    "reduced": {
        "S": """-8.62630503877 5.04552169775 -7.32153693941 11.6565339925 -4.66549355145
9.77346408061 8.71956023712 -4.60321058672 -13.3885271156""",
        "Sigma": """-11.2722898302 9.24047716015 1.9220406853 9.24047716015 -6.26341869218
4.27303733033 1.9220406853 4.27303733033 -15.2872661842""",
        "cauchy": """-3.50017688972 14.2673353068 -2.10106730631 -1.45166417438 -7.93036226064
-10.2927282527 -5.67542764669 4.22305318537 -9.27497171941""",
        "micro": """-4.91468956683 7.92975293768 -3.38234139992 7.92975293768 -8.18154959991
-2.57226841329 -3.38234139992 -2.57226841329 -11.8993180236""",
    },
}
# unit tests testFormIsotropicA to D of tardigrade_hydra: entries of C by row, taus = 2 to 12
O11 = {0: 97.0, 4: 13.0, 8: 13.0, 10: 16.0, 12: 9.0, 28: 23.0, 30: 22.0, 36: 23.0, 40: 9.0, 44: 2.0,
       50: 3.0, 52: 4.0}  # fmt: skip
COUPLE_11K = [10.1924409842, 131.600160126, -110.930468133]
# gold file stretch_y of Tardigrade: F22, lateral displacement, chi_xx - 1, chi_yy - 1, S_22,
# Cauchy stress
STRETCH = np.array([
    [1.01, -0.00310863048587, -0.00413588611663, 0.00814584708277, 517.563790166, 526.004653179],
    [1.02, -0.00625806263129, -0.00832933902824, 0.0163097816976, 1040.27746879, 1074.48938125],
    [1.03, -0.00944868561962, -0.012581038074, 0.0244912770233, 1568.14103588, 1646.14613755],
    [1.04, -0.0126808987881, -0.016891682446, 0.0326898265008, 2101.15449142, 2241.69357375],
    [1.05, -0.0159551119604, -0.021261991931, 0.0409049428687, 2639.31783542, 2861.87837107],
    [1.06, -0.0192717457941, -0.0256927076904, 0.0491361572526, 3182.63106789, 3507.47665128],
    [1.07, -0.022631232144, -0.0301845930784, 0.0573830183064, 3731.09418881, 4179.29547322],
    [1.08, -0.0260340144416, -0.0347384345018, 0.0656450914003, 4284.70719819, 4878.17442086],
    [1.09, -0.0294805480925, -0.0393550423246, 0.0739219578544, 4843.47009603, 5604.9872897],
    [1.1, -0.0329713008918, -0.0440352518187, 0.0822132142132, 5407.38288233, 6360.64387846],
])  # fmt: skip


def numbers(text: str) -> np.ndarray:
    """Return the numbers of a text."""
    return np.array([float(word) for word in text.split()])


def far_deck(form: str) -> str:
    """Return the deck of the far state: every component prescribed."""
    rows = [(f"F{kl}", v) for kl, v in zip(KL, numbers(GRAD_U), strict=True)]
    rows += [(f"chi{kl}", v) for kl, v in zip(KL, numbers(PHI), strict=True)]
    places = [f"{kl}{m}" for kl in KL for m in (1, 2, 3)]
    rows += [(f"grad_chi{klm}", v) for klm, v in zip(places, numbers(GRAD_PHI), strict=True)]
    head = f"""&run title = 'Far state' /
&micromorphic lambda = 1.7, mu = 1.8, eta = 2.8, tau = 0.76, kappa = 0.15, nu = 9.8, sigma = 5.4,
  taus = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, elastic_form = '{form}' /
&micro_point steps = 1 /
"""
    return head + "".join(
        f"&micro_control component = '{name}', scale = {float(value)!r} /\n" for name, value in rows
    )


def judge_far(case: Case, form: str) -> None:
    """Judge the stresses of the far state."""
    (case.folder / f"far_{form}.nml").write_text(far_deck(form))
    case.run("talus-fem", f"far_{form}.nml", "--point")
    found = read_history(case.folder / f"far_{form}_point.csv")
    for name, text in FAR[form].items():
        wanted = numbers(text)
        off = np.abs(np.array([found[f"{name} {kl}"][1] for kl in KL]) - wanted).max()
        case.below(f"far, {form}: {name}, error / largest", float(off / abs(wanted).max()), 1e-9)
    couple = [found[f"couple 11{k}"][1] for k in (1, 2, 3)]
    off = float(np.abs(np.subtract(couple, COUPLE_11K)).max() / 131.600160126)
    case.below(f"far, {form}: couple stress 11K, error / largest", off, 1e-9)


def judge_moduli(case: Case) -> None:
    """Judge the table of the eleven gradient moduli: couple stress of each unit gradient of chi."""
    places = [f"{kl}{m}" for kl in KL for m in (1, 2, 3)]
    many = len(places)
    lines = [
        "&run title = 'Unit gradients' /",
        "&micromorphic lambda = 4.0, mu = 7.0, eta = 3.0, tau = 5.0, kappa = 6.0, nu = 8.0,",
        f"  sigma = 4.0, taus = {', '.join(str(k) for k in range(2, 13))} /",
        f"&micro_point steps = {many} /",
    ]
    for k, place in enumerate(places, 1):
        times = [0.0, (k - 1) / many, k / many, (k + 1) / many, 2.0]
        rows = [(t, float(j == 2)) for j, t in enumerate(times) if j != 1 or t > 0.0]
        at, value = (", ".join(repr(row[i]) for row in rows) for i in (0, 1))
        lines.append(f"&curve id = 'u{k}', times = {at}, values = {value} /")
        lines.append(f"&micro_control component = 'grad_chi{place}', curve = 'u{k}', scale = 1.0 /")
    (case.folder / "unit.nml").write_text("\n".join(lines) + "\n")
    case.run("talus-fem", "unit.nml", "--point")
    found = read_history(case.folder / "unit_point.csv")
    m = np.array([found[f"couple {p}"][-many:] for p in places]).reshape(3, 3, 3, many)
    c = m.transpose(1, 2, 0, 3).reshape(729)  # M_IJK = C_JKILMN Gamma_LMN
    for row, value in O11.items():
        case.metric(f"O11: C, entry {row}", float(c[row]), value, 1e-12)
    case.metric("O11: C, entries that are not zero", int((abs(c) > 1e-12).sum()), 183, 0)


def judge_stretch(case: Case) -> dict[str, np.ndarray]:
    """Judge the element that is pulled, its sides and its micro-deformation free."""
    case.run("talus-fem", "stretch.nml", "--point")
    found = read_history(case.folder / "stretch_point.csv")
    row = [int(np.argmin(abs(found["F 22"] - f))) for f in STRETCH[:, 0]]
    for k, (name, shift) in enumerate(
        (("F 11", 1), ("chi 11", 1), ("chi 22", 1), ("S 22", 0), ("cauchy 22", 0)), 1
    ):
        off = np.abs(found[name][row] - shift - STRETCH[:, k]).max() / abs(STRETCH[:, k]).max()
        case.below(f"stretch: {name}, error / largest", float(off), 1e-8)
    works = found["work"][-1] / found["stored"][-1]
    case.metric("stretch: trapezoids of the work / stored", float(works), 1.0, 1e-3)
    return found


def judge_cylinders(case: Case) -> None:
    """Judge St. Venant-Kirchhoff cylinders under uniaxial stress, chi held."""
    cylinders = (
        ("cylinder_1", 1.00387299994, "S 33", -1.64175, -1.61281543938, -31.9133290103),
        (
            "cylinder_2",
            1.0 + 0.0049700597013 / 2.5,
            "S 33",
            -2.4875,
            -2.45286260682,
            -48.3535288034,
        ),
    )
    for name, side, key, s, cauchy, force in cylinders:
        case.run("talus-fem", f"{name}.nml", "--point")
        found = read_history(case.folder / f"{name}_point.csv")
        case.metric(f"{name}: lateral stretch", float(found["F 11"][-1]), side, 1e-10)
        case.metric(f"{name}: S33 / exact", float(found[key][-1] / s), 1.0, 1e-9)
        case.metric(f"{name}: Cauchy / exact", float(found["cauchy 33"][-1] / cauchy), 1.0, 1e-9)
        area = np.pi * 2.5**2
        case.metric(f"{name}: force / exact", float(found["P 33"][-1] * area / force), 1.0, 1e-9)


def run(case: Case) -> None:
    """Judge all; plot the stretched element."""
    for form in FAR:
        judge_far(case, form)
    judge_moduli(case)
    found = judge_stretch(case)
    case.run("talus-fem", "column.nml", "--point")
    column = read_history(case.folder / "column_point.csv")
    for name, wanted in (
        ("P 33", -2.67539240506),
        ("chi 11", 0.968433544304),
        ("chi 33", 1.20798171589),
    ):
        case.metric(f"column: {name} / exact", float(column[name][-1] / wanted), 1.0, 1e-9)
    judge_cylinders(case)
    fig, ax = case.figure()
    ax.plot(found["F 22"], found["cauchy 22"], "o", mfc="none", label="Talus, Cauchy stress")
    ax.plot(STRETCH[:, 0], STRETCH[:, 5], "-", label="published, Cauchy stress")
    ax.plot(found["F 22"], found["S 22"], "s", mfc="none", label="Talus, S")
    ax.plot(STRETCH[:, 0], STRETCH[:, 4], "--", label="published, S")
    ax.set(xlabel="stretch F22 [-]", ylabel="axial stress [MPa]")
    ax.legend()
    case.save(fig)
