"""The common style of all plots: exact = line, Talus = marks, version stamped in the corner."""

import io
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter  # noqa: E402

from talus import version  # noqa: E402
from talus.faults import FaultError  # noqa: E402
from talus.files import make_folder, replaced  # noqa: E402

COLOURS = ["#1b4f72", "#c0392b", "#1e8449", "#b9770e", "#6c3483", "#00a3a3", "#7b7d7d", "#a04000"]
SETTINGS = {
    "figure.figsize": (6.4, 4.2),
    "figure.dpi": 110,
    "savefig.dpi": 150,
    "font.size": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": matplotlib.cycler(color=COLOURS),
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "lines.linewidth": 1.5,
}
plt.rcParams.update(SETTINGS)


def new_figure(**options: object) -> tuple:
    """Return (fig, ax or axes); options go to matplotlib's subplots."""
    return plt.subplots(layout="constrained", **options)


def plain_ticks(fig: object) -> None:
    """Put 1, 2, 5, 10, ... on logarithmic axes that span less than two decades."""
    for axes in fig.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            if axis.get_scale() != "log" or not 0.0 < low < high < 100.0 * low:
                continue
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())


def stamp(fig: object) -> None:
    """Give the ticks their last form; write the version into the corner."""
    plain_ticks(fig)
    fig.text(
        0.995, 0.005, f"Talus {version()}", ha="right", va="bottom", fontsize=6, color="#888888"
    )


def save_figure(fig: object, path: Path) -> None:
    """Stamp the version, save in the form of the name's ending and close."""
    stamp(fig)
    path = Path(path)
    known = fig.canvas.get_supported_filetypes()
    if path.suffix.lstrip(".") not in known:
        plt.close(fig)
        raise FaultError("E554", f"no figure can be written as '{path.name}'", "end it with .png")
    make_folder(path.parent)
    with replaced(path) as temporary:
        fig.savefig(temporary)
    plt.close(fig)


def figure_bytes(fig: object) -> bytes:
    """Stamp the version, return the PNG and close."""
    stamp(fig)
    data = io.BytesIO()
    fig.savefig(data, format="png")
    plt.close(fig)
    return data.getvalue()
