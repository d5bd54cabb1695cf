"""A pair of spheres along x with given forces: stress, couple stress, fields."""

import h5py
import numpy as np

from talus.verification import Case, read_history, write_packing

HALF, VOLUME, CELL = 1.0e-3, 1.0e-6, 0.5e-3**3
MASS = 2500.0 * 4.0 / 3.0 * np.pi * HALF**3
X = np.array([[-HALF, 0.0, 0.0], [HALF, 0.0, 0.0]])
V = np.array([[0.1, 0.0, 0.2], [0.3, -0.4, 0.0]])
PUSH, SHEAR = np.array([5.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])  # on the second grain [N]
OFF = np.array([0.0, 0.0, 0.5e-3])


def write_states(path: str, states: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Write a field file: contact point [m] and force on the second grain [N] of every step."""
    with h5py.File(path, "w") as file:
        file.attrs["format"] = np.bytes_("talus-grains")
        for k, (point, force) in enumerate(states):
            step = file.create_group(f"steps/{k:06d}")
            step.attrs["time"] = float(k)
            grains = {"id": np.array([1, 2]), "x": X, "v": V, "omega": np.zeros((2, 3)),
                      "quat": np.tile([1.0, 0, 0, 0], (2, 1)),
                      "kind": np.zeros(2, np.int32)}  # fmt: skip
            contacts = {"ids": np.array([[1, 2]]), "point": point[None], "force": force[None],
                        "normal": np.array([[1.0, 0, 0]]), "overlap": np.array([1e-6]),
                        "stiffness": np.array([[1.0e6, 0.8e6]])}  # fmt: skip
            for group, arrays in (("grains", grains), ("contacts", contacts)):
                for name, data in arrays.items():
                    step[f"{group}/{name}"] = data


def tensor(rows: dict[str, np.ndarray], name: str, row: int) -> np.ndarray:
    """Nine columns of a history as a matrix."""
    return np.array([[rows[f"{name}_{a}{b}"][row] for b in "xyz"] for a in "xyz"])


def run(case: Case) -> None:
    """Pushed, sheared, and pushed away from the middle of the branch."""
    write_packing(case.folder / "pack.h5", X, np.full((2, 3), HALF))
    states = [(0.0 * OFF, PUSH), (0.0 * OFF, SHEAR), (OFF, PUSH)]
    write_states(case.folder / "pair.h5", states)
    case.run("talus-dem", "deck.nml", "--measure=pair.h5")
    rows = {n: read_history(case.folder / f"deck_measure_{n}.csv")
            for n in ("pair", "left", "tube", "origin")}  # fmt: skip
    branch = X[1] - X[0]
    for k, name in enumerate(("pushed", "sheared", "off the middle")):
        exact = np.outer(branch, -states[k][1]) / VOLUME
        error = np.abs(tensor(rows["pair"], "stress", k) - exact).max() / np.abs(exact).max()
        case.below(f"stress, {name}", float(error), 1e-13)
    case.below("stress_xx, pushed [Pa]", tensor(rows["pair"], "stress", 0)[0, 0], -1.0, "negative")
    sheared = tensor(rows["pair"], "stress", 1)
    case.below("stress_xy, sheared [Pa]", sheared[0, 1], -1.0, "first index: the branch")
    case.metric("stress_yx, sheared [Pa]", sheared[1, 0], 0.0, 1e-9)
    # half of the box sees half of the branch; the tube, a quarter at each side of the point
    half = tensor(rows["left"], "stress", 0)[0, 0] * 0.5 * VOLUME
    case.metric("half the box / half the branch", half / (-HALF * PUSH[0]), 1.0, 1e-13)
    tube = tensor(rows["tube"], "stress", 0)[0, 0] * np.pi * 0.002**2 * 0.001
    case.metric("tube / branch inside", tube / (-0.001 * PUSH[0]), 1.0, 1e-12)
    exact = np.outer(branch, np.cross(OFF, -PUSH)) / VOLUME
    found = tensor(rows["pair"], "couple_stress", 2)
    case.below("couple stress", float(np.abs(found - exact).max() / np.abs(exact).max()), 1e-13)
    exact = np.outer(branch, np.cross(OFF + np.array([0, 0, 0.001]), -PUSH)) / VOLUME
    found = tensor(rows["origin"], "couple_stress", 2)
    error = np.abs(found - exact).max() / np.abs(exact).max()
    case.below("couple stress about an origin", float(error), 1e-13)
    fields = {kernel: judge_fields(case, kernel, states) for kernel in ("gauss", "lucy")}
    draw(case, fields)


def judge_fields(case: Case, kernel: str, states: list) -> np.ndarray:
    """Sums over the grid; component where the pair is sheared. Return xy of the middle layer."""
    with h5py.File(case.folder / f"deck_grid_{kernel}.h5") as file:
        steps = [file["steps"][name] for name in sorted(file["steps"])]
        stress = np.array([step["stress"][...] for step in steps]).reshape(3, -1, 3, 3)
        density, momentum = steps[0]["density"][...], steps[0]["momentum"][...]
    total = stress.sum(axis=1) * CELL
    exact = np.array([np.outer(X[1] - X[0], -force) for _, force in states])
    exact[2] = exact[0]
    error = np.abs(total - exact).max() / np.abs(exact).max()
    case.below(f"integral of stress, {kernel}", float(error), 1e-12)
    case.below(f"mass, {kernel}", abs(density.sum() * CELL / (2.0 * MASS) - 1.0), 1e-12)
    error = np.abs(momentum.sum(axis=0) * CELL - MASS * V.sum(axis=0)).max() / MASS
    case.below(f"momentum, {kernel}", float(error), 1e-12)
    largest = np.abs(stress[1]).max()
    turned = np.abs(stress[1, :, 1, 0]).max()
    case.below(f"yx over xy where sheared, {kernel}", float(turned / largest), 1e-13)
    case.below(
        f"largest stress_xx where pushed, {kernel} [Pa]", float(stress[0, :, 0, 0].max()), 0.0
    )
    return stress[1, :, 0, 1].reshape(32, 32, 32)[:, 16, :]


def draw(case: Case, fields: dict[str, np.ndarray]) -> None:
    """Draw the sheared pair's xy component in the plane y = 0."""
    fig, axes = case.figure(ncols=2, figsize=(9.0, 3.8))
    for ax, (kernel, layer) in zip(axes, fields.items(), strict=True):
        image = ax.imshow(1e-3 * layer, origin="lower", extent=(-8, 8, -8, 8), cmap="viridis")
        turn = np.linspace(0.0, 2.0 * np.pi, 90)
        for x in (-1.0, 1.0):
            ax.plot(x + np.cos(turn), np.sin(turn), color="white", lw=0.8)
        ax.set(xlabel="x [mm]", ylabel="z [mm]", title=f"stress_xy [kPa], {kernel}")
        ax.grid(visible=False)
        fig.colorbar(image, ax=ax)
    case.save(fig)
