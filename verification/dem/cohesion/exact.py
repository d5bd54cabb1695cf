"""Pull-off, force curve and impacts of cohesive spheres against JKR, DMT and a constant pull."""

import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, YOUNG, POISSON, W = 5.0e-5, 2650.0, 1.0e8, 0.25, 0.05
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
JKR, DMT, PULL = 1.5 * np.pi * W * RADIUS, 2.0 * np.pi * W * RADIUS, 1.0e-5
LAWS = {
    "jkr": f"'jkr', surface_energy = {W}",
    "dmt": f"'dmt', surface_energy = {W}",
    "constant": f"'constant', pull_force = {PULL}",
}
LOST = 7.0917 * (W**5 * RADIUS**4 / E_STAR**2) ** (1 / 3)
STICK = np.sqrt(2 * LOST / MASS)
BEAT = 2.94 * (15 * MASS / (16 * E_STAR * np.sqrt(RADIUS))) ** 0.4 * STICK**-0.2


def curve(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Overlap [m] and force [N] of a neck of radius a."""
    overlap = a**2 / RADIUS - np.sqrt(2 * np.pi * W * a / E_STAR)
    force = 4 * E_STAR * a**3 / (3 * RADIUS) - np.sqrt(8 * np.pi * W * E_STAR * a**3)
    return overlap, force


def ran(case: Case, name: str, law: str, place: float, speed: float, **words: float) -> list:
    """Run one sphere at a height over the plane; return its steps."""
    deck = (case.folder / "deck.nml").read_text().replace("LAW", LAWS[law])
    for word, value in words.items():
        deck = deck.replace(word, f"{value:.10e}")
    (case.folder / f"{name}.nml").write_text(deck)
    x = np.array([[0.0, 0.0, RADIUS + place]])
    v = np.array([[0.0, 0.0, speed]])
    write_packing(case.folder / "pack.h5", x, np.full((1, 3), RADIUS), v=v)
    case.run("talus-dem", f"{name}.nml")
    return field_steps(case.folder / f"{name}.h5")


def held(
    case: Case, law: str, load: float, sign: float = 1.0, fields: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Load a touching sphere under heavy drag, away from the plane; return overlap and force."""
    drag = 5.0e6
    steps = ran(
        case, f"{law}_{sign * load / JKR:.3f}", law, -1e-12, 0.0, GZ=sign * load / MASS,
        END=3.0e-3, STEP=2.0e-7, DRAG=drag, FIELD=3.0e-3 / fields, ROW=3.0e-4,
    )  # fmt: skip
    overlap = np.array([RADIUS - s.grains["x"][0, 2] for s in steps])
    force = np.array([s.grains["force"][0, 2] for s in steps])
    return overlap, force


def pull_off(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Judge the loads that hold and that do not; return the JKR curve as run through."""
    for law, limit in (("jkr", JKR), ("dmt", DMT), ("constant", PULL)):
        overlap, force = held(case, law, 0.99 * limit)
        case.metric(f"{law}: force at rest under 0.99 of the pull-off", force[-1] / limit, -0.99,
                    1e-4)  # fmt: skip
        overlap, force = held(case, law, 1.01 * limit, fields=60 if law == "jkr" else 2)
        gone = float(overlap[-1] < -1e-6)
        case.metric(f"{law}: torn off at 1.01 of the pull-off", gone, 1.0, 0.0)
        if law == "jkr":
            pulled = overlap, force
    pressed = held(case, "jkr", 3.0 * JKR, -1.0, fields=60)
    overlap = np.concatenate([pressed[0], pulled[0]])
    force = np.concatenate([pressed[1], pulled[1]])
    acts = np.abs(force) > 0
    overlap, force = overlap[acts], force[acts]
    least = (np.pi * W * RADIUS**2 / (8 * E_STAR)) ** (1 / 3)
    neck = np.linspace(least, 12 * least, 200001)
    wanted = np.interp(overlap, *curve(neck))
    case.below("jkr: largest difference to the curve / pull-off",
               np.abs(force - wanted).max() / JKR, 1e-5)  # fmt: skip
    case.metric("jkr: largest pull / (3/2 pi w R)", -force.min() / JKR, 1.0, 2e-3,
                "samples as the neck tears")  # fmt: skip
    return overlap, force


def impacts(case: Case, law: str, speeds: list[float]) -> list[float]:
    """Judge rebounds at speeds given in sticking velocities; return restitutions."""
    found = []
    for factor in speeds:
        speed = factor * STICK
        steps = ran(
            case, f"{law}_impact_{factor:.2f}", law, 1e-9, -speed, GZ=0.0, END=6.0 * BEAT,
            STEP=BEAT / 4000, DRAG=0.0, FIELD=6.0 * BEAT, ROW=0.1 * BEAT,
        )  # fmt: skip
        rows = read_history(case.folder / f"{law}_impact_{factor:.2f}_energy.csv")
        e = steps[-1].grains["v"][0, 2] / speed
        stays = rows["contacts"][-1] > 0 or steps[-1].grains["x"][0, 2] < 1.01 * RADIUS
        first = 0.5 * MASS * speed**2
        wanted = np.sqrt(max(1 - factor**-2, 0)) if law == "jkr" else 1.0
        name = f"{law} at {factor:g} v_s"
        if wanted > 0:
            case.metric(f"{name}: restitution", e, wanted, 3e-3)
            if law == "jkr":
                case.metric(f"{name}: lost / exact", rows["breakage"][-1] / LOST, 1.0, 3e-3)
            found.append(e)
        else:
            case.metric(f"{name}: it stays", float(stays), 1.0, 0.0)
            found.append(0.0)
        closure = np.abs(rows["closure_error"]).max() / first
        case.below(f"{name}: closure / first energy", float(closure), 1e-4)
    return found


def run(case: Case) -> None:
    """Judge pull-off and impacts; plot the curve of a neck and the restitution."""
    overlap, force = pull_off(case)
    speeds = [0.8, 1.1, 1.3, 1.7, 2.5, 4.0]
    found = impacts(case, "jkr", speeds)
    impacts(case, "dmt", [1.3])
    impacts(case, "constant", [1.3])
    fig, axes = case.figure(ncols=2, figsize=(9.0, 4.0))
    least = (np.pi * W * RADIUS**2 / (8 * E_STAR)) ** (1 / 3)
    fine = curve(np.linspace(least, 4.4 * least, 300))
    axes[0].plot(fine[0] * 1e6, fine[1] / JKR, "-", label="JKR")
    axes[0].plot(overlap * 1e6, force / JKR, "o", label="Talus")
    axes[0].set(xlabel="overlap [um]", ylabel="force / (3/2 pi w R) [-]")
    axes[0].legend()
    fine = np.linspace(1.0, 4.2, 300)
    axes[1].plot(fine, np.sqrt(1 - fine**-2), "-", label="Thornton and Ning")
    axes[1].plot(speeds, found, "o", label="Talus")
    axes[1].set(xlabel="speed / sticking velocity [-]", ylabel="restitution [-]")
    axes[1].legend()
    case.save(fig)
