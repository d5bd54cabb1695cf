"""One point: tabulated answer, engineering constants, energy derivative, objectivity."""

import numpy as np

from talus.verification import Case, read_history

GAMMA = [
    [3.456e-4, -1.8499e-3, -5.086e-4],
    [1.3683e-3, 9.054e-4, 2.87e-4],
    [3.02e-4, 7.405e-4, 3.646e-4],
]
SIGMA = [
    [2479600.0, -1406550.0, -460900.0],
    [202550.0, 3879100.0, 1171000.0],
    [-55600.0, 1397750.0, 2527100.0],
]
COUPLE = [[-25.2995, 11.1615, -18.0485], [-0.264, -5.8945, -6.6065], [-13.5515, -7.136, -6.6845]]
AXIAL = [-226750.0, 405300.0, -1609100.0]
ENERGY = 4879.41100855
KL = [f"{k}{j}" for k in (1, 2, 3) for j in (1, 2, 3)]


def energy_by_steps(case: Case) -> float:
    """Largest relative error of sigma against central differences of the energy in u_i,j."""
    deck = (case.folder / "deck.nml").read_text()
    head, state = deck[: deck.index("&path")], "&path     material = 'eringen', gradient = "
    rest = deck[deck.index("rotation = ") : deck.index("&path     material = 'technical'")]
    base = np.array(
        [3.456e-4, 8.216e-4, 3.304e-4, -1.3032e-3, 9.054e-4, 4.464e-4, -5.37e-4, 5.811e-4, 3.646e-4]
    )
    step = 1e-5
    for k in range(9):
        for sign in (1.0, -1.0):
            moved = base + sign * step * np.eye(9)[k]
            head += state + ", ".join(repr(float(v)) for v in moved) + ", " + rest
    (case.folder / "steps.nml").write_text(head)
    case.run("talus-fem", "steps.nml", "--point")
    w = read_history(case.folder / "steps_point.csv")["energy"]
    slope = ((w[0::2] - w[1::2]) / (2 * step)).reshape(3, 3)  # dW/du_i,j = sigma_ji
    return float(np.abs(slope.T - SIGMA).max() / np.abs(SIGMA).max())


def run(case: Case) -> None:
    """Judge all numbers; plot the components of the stress."""
    case.run("talus-fem", "deck.nml", "--point")
    found = read_history(case.folder / "deck_point.csv")
    for row, name in enumerate(("Eringen's constants", "engineering constants")):
        for symbol, wanted in (("gamma", GAMMA), ("sigma", SIGMA), ("m", COUPLE)):
            values = np.array([found[f"{symbol} {kl}"][row] for kl in KL])
            error = np.abs(values - np.ravel(wanted)).max() / np.abs(wanted).max()
            case.below(f"{name}: {symbol}, error / largest", float(error), 1e-10)
        values = np.array([found[f"axial {k}"][row] for k in (1, 2, 3)])
        error = np.abs(values - AXIAL).max() / np.abs(AXIAL).max()
        case.below(f"{name}: axial vector, error / largest", float(error), 1e-10)
        case.metric(f"{name}: energy / exact", float(found["energy"][row]) / ENERGY, 1.0, 1e-10)
    case.below("sigma against the derivative of the energy", energy_by_steps(case), 1e-9)
    case.below("energy of a rigid rotation [J/m3]", float(found["energy"][2]), 1e-12)
    fig, ax = case.figure()
    place = np.arange(9)
    ax.bar(place, np.ravel(SIGMA) / 1e6, width=0.6, color="0.8", label="exact")
    ax.plot(place, [found[f"sigma {kl}"][0] / 1e6 for kl in KL], "ko", label="Talus")
    ax.set(xticks=place, xticklabels=KL, xlabel="component kl [-]", ylabel="stress sigma_kl [MPa]")
    ax.legend()
    case.save(fig)
