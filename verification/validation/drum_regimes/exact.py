"""A half-filled drum of beads at five Froude numbers: slope, shape of the surface, flight."""

import numpy as np
from drum import Drum

from talus.compare import extent, max_of
from talus.verification import Case, field_steps, read_history

D, SPREAD, GRAVITY = 3.0e-3, 0.04, 9.81  # of the beads [m], [-]; [m/s2]
RADIUS = 15.0 * D  # of the drum [m]
DRUM = Drum(RADIUS, D, int(0.5 * 0.6 * np.pi * RADIUS**2 * 4.2 * D / (np.pi / 6.0 * D**3)), 20.0)
RUNS = {0.001: 2.4, 0.01: 1.4, 0.05: 1.2, 0.3: 1.2, 2.0: 1.4}  # Froude number: time [s]
FRAMES = 60


def run(case: Case) -> None:
    """Settle one bed, turn the drum at five speeds, compare."""
    DRUM.fill(case.folder / "start.h5", SPREAD)
    DRUM.write_ribs(case.folder / "ribs.stl")
    tilt = np.radians(DRUM.tilt)
    gravity = f"{-GRAVITY * np.sin(tilt):.9g}, 0.0, {-GRAVITY * np.cos(tilt):.9g}"
    go(case, "settle", "settle_run", {"GRAVITY": gravity})
    found = [turn(case, froude, end) for froude, end in RUNS.items()]
    slow, rolling, cascade, thrown, round_about = found
    case.metric("slope at Fr = 0.001 [deg]", slow["slope"], 25.0, 3.0,
                "rounded grains about 25 (Kleinhans et al.)")  # fmt: skip
    for item in (slow, rolling):
        case.below(f"surface less a line, rms / diameter, {item['name']}", item["rough"], 1.0,
                   "rolling: level (Mellmann)")  # fmt: skip
    case.above("the same at Fr = 0.05 over that at 0.001", cascade["rough"] / slow["rough"], 1.5,
               "cascading: arched (Mellmann)")  # fmt: skip
    case.above("rise of the slope from Fr = 0.001 to 0.05 [deg]",
               cascade["slope"] - slow["slope"], 2.0)  # fmt: skip
    case.below("beads without contact at Fr = 0.01", rolling["flight"], 0.02, "rolling")
    case.above("beads without contact at Fr = 0.3", thrown["flight"], 0.05,
               "cataracting: 0.1 to 1 (Mellmann)")  # fmt: skip
    case.below("mean turn of the beads / that of the drum, Fr = 0.3", thrown["turn"], 0.5)
    case.above("the same at Fr = 2, in the last third", round_about["turn"], 0.95,
               "centrifuging: above 1 (Mellmann)")  # fmt: skip
    case.below("beads lost", max_of(item["lost"] for item in found), 0.0)
    case.below("closure of the ledger, relative", max_of(i["closure"] for i in found), 5e-3)
    draw(case, found)


def go(case: Case, part: str, name: str, words: dict[str, str]) -> None:
    """Write a deck with its words filled in, and run it."""
    text = (case.folder / f"{part}.nml").read_text()
    for word, value in (words | {"WIDTH": f"{DRUM.width:.9g}", "RADIUS": f"{RADIUS}"}).items():
        text = text.replace(word, value)
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")


def turn(case: Case, froude: float, end: float) -> dict:
    """Turn the drum at a Froude number; return means over the second half."""
    omega, name = np.sqrt(froude * GRAVITY / RADIUS), f"Fr = {froude:g}"
    stem = f"turn_{froude:g}"
    go(case, "turn", stem, {"OMEGA": f"{omega:.9g}", "T_END": f"{end}", "ROW": f"{end / FRAMES}"})
    steps = field_steps(case.folder / f"{stem}.h5")
    late = steps[len(steps) // 2 :]
    across, height = DRUM.surface(late, 0.8)
    line = np.polyfit(across, height, 1)
    rough = np.sqrt(np.mean((np.polyval(line, across) - height) ** 2)) / D
    flight = [float((step.grains["coordination"] == 0).mean()) for step in late]
    turns = []
    for step in steps[2 * len(steps) // 3 :]:
        x, v = step.grains["x"], step.grains["v"]
        moment = (x[:, 2] * v[:, 0] - x[:, 0] * v[:, 2]).sum()
        turns.append(moment / (x[:, 0] ** 2 + x[:, 2] ** 2).sum() / omega)
    energy = read_history(case.folder / f"{stem}_energy.csv")
    out = np.hypot(late[-1].grains["x"][:, 0], late[-1].grains["x"][:, 2]) > RADIUS
    return {
        "name": name, "froude": froude, "slope": DRUM.slope(late)[0] if froude < 0.1 else np.nan,
        "rough": float(rough), "flight": float(np.mean(flight)), "turn": float(np.mean(turns)),
        "across": across, "height": height, "grains": late[-1].grains,
        "lost": float(DRUM.count - len(late[-1].grains["id"]) + out.sum()),
        "closure": extent(energy["relative_closure"]),
    }  # fmt: skip


def draw(case: Case, found: list[dict]) -> None:
    """Draw the last state at each Froude number, with the mean surface where it is one."""
    fig, axes = case.figure(ncols=5, figsize=(16.0, 3.6))
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    for ax, item in zip(axes, found, strict=True):
        beads = item["grains"]
        speed = np.linalg.norm(beads["v"], axis=1)
        top = np.sqrt(item["froude"] * GRAVITY * RADIUS) + 0.3
        ax.scatter(beads["x"][:, 0] / D, beads["x"][:, 2] / D, s=7, c=speed, vmin=0.0, vmax=top)
        ax.plot(RADIUS / D * np.cos(angle), RADIUS / D * np.sin(angle), "k", lw=0.8)
        title = item["name"]
        if item["froude"] < 0.1:
            ax.plot(item["across"] / D, item["height"] / D, "C1", lw=1.2)
            title += f", slope {item['slope']:.1f} deg"
        ax.set(xlabel="x / diameter", aspect="equal", title=title)
    axes[0].set(ylabel="z / diameter")
    case.save(fig)
