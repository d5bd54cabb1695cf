"""The figures of the domains on the pages of theory: facet coupling and overlap, as SVG.

They show sets and maps in two dimensions and no computed result.
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "prepost"))

from talus.look import new_figure, plt  # noqa: E402

FREE, GHOST, EDGE = "#e3b04b", "#a9cfe8", "#4a5563"
FOLLOW, NODE, HELD = "#c0392b", "#1b4f72", "#7b7d7d"
RADIUS = 0.17  # of the grains, in edges of an element
SIZES = {"svg.hashsalt": "talus", "svg.fonttype": "path", "font.size": 11}
ALONE, OVER, LAYER, BEYOND, ROWS = 2, 2, 3, 3, 3  # columns of each region; rows of elements


def grains(x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    """Return centres and radii (n, 3) of grains that fill a box, a disturbed hexagonal pattern."""
    random = np.random.default_rng(7)
    many, rows = (round((high - low) / (2.0 * RADIUS * part))
                  for (low, high), part in ((x, 1.0), (y, 0.9)))  # fmt: skip
    step = (x[1] - x[0]) / (many + 0.5)
    found = []
    for row, level in enumerate(np.linspace(y[0] + RADIUS, y[1] - RADIUS, rows)):
        for k in range(many):
            place = x[0] + step * (k + 0.5 + 0.5 * (row % 2))
            shift = 0.1 * RADIUS * random.standard_normal(2)
            found.append([place + shift[0], level + shift[1], RADIUS * random.uniform(0.82, 0.97)])
    return np.array(found)


def discs(ax: plt.Axes, rows: np.ndarray, colour: str) -> None:
    """Draw grains."""
    for x, y, radius in rows:
        ax.add_patch(plt.Circle((x, y), radius, fc=colour, ec=EDGE, lw=0.7, zorder=2))


def elements(ax: plt.Axes, columns: range, rows: range) -> None:
    """Draw square elements."""
    for x in columns:
        for y in rows:
            ax.add_patch(plt.Rectangle((x, y), 1, 1, fc="none", ec="#8f9aa6", lw=1.1, zorder=3))


def dots(ax: plt.Axes, places: list, colour: str, mark: str) -> None:
    """Draw nodes."""
    x, y = zip(*places, strict=True)
    ax.plot(x, y, mark, ms=7.5, mfc=colour, mec="white", mew=0.8, ls="none", zorder=5)


def arrow(ax: plt.Axes, start: tuple, end: tuple, style: str = "-") -> None:
    """Draw an arrow above all else."""
    form = {"arrowstyle": "-|>", "lw": 1.8, "ls": style, "color": "#111111", "shrinkA": 0,
            "shrinkB": 3}  # fmt: skip
    ax.annotate("", end, start, arrowprops=form, zorder=6)


def said(ax: plt.Axes, place: tuple, text: str) -> None:
    """Write on a white ground."""
    ground = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "#cfd6de", "lw": 0.6}
    ax.text(*place, text, ha="center", va="center", bbox=ground, zorder=7)


def legend(ax: plt.Axes, entries: list[tuple[str, str, str]]) -> None:
    """Put what colours and marks mean below a figure: (text, colour, mark)."""
    handles = [plt.Line2D([], [], marker=mark, ls="none", ms=9, mfc=colour, mec=EDGE, label=text)
               for text, colour, mark in entries]  # fmt: skip
    ax.figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)


def bare(ax: plt.Axes) -> None:
    """Take axes and grid away."""
    ax.set_aspect("equal")
    ax.axis("off")


def overlap_domains(ax: plt.Axes) -> None:
    """Draw the regions, sets and maps of an overlap."""
    a, b, c = ALONE, ALONE + OVER, ALONE + OVER + LAYER
    end = c + BEYOND
    bare(ax)
    discs(ax, grains((0, b), (0, ROWS)), FREE)
    discs(ax, grains((b, c), (0, ROWS)), GHOST)
    elements(ax, range(a, end), range(ROWS))
    nodes = [(x, y) for x in range(a, end + 1) for y in range(ROWS + 1)]
    dots(ax, [node for node in nodes if node[0] <= b], FOLLOW, "s")
    dots(ax, [node for node in nodes if b < node[0]], NODE, "o")
    arrow(ax, (a + 0.55, 1.45), (a + 1, 2))
    said(ax, (a + 0.55, 1.42), r"$\hat{D}=P\,Q$")
    arrow(ax, (b + 2, 1), (b + 1.35, 1.45))
    arrow(ax, (b, 2), (b + 1.05, 1.6))
    said(ax, (b + 1.25, 1.42), r"$\hat{Q}=G\,D+H\,Q$")
    arrow(ax, (b + 0.9, 0.42), (b + 0.05, 0.42), "--")
    said(ax, (b + 1.6, 0.42), r"$F_{\hat{Q}}$ back by $H^T,\ G^T$")
    names = [(0, a, r"$B^{DE}$: grains alone"), (a, b, r"$\hat{B}$: free grains"),
             (b, c, r"$\tilde{B}$: ghosts"), (c, end, r"$\bar{B}$: continuum alone")]  # fmt: skip
    for left, right, text in names:
        ax.plot([left + 0.06, right - 0.06], 2 * [ROWS + 0.32], color=EDGE, lw=1.2)
        ax.text((left + right) / 2, ROWS + 0.46, text, ha="center", va="bottom", fontsize=10)
    ax.set(xlim=(-0.1, end + 0.2), ylim=(-0.2, ROWS + 0.95))


def overlap_shares(ax: plt.Axes) -> None:
    """Draw who owns the energy: shares of contacts and of elements across the regions."""
    b, c = ALONE + OVER, ALONE + OVER + LAYER
    inner, end = c - 2 * RADIUS, c + BEYOND
    ax.plot([0, b, b, inner, end], [1, 1, 1, 0, 0], color="#b9770e", label="contacts, $w_c$")
    ax.plot([0, b, inner, end], [0, 0, 1, 1], color=NODE, label=r"elements, $\beta_q$")
    ax.set(xlim=(-0.1, end + 0.2), xticks=[], yticks=[0, 1], ylabel="share [-]")
    ax.legend(loc="center left", fontsize=9, bbox_to_anchor=(0.02, 0.5))


def overlap_figure() -> plt.Figure:
    """Return the figure of an overlap."""
    fig, axes = new_figure(nrows=2, figsize=(9.4, 5.6), height_ratios=[4.2, 1])
    overlap_domains(axes[0])
    overlap_shares(axes[1])
    legend(axes[1], [("free grains $Q$", FREE, "o"), (r"ghosts $\hat{Q}$", GHOST, "o"),
                     (r"prescribed nodes $\hat{D}$", FOLLOW, "s"),
                     ("free nodes $D$", NODE, "o")])  # fmt: skip
    return fig


def facets_figure() -> plt.Figure:
    """Return the figure of facet coupling."""
    fig, ax = new_figure(figsize=(8.2, 5.0))
    bare(ax)
    wide, deep = 6, 2
    elements(ax, range(wide), range(-deep, 0))
    for x in np.linspace(RADIUS, wide - RADIUS, 17):
        discs(ax, np.array([[x, 0.0, 0.95 * RADIUS]]), GHOST)
    discs(ax, grains((0, wide), (0.8 * RADIUS, 1.7)), FREE)
    ax.plot([0, wide], [0, 0], color=NODE, lw=2.5, zorder=4)
    dots(ax, [(x, y) for x in range(wide + 1) for y in range(-deep + 1, 1)], NODE, "o")
    dots(ax, [(x, -deep) for x in range(wide + 1)], HELD, "^")
    arrow(ax, (1.52, -0.8), (1.52, 0.03))
    said(ax, (1.52, -0.9), r"motion: $\mathbf{x}_g=\sum N_a\,\mathbf{x}_a$")
    arrow(ax, (3.9, 0.0), (3.9, -0.8), "--")
    said(ax, (3.9, -0.95), r"force: $\mathbf{f}_a=\sum N_a\,\mathbf{P}_g$")
    said(ax, (5.35, 1.4), "talus-dem")
    said(ax, (5.45, -1.5), "talus-fem")
    ax.set(xlim=(-0.3, wide + 0.3), ylim=(-deep - 0.35, 1.8))
    legend(ax, [("free grains $Q$", FREE, "o"), ("free nodes $D$", NODE, "o"),
                ("facets", NODE, "_"), (r"ghosts $\hat{Q}$, centres on facets", GHOST, "o"),
                ("nodes held by supports", HELD, "^")])  # fmt: skip
    return fig


def write(folder: Path, ending: str = "svg") -> list[Path]:
    """Write both figures into a folder; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in (("facets", facets_figure), ("overlap", overlap_figure)):
        with plt.rc_context(SIZES):
            fig = draw()
            paths.append(folder / f"domains-{name}.{ending}")
            date = {"metadata": {"Date": None}} if ending == "svg" else {}
            fig.savefig(paths[-1], **date)
            plt.close(fig)
    return paths
