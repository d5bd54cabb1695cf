"""Figures of sources, sinks, windows and conversions show the sums of their histories."""

from pathlib import Path

import numpy as np
import pytest

from talus import cli, flow_plots, gallery
from talus.faults import FaultError

SOURCES = """time [s],source [-],grains [-],mass [kg],energy [J],waits [-]
0.0,1,0,0.0,0.0,0
0.0,2,0,0.0,0.0,0
0.5,1,3,0.3,1.5,0
0.5,2,4,0.1,0.5,0
"""
SINKS = """time [s],sink [-],grains [-],mass [kg],energy [J]
0.0,1,0,0.0,0.0
0.5,1,2,0.2,7.0
"""
WINDOW = """time [s],rear [-],front [-],place [m],entered [-],left [-],moved [m]
0.0,0,4,0.1,0,0,0.0
0.5,1,5,0.2,400,390,0.001
"""
CONVERSIONS = """time [s],opened [-],without [-],ghosts [-],woken [-],freed [-],left [-],awake [-],\
kinetic [J],elastic [J],largest_hold [N],momentum [kg m/s]
0.0,27,1,98,0,0,0,2332,0.0,0.0,0.0,0.0
0.5,32,1,114,436,100,0,2768,1e-3,2e-3,0.5,-1e-9
1.0,36,1,114,80,87,0,2848,1e-3,2e-3,0.5,1e-9
""".replace("\\\n", "")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of histories of one run."""
    for name, text in (("sources", SOURCES), ("sinks", SINKS), ("window", WINDOW),
                       ("conversions", CONVERSIONS)):  # fmt: skip
        (tmp_path / f"run_{name}.csv").write_text(text)
    return tmp_path


def curves(fig: object) -> dict[str, np.ndarray]:
    """Return the curves of a figure by their labels, the last panel first."""
    return {line.get_label(): line.get_ydata() for ax in fig.axes for line in ax.lines}


def test_totals(folder: Path) -> None:
    """Sources are added time by time."""
    rows = flow_plots.totals(folder / "run_sources.csv")
    assert rows["time"].tolist() == [0.0, 0.5]
    assert rows["grains"].tolist() == [0.0, 7.0]
    assert np.allclose(rows["mass"], [0.0, 0.4]) and np.allclose(rows["energy"], [0.0, 2.0])


@pytest.mark.parametrize("name", ["sources", "sinks"])
def test_through(folder: Path, name: str) -> None:
    """Either history draws both."""
    found = curves(flow_plots.through(folder / f"run_{name}.csv"))
    assert found["entered"].tolist() == [0.0, 2.0] and found["left"].tolist() == [0.0, 7.0]


def test_window(folder: Path) -> None:
    """Grains in the window and its travel in mm."""
    found = curves(flow_plots.window(folder / "run_window.csv"))
    assert found["difference"].tolist() == [0.0, 10.0]
    assert np.allclose(found["body, from copy 0"], [100.0, 200.0])


def test_conversions(folder: Path) -> None:
    """Energies add up; momenta are drawn by their size."""
    found = curves(flow_plots.conversions(folder / "run_conversions.csv"))
    assert np.allclose(found["elastic"], [0.0, 2.0e-3, 4.0e-3])
    assert np.allclose(found["momentum [kg m/s]"], [0.0, 1.0e-9, 1.0e-9])


def test_gallery(folder: Path) -> None:
    """A folder has one figure of sources and sinks together; sinks alone have theirs."""
    names = [one.name for one in gallery.exhibits(folder)]
    assert names == ["run_conversions.png", "run_window.png", "run_sources.png"]
    (folder / "run_sources.csv").unlink()
    assert "run_sinks.png" in [one.name for one in gallery.exhibits(folder)]


def test_command(folder: Path) -> None:
    """The command draws each kind; another history is E603."""
    target = folder / "a.png"
    assert cli.main(["plot", "flow", str(folder / "run_sinks.csv"), "-o", str(target)]) == 0
    assert target.stat().st_size > 10_000
    with pytest.raises(FaultError) as fault:
        flow_plots.through(folder / "run_window.csv")
    assert fault.value.code == "E603"
