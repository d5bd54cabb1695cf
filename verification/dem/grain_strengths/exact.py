"""A thousand grains between two plates: distribution of strengths, effect of their size."""

import numpy as np

from talus.compare import max_of
from talus.verification import Case, read_history, write_packing

STRENGTH, SIZE, MODULUS, DENSITY, YOUNG = 40.0e6, 2.0e-3, 3.0, 2650.0, 70.0e9
STEPS = 16000


def crush(case: Case, name: str, size: float, count: int) -> dict[str, np.ndarray]:
    """Crush grains of a size side by side; return their rows in the order of ids."""
    side = int(np.ceil(np.sqrt(count)))
    k = np.arange(count)
    x = 1.05 * size * np.column_stack([k % side, k // side, np.zeros(count)])
    x[:, 2] = 0.5 * size
    write_packing(case.folder / "pack.h5", x, np.full((count, 3), 0.5 * size))
    modulus = YOUNG / (2.0 * (1.0 - 0.25**2))
    most = STRENGTH * (size / SIZE) ** -1.0 * np.log(1e5) ** (1.0 / MODULUS)
    overlap = (most * size**2 / (4.0 / 3.0 * modulus * np.sqrt(0.5 * size))) ** (2.0 / 3.0)
    mass = DENSITY * np.pi / 6.0 * size**3
    stiffness = 2.0 * modulus * np.sqrt(0.5 * size * overlap)
    step = 0.1 * 2.0 / np.sqrt(4.0 * stiffness / mass)
    words = {"T_END": STEPS * step, "HEIGHT": size, "SPEED": 2.0 * overlap / (STEPS * step),
             "STEP": step}  # fmt: skip
    text = (case.folder / "deck.nml").read_text()
    for word, value in words.items():
        text = text.replace(word, f"{value:.8e}")
    (case.folder / f"{name}.nml").write_text(text)
    case.run("talus-dem", f"{name}.nml", "--threads=1")
    rows = read_history(case.folder / f"{name}_broken.csv")
    order = np.argsort(rows["id"])
    return {key: values[order] for key, values in rows.items()}


def distance(values: np.ndarray) -> float:
    """Return the Kolmogorov-Smirnov distance of strengths over that of 37 % to Weibull's law."""
    ordered = np.sort(values)
    law = 1.0 - np.exp(-(ordered**MODULUS))
    n = len(ordered)
    return float(
        max(np.abs(law - np.arange(n) / n).max(), np.abs(law - np.arange(1, n + 1) / n).max())
    )


def run(case: Case) -> None:
    """Crush a thousand grains of 2 mm and a hundred each of 1 and 4 mm."""
    many = crush(case, "many", SIZE, 1000)
    case.metric("grains of a thousand that broke", len(many["id"]), 1000.0, 0.0)
    found = many["stress"] / STRENGTH
    limit = 1.36 / np.sqrt(1000)
    case.below("Kolmogorov-Smirnov distance to Weibull's law", distance(found), limit,
               "5 % of fair samples lie beyond")  # fmt: skip
    case.below("stress at the break over the own strength, less 1",
               max_of(many["stress"] / many["strength"]) - 1.0, 1e-3)  # fmt: skip
    sizes = {"small": 0.5 * SIZE, "large": 2.0 * SIZE}
    others = {name: crush(case, name, size, 100) for name, size in sizes.items()}
    for name, size in sizes.items():
        ratio = others[name]["strength"] / many["strength"][:100]
        case.metric(f"strength of grains of {size * 1e3:g} mm over that of the same id of 2 mm, "
                    "times the diameters", max_of(np.abs(ratio * size / SIZE - 1.0)) + 1.0, 1.0,
                    1e-12)  # fmt: skip
        ratio = others[name]["stress"].mean() / many["stress"][:100].mean()
        case.metric(f"mean stress at the break, {size * 1e3:g} mm over 2 mm", ratio * size / SIZE,
                    1.0, 1e-3)  # fmt: skip
    fig, (ax, ax2) = case.figure(ncols=2, figsize=(9.5, 4.0))
    line = np.linspace(0.0, 2.2, 200)
    ax.plot(line, np.exp(-(line**MODULUS)), "k-", label="Weibull, m = 3")
    ordered = np.sort(found)
    ax.plot(ordered[::10], 1.0 - (np.arange(1000)[::10] + 0.5) / 1000, "o", ms=4, label="Talus")
    ax.set(xlabel="stress at the break / $\\sigma_0$ [-]", ylabel="part that survives [-]")
    ax.legend()
    at = np.array([0.5 * SIZE, SIZE, 2.0 * SIZE]) * 1e3
    means = [others["small"]["stress"].mean(), many["stress"][:100].mean(),
             others["large"]["stress"].mean()]  # fmt: skip
    ax2.loglog(at, means[1] / 1e6 * (SIZE * 1e3 / at), "k-", label="d$^{-1}$")
    ax2.loglog(at, np.array(means) / 1e6, "o", label="mean of a hundred ids")
    ax2.set(xlabel="diameter [mm]", ylabel="stress at the break [MPa]")
    ax2.legend()
    case.save(fig)
