"""Motions of a plate one after another, against the composed rigid motions."""

import h5py
import numpy as np

from talus.verification import Case, field_steps, read_history, write_packing

CORNERS = np.array([[0.0, -0.02, -0.02], [0.0, 0.02, -0.02], [0.0, 0.02, 0.02]])
PIVOT, CENTRE = np.array([0.05, 0.03, 0.0]), np.array([0.0, 0.005, 0.01])
ALONG, SWING, RISE = np.array([0.2, 0.1, 0.0]), np.array([2.0, 0.0, 8.0]), np.array([0.0, 0.0, 0.3])
TURN, END = np.array([0.0, 5.0, -1.0]), 0.32
#: Start and end of each motion [s].
TIMES = {
    "along": (0.0, 0.0503),
    "swing": (0.0503, 0.1507),
    "rise": (0.16, 0.25),
    "turn": (0.26, 0.3),
}
RAMP = ((0.16, 0.2, 0.25), (0.0, 1.0, 0.5))


def turned(x: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return x (..., 3) turned by a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(rotation)
    if not angle > 0.0:
        return x
    axis = rotation / angle
    along = (x @ axis)[..., None] * axis
    return along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)


def numbers(values: np.ndarray) -> str:
    """Return numbers as a deck has them."""
    return ", ".join(f"{v:.12g}" for v in np.ravel(values))


def motion(name: str, *keys: str) -> str:
    """Return a group motion of the plate."""
    first, last = TIMES[name]
    return f"&motion surface = 'plate', from = {first}, until = {last}, {', '.join(keys)} /\n"


def plate(keys: str = "") -> str:
    """Return the plate."""
    return f"&surface id = 'plate', rectangle = {numbers(CORNERS)}, material = 'glass'{keys} /\n"


def paths() -> str:
    """Return the plate with its four motions."""
    deck = plate(f", centre = {numbers(CENTRE)}")
    deck += f"&curve id = 'ramp', times = {numbers(RAMP[0])}, values = {numbers(RAMP[1])} /\n"
    deck += motion("along", f"velocity = {numbers(ALONG)}")
    deck += motion("swing", f"spin = {numbers(SWING)}", f"about = {numbers(PIVOT)}")
    deck += motion("rise", f"velocity = {numbers(RISE)}", "curve = 'ramp'")
    return deck + motion("turn", f"spin = {numbers(TURN)}")


def places(time: np.ndarray) -> np.ndarray:
    """Return where the plate's centre is at each time (n, 3) [m]."""
    found = []
    for t in time:
        spent = {k: np.clip(t, *span) - span[0] for k, span in TIMES.items()}
        x = CENTRE + spent["along"] * ALONG
        x = PIVOT + turned(x - PIVOT, spent["swing"] * SWING)
        grid = np.unique(np.clip([*RAMP[0], t], None, max(t, RAMP[0][0])))
        grid = grid[grid <= t] if t > RAMP[0][0] else grid[:1]
        value = np.interp(grid, *RAMP)
        area = np.trapezoid(value, grid) if grid.size > 1 else 0.0
        if t > TIMES["rise"][1]:
            area = np.trapezoid(RAMP[1], RAMP[0])
        found.append(x + area * RISE)
    return np.array(found)


def run_deck(
    case: Case, name: str, end: float, groups: str, *options: str, step: str = "1.0e-5"
) -> None:
    """Write and run a deck."""
    text = (case.folder / "deck.nml").read_text().replace("@end@", f"{end:.9g}")
    text = text.replace("@step@", step) + groups
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1", *options)


def corners(case: Case, name: str) -> np.ndarray:
    """Return the last corners of the plate in the field file, sorted (4, 3) [m]."""
    with h5py.File(case.folder / f"{name}.h5") as file:
        x = file["steps"][max(file["steps"])]["surfaces/x"][...]
    return x[np.lexsort(np.round(x, 9).T)]


def run(case: Case) -> None:
    """Judge places, turn, restart, and the push of a swing."""
    write_packing(case.folder / "bead.h5", np.array([[0.5, 0.5, 0.5]]), np.full((1, 3), 2.0e-3))
    run_deck(case, "paths", END, paths())
    rows = read_history(case.folder / "paths_surfaces.csv")
    place = np.stack([rows[c] for c in "xyz"], -1)
    expected = places(rows["time"])
    case.below("error of the centre at 320 times [m]", float(np.abs(place - expected).max()),
               1.0e-12, "rounding; each time ends a stretch of ten steps")  # fmt: skip
    fourth = CORNERS[0] + CORNERS[2] - CORNERS[1]
    ends = turned(np.array([*CORNERS, fourth]) - CENTRE, 0.1004 * SWING)
    ends = turned(ends, 0.04 * TURN) + expected[-1]
    ends = ends[np.lexsort(np.round(ends, 9).T)]
    case.below("error of the plate's corners at the end [m]",
               float(np.abs(corners(case, "paths") - ends).max()), 1.0e-12, "rounding")  # fmt: skip
    swings(case)
    restarted(case)
    draw(case, place, expected)


def swings(case: Case) -> None:
    """Plates that swing about a point in space, and about their centre there, push a bead alike."""
    swing, pivot = "spin = 0.0, 0.0, 8.0", numbers([0.0, 0.03, 0.0])
    bead = np.array([[2.5e-3, -0.005, 0.002]])
    write_packing(case.folder / "bead.h5", bead, np.full((1, 3), 2.0e-3))
    speeds = {}
    for name, groups in (
        ("space", plate() + f"&motion surface = 'plate', {swing}, about = {pivot} /\n"),
        ("own", plate(f", centre = {pivot}, {swing}")),
    ):  # fmt: skip
        run_deck(case, f"swing_{name}", 0.05, groups, step="2.0e-6")
        grains = field_steps(case.folder / f"swing_{name}.h5")[-1].grains
        speeds[name] = np.concatenate([grains["v"][0], grains["x"][0]])
        energy = read_history(case.folder / f"swing_{name}_energy.csv")
        case.below(
            f"closure of the ledger, {name}", float(energy["relative_closure"].max()), 1.0e-4
        )
    fast = np.linalg.norm(speeds["own"][:3])
    case.above("speed of the bead that was pushed [m/s]", float(fast), 0.2, "it was hit")
    differ = np.linalg.norm((speeds["own"] - speeds["space"])[:3]) / fast
    case.below("difference of both swings, part of that speed", float(differ), 1.0e-4,
               "chords of ten steps, 0.00016 rad long, for the arc")  # fmt: skip


def restarted(case: Case) -> None:
    """A run from a checkpoint goes on to the same bits."""
    write_packing(case.folder / "bead.h5", np.array([[0.5, 0.5, 0.5]]), np.full((1, 3), 2.0e-3))
    run_deck(case, "part", 0.1, paths())
    run_deck(case, "part", END, paths(), "--restart=part.chk.h5")
    first, second = (read_history(case.folder / f"{n}_surfaces.csv") for n in ("paths", "part"))
    same = all(np.array_equal(first[c][-50:], second[c][-50:]) for c in "xyz")
    case.metric("restart within the swing, same digits", float(same), 1.0, 0.0)


def draw(case: Case, place: np.ndarray, expected: np.ndarray) -> None:
    """Draw the way of the centre."""
    fig, axes = case.figure(ncols=2, figsize=(8.0, 3.6))
    for ax, (i, j) in zip(axes, ((0, 1), (0, 2)), strict=True):
        ax.plot(1e3 * place[:, i], 1e3 * place[:, j], lw=4, color="0.75", label="talus-dem")
        ax.plot(1e3 * expected[:, i], 1e3 * expected[:, j], "C3", lw=1, label="composed motions")
        ax.plot(1e3 * PIVOT[i], 1e3 * PIVOT[j], "k+", label="pivot")
        ax.set(xlabel=f"{'xyz'[i]} [mm]", ylabel=f"{'xyz'[j]} [mm]")
    axes[0].legend(fontsize=8)
    case.save(fig)
