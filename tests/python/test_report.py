"""Reports: lights tell why and what to do, tables are folded, several runs are compared."""

import html
import json
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import cli, lights, report_compare, report_log, reports
from talus.faults import FaultError

GOOD = {"program": "talus-dem", "version": "1", "deck": "run.nml", "exit_code": 0, "steps": 100,
        "wall_time_s": 2.0, "health": {"verdict": "green", "notes": "", "max_overlap": 0.01},
        "errors": []}  # fmt: skip
NOTE = "health amber: the energy error 0.0866, limit 0.0100"
FAULT = {"code": "N001", "message": "it flew", "place": "run.nml", "hint": "a smaller dt"}
LEDGER = "time [s],kinetic [J],friction [J]\n0.0,0.0,0.0\n0.1,{0},1.0\n"


def write_run(folder: Path, kinetic: float = 1.0, **changes: object) -> Path:
    """Write a summary and a ledger into a folder."""
    folder.mkdir()
    (folder / "run_summary.json").write_text(json.dumps(GOOD | changes))
    (folder / "run_energy.csv").write_text(LEDGER.format(kinetic))
    return folder


@pytest.mark.parametrize(
    "changes, colour, why, cure",
    [
        ({}, "green", "within its limits", ""),
        ({"health": {}}, "green", "judges no figures", ""),
        ({"health": {"verdict": "amber", "notes": NOTE}}, "amber", "The energy error 0.0866",
         "smaller dt"),
        ({"health": {"verdict": "red", "notes": NOTE.replace("amber", "red")},
          "exit_code": 2, "errors": [FAULT]}, "red", "N001: it flew", "talus explain N001"),
        ({"exit_code": 2, "errors": [FAULT]}, "red", "It came to its end", "a smaller dt"),
        ({"exit_code": 2, "errors": [FAULT | {"code": "N202"}]}, "red", "It did not finish", ""),
        ({"exit_code": 3}, "amber", "stopped early", "--restart=auto"),
        ({"exit_code": 5}, "red", "bug", ""),
        ({"exit_code": None}, "red", "unknown end", ""),
    ],
)  # fmt: skip
def test_lights(changes: dict, colour: str, why: str, cure: str) -> None:
    """Colour, reason and remedy follow from the summary."""
    light = lights.light_of(GOOD | changes)
    assert light.colour == colour
    assert why in " ".join(light.why) and cure in " ".join(light.cure)


DEEP = "health amber: the largest overlap over the least semi-axis 0.16, limit 0.1"


@pytest.mark.parametrize(
    "overlaps, when, cure",
    [([0.16, 0.16, 0.16, 0.16], "reached from the start", "move them apart"),
     ([0.0, 0.01, 0.03, 0.16], "reached by 0.3 s", "stiffer grains")],
)  # fmt: skip
def test_deep_when(overlaps: list, when: str, cure: str, tmp_path: Path) -> None:
    """A deep overlap from the start is one of geometry, a later one of loads."""
    run = write_run(tmp_path / "a", health={"verdict": "amber", "notes": DEEP})
    rows = "".join(f"0.{k},{value}\n" for k, value in enumerate(overlaps))
    (run / "run_energy.csv").write_text(f"time [s],max_overlap [-]\n{rows}")
    light = reports.runs_of(run)[0].light
    assert when in " ".join(light.why) and cure in " ".join(light.cure)


def test_partner(tmp_path: Path) -> None:
    """The energy of a partner is first a matter of the exchange, that of a run alone of its dt."""
    run = write_run(tmp_path / "a", time_s=0.2, health={"verdict": "red", "notes": NOTE})
    assert "exchange" not in " ".join(reports.runs_of(run)[0].light.cure)
    pair = GOOD | {"program": "talus-couple", "time_s": 0.2}
    (run / "coupled_summary.json").write_text(json.dumps(pair))
    coupled, grains = reports.runs_of(run)
    assert "exchange" in " ".join(grains.light.cure) and not coupled.light.cure


def test_notes_of_the_programs_have_cures() -> None:
    """Every figure that a program judges has a remedy here."""
    root = Path(__file__).parents[2]
    files = ("dem/run/dem_judgement.f90", "fem/run/fem_judgement.f90",
             "couple/methods/cpl_judgement.f90")  # fmt: skip
    text = "".join((root / name).read_text() for name in files)
    assert all(words in text for words, _ in lights.CURES)
    assert text.count("%judge(") == 8  # a new figure needs a remedy in lights.CURES


def test_order_of_the_page(tmp_path: Path) -> None:
    """Figures come first, then the lights, then folded tables."""
    notes = {"verdict": "amber", "notes": NOTE}
    page = reports.build(write_run(tmp_path / "one", health=notes), "")
    places = [page.index(text) for text in ("<figure>", '<h2 id="health">', "<details>", "<table>")]
    assert places == sorted(places)
    assert page.index("Look at the notes") < places[0]
    assert "What to do: Take a smaller dt" in page


def test_compare(tmp_path: Path) -> None:
    """Several runs: one figure of the ledgers, a light a run, ratios of numbers that differ."""
    one, two = write_run(tmp_path / "one"), write_run(tmp_path / "two", 2.0, steps=250)
    target = tmp_path / "page.html"
    assert cli.main(["report", str(one), str(two), "-o", str(target)]) == 0
    page = target.read_text()
    assert "<b>250</b> (× 2.5)" in page and "one: run" in page and "two: run" in page
    assert page.count("<figure>") == 1
    fig = report_compare.energies({"one": one, "two": two})
    lines = {line.get_label(): line.get_ydata()[-1] for line in fig.axes[0].lines}
    assert lines == {"one": 1.0, "two": 2.0}


def test_compare_faults(tmp_path: Path) -> None:
    """A folder twice is E604, one without summaries E553."""
    one = write_run(tmp_path / "one")
    with pytest.raises(FaultError) as fault:
        report_compare.build([one, one], "")
    assert fault.value.code == "E604"
    (tmp_path / "none").mkdir()
    with pytest.raises(FaultError) as fault:
        report_compare.build([one, tmp_path / "none"], "")
    assert fault.value.code == "E553"


LOG = ["header", "warning: the step is long", "rows <1>", "error N001: it flew", "health: amber",
       "talus-dem: stopped"]  # fmt: skip


def test_log_in_the_page(tmp_path: Path) -> None:
    """The log is folded, its lines have anchors, and the light links to those that matter."""
    run = write_run(tmp_path / "a", exit_code=2, errors=[FAULT])
    (run / "run.log").write_text("\n".join(LOG) + "\n")
    page = reports.build(run, "")
    links = re.findall(r'<a href="#(log-run-\d+)">([^<]+)</a>', page)
    assert links == [("log-run-5", "health, line 5"), ("log-run-2", "warning, line 2"),
                     ("log-run-4", "error N001, line 4"), ("log-run-6", "end, line 6")]  # fmt: skip
    log = page.split('<details class="log" id="log-run">')[1].split("</details>")[0]
    assert re.findall(r'id="(log-run-\d+)"', log) == [f"log-run-{k}" for k in range(1, 7)]
    assert "rows &lt;1&gt;" in log and page.index("Numbers</h2>") < page.index("Logs</h2>")


def test_long_log(tmp_path: Path) -> None:
    """Of a long log both ends are kept, and no link leads to a line that is left out."""
    most = report_log.MOST_LINES
    lines = [f"warning: {k}" for k in range(1, 3 * most + 1)]
    (tmp_path / "run.log").write_text("\n".join(lines))
    log = report_log.read(tmp_path, "run")
    text = report_log.folded(log)
    kept = set(re.findall(r'id="(log-run-\d+)"', text))
    assert len(kept) == most and f"{2 * most} lines are left out" in text
    assert set(re.findall(r'href="#(log-run-\d+)"', report_log.links(log))) <= kept
    assert report_log.read(tmp_path, "none") is None and report_log.links(None) == ""


def test_view_in_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A small view stands in the page, of a large one its size and the command."""
    run = write_run(tmp_path / "a")
    shutil.copy(grains_file(tmp_path), run / "run.h5")
    with h5py.File(run / "run_grid_map.h5", "w") as file:  # no grains and no solid
        file.attrs["format"] = "talus-grid"
        file.create_group("steps")
    page = reports.build(run, "")
    inside = html.unescape(re.search(r'srcdoc="([^"]+)"', page)[1])
    assert "<canvas" in inside and inside.rstrip().endswith("</html>")
    monkeypatch.setattr(reports, "VIEW_LIMIT", 1000)
    page = reports.build(run, "")
    assert "<iframe" not in page and "is not in this page (limit 0 MB): talus view" in page


def grains_file(folder: Path) -> Path:
    """Write fields of two grains at two times."""
    path = folder / "grains.h5"
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "talus-grains"
        for k in range(2):
            step = file.create_group(f"steps/{k:06d}")
            step.attrs.update(time=0.1 * k, count=2, complete=1)
            x = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.1 * k]])
            values = {"id": np.array([1, 2]), "x": x, "kind": np.zeros(2, "i4"),
                      "axes": np.full((2, 3), 0.005), "v": np.zeros((2, 3)),
                      "omega": np.zeros((2, 3)), "quat": np.eye(4)[[0, 0]]}  # fmt: skip
            for name, value in values.items():
                step[f"grains/{name}"] = value
    return path
