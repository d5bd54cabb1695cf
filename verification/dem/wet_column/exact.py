"""A column of wet spheres whose sides are taken away, against Rumpf's strength."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, field_steps, read_history, write_packing

RADIUS, DENSITY, GRAVITY, VOLUME = 1.0e-3, 2650.0, 9.81, 1.0e-12
SIDE, LAYERS = 7, 15  # spheres along the sides of the box, and of the cloud
WIDE = 2.0 * RADIUS * (SIDE + 0.3)
PHI = np.arctan(0.5)  # the friction of the contacts
RATIOS = (0.0, 1.0 / 3.0, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0)  # strength over the stress at the foot
SHOWN = (0.0, 0.7, 3.0)
BAND = 3.0  # the estimate holds within this factor
STANDS, FALLS = 0.95, 0.8  # height left, of that at the start


def settled(case: Case) -> dict[str, np.ndarray]:
    """Settle a cloud in the box; return the grains."""
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE), np.arange(LAYERS),
                                indexing="ij"), -1).reshape(-1, 3)  # fmt: skip
    x = RADIUS * (1.15 + 2.04 * grid + rng.uniform(-0.02, 0.02, grid.shape))
    v = rng.normal(scale=0.1, size=x.shape)
    write_packing(case.folder / "cloud.h5", x, np.full(x.shape, RADIUS), v=v)
    text = (case.folder / "settle.nml").read_text().replace("WIDE", f"{WIDE:.9e}")
    (case.folder / "settle_run.nml").write_text(text)
    case.run("talus-dem", "settle_run.nml")
    return field_steps(case.folder / "settle_run.h5")[-1].grains


def height(z: np.ndarray) -> float:
    """Return the height below which 95 of 100 grains are [m]."""
    return float(np.quantile(z, 0.95)) + RADIUS


def strength_of(grains: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return unconfined strength over surface tension [1/m], and the stress at the foot [Pa]."""
    x = grains["x"]
    high = height(x[:, 2])
    inside = x[(x[:, 2] > 0.1 * high) & (x[:, 2] < 0.9 * high)]
    share = len(inside) * 4.0 / 3.0 * np.pi * RADIUS**3 / (WIDE**2 * 0.8 * high)
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    contacts = ((apart > 0.0) & (apart < 2.0 * RADIUS)).sum(1).mean()
    tensile = share * contacts * 2.0 * np.pi * RADIUS / (np.pi * 4.0 * RADIUS**2)  # Rumpf
    unconfined = 2.0 * tensile * np.tan(PHI) * np.tan(np.pi / 4.0 + PHI / 2.0)
    return unconfined, share * DENSITY * GRAVITY * high


def stood(case: Case, name: str, tension: float) -> np.ndarray:
    """Take the sides away; return the places of the grains at the end."""
    wet = f", cohesion = 'capillary', surface_tension = {tension:.9e}, bridge_volume = {VOLUME}"
    text = (case.folder / "stand.nml").read_text()
    (case.folder / f"{name}.nml").write_text(text.replace("COHESION", wet if tension else ""))
    case.run("talus-dem", f"{name}.nml")
    rows = read_history(case.folder / f"{name}_energy.csv")
    case.below(f"{name}: ledger", float(rows["relative_closure"].max()), 1e-3)
    if tension:
        rows = read_history(case.folder / f"{name}_liquid.csv")
        case.below(f"{name}: drawn - returned - held, over drawn",
                   max_of(abs(rows["balance"])) / rows["drawn"][-1], 1e-12)  # fmt: skip
    return field_steps(case.folder / f"{name}.h5")[-1].grains["x"]


def run(case: Case) -> None:
    """Judge columns from dry to strong; plot three of them, and the height that is left of all."""
    grains = settled(case)
    write_packing(case.folder / "settled.h5", grains["x"], np.full(grains["x"].shape, RADIUS))
    unconfined, foot = strength_of(grains)
    high = height(grains["x"][:, 2])
    fig, axes = case.figure(ncols=4, figsize=(13.0, 4.0))
    left = []
    for ratio in RATIOS:
        name = f"ratio_{ratio:.2f}".replace(".", "_")
        x = stood(case, name, ratio * foot / unconfined)
        left.append(height(x[:, 2]) / high)
        if ratio in SHOWN:
            ax = axes[SHOWN.index(ratio)]
            ax.plot((x[:, 0] - WIDE / 2) * 1e3, x[:, 2] * 1e3, "o", ms=3)
            ax.set(xlabel="x [mm]", ylabel="z [mm]", title=f"{ratio:.2f}", xlim=(-30, 30),
                   ylim=(0, 35))  # fmt: skip
            ax.set_aspect("equal")
    for ratio, part in zip(RATIOS, left, strict=True):
        if ratio <= 1.0 / BAND:
            case.below(f"strength / stress {ratio:.2f}: height left", part, FALLS)
        elif ratio >= BAND:
            case.above(f"strength / stress {ratio:.2f}: height left", part, STANDS)
    least = RATIOS[next(k for k in range(len(left)) if min(left[k:]) > STANDS)]
    case.below("least strength / stress that stands", least, BAND, "of those that were run")
    axes[3].axvspan(1.0 / BAND, BAND, alpha=0.15)
    axes[3].plot(RATIOS, left, "o-")
    axes[3].set(xlabel="strength / stress at the foot [-]", ylabel="height left [-]")
    case.save(fig)
