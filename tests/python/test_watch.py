"""`talus watch`: the page, progress, curves and last frame of a run, on loopback only."""

import http.client
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import cli, watch_data

LOG = """talus-dem 0.2.0, git x
A bed

  date                    {date}
Deck as understood
  &run
    t_end            = 2.0  [s]
  /
"""
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2] / "prepost")}
END = "talus-dem: finished, exit 0, wall 2.7834 s, time 2.0 s, 10 steps\n"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return the folder of a run that has done a quarter in ten seconds."""
    begun = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(time.time() - 10.0))
    (tmp_path / "bed.log").write_text(LOG.format(date=begun))
    rows = "".join(f"{t},{t * t}\n" for t in np.linspace(0.0, 0.5, 1001))
    (tmp_path / "bed_energy.csv").write_text("time [s],kinetic [J]\n" + rows + "0.50")
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n")
    with h5py.File(tmp_path / "bed.h5", "w") as file:
        group = file.create_group("steps/000000")
        group.attrs["time"] = 0.5
        grains = {"id": [2, 1], "kind": [0, 0], "x": [[0, 0, 2.0], [0, 0, 1.0]],
                  "quat": [[1.0, 0, 0, 0]] * 2, "axes": [[0.5] * 3] * 2,
                  "v": [[3.0, 4.0, 0], [0, 0, 0]]}  # fmt: skip
        for name, data in grains.items():
            group[f"grains/{name}"] = np.asarray(data)
    return tmp_path


def hear_interrupts() -> None:
    """Ctrl-C counts, also where the tests run in the background of a shell that ignores it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def served(run: Path) -> Iterator[tuple[int, subprocess.Popen]]:
    """Start the command on a port of its own; return port and process."""
    words = [sys.executable, "-m", "talus", "watch", str(run)]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT,
        preexec_fn=hear_interrupts,
    )  # fmt: skip
    line = process.stdout.readline()
    assert line.startswith("http://127.0.0.1:")
    yield int(line.split(":")[2].split("/")[0]), process
    process.kill()
    process.communicate()


def ask(port: int, path: str, host: str = "") -> tuple[int, str]:
    """Return status and text of an answer."""
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request("GET", path, headers={"Host": host} if host else {})
    reply = link.getresponse()
    return reply.status, reply.read().decode()


def test_page_and_data(run: Path, served: tuple[int, subprocess.Popen]) -> None:
    """Page, progress, curve and frame are those of the folder; Ctrl-C ends it cleanly."""
    port, process = served
    status, page = ask(port, "/")
    assert status == 200 and "<canvas" in page and "http" not in page and "@STAMP@" not in page
    state = json.loads(ask(port, "/state.json")[1])
    (one,) = state["runs"]
    assert one["program"] == "talus-dem" and one["state"] == "running"
    assert one["time"] == 0.5 and one["t_end"] == 2.0
    assert 29.0 < one["left"] < 60.0  # three quarters are left of a run at 10 s a quarter
    assert state["tables"] == ["bed_energy.csv"]
    curve = json.loads(ask(port, "/curve.json?file=bed_energy.csv")[1])
    assert len(curve["columns"]["time"]) == watch_data.MOST_POINTS
    assert curve["columns"]["kinetic"][-1] == 0.25 and curve["units"]["kinetic"] == "J"
    frame = json.loads(ask(port, "/frame.json")[1])
    assert frame["time"] == 0.5 and frame["x"][1] == [0.0, 0.0, 2.0]
    assert frame["value"] == [0.0, 5.0] and frame["size"] == [0.5, 0.5]
    with (run / "bed.log").open("a") as log:
        log.write(END)
    (one,) = json.loads(ask(port, "/state.json")[1])["runs"]
    assert one["state"].startswith("finished, exit 0") and one["left"] is None
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=10)
    assert process.returncode == 0 and "ended" in out and not err


def test_refused(served: tuple[int, subprocess.Popen]) -> None:
    """Files that are no histories, other paths and other hosts' names are refused."""
    port, _ = served
    assert ask(port, "/curve.json?file=notes.csv")[0] == 404
    assert ask(port, "/curve.json?file=../bed_energy.csv")[0] == 404
    assert ask(port, "/bed.log")[0] == 404
    assert ask(port, "/state.json", "example.org")[0] == 403
    assert cli.main(["watch", os.fspath(Path(__file__).parent)]) == 1


def test_port_taken(
    run: Path, served: tuple[int, subprocess.Popen], capsys: pytest.CaptureFixture[str]
) -> None:
    """A port that is in use is E634, a number that is no port too."""
    for port in (served[0], 70000):
        assert cli.main(["watch", str(run), "--port", str(port)]) == 1
        assert "error E634" in capsys.readouterr().err


def test_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder without a log of a program is E633."""
    (tmp_path / "other.log").write_text("something else\n")
    assert cli.main(["watch", str(tmp_path)]) == 1
    assert "error E633" in capsys.readouterr().err


def test_damaged_frame(run: Path) -> None:
    """A field file that is being written is passed over, not a fault."""
    (run / "bed.h5").write_bytes((run / "bed.h5").read_bytes()[:700])
    assert watch_data.frame(run) is None


def test_grains_of_a_coupled_run(run: Path) -> None:
    """Grains are shown beside a solid of the same moment, the solid where they are an old run's."""
    with h5py.File(run / "solid.h5", "w") as file:
        file["mesh/x"] = np.eye(3)
        group = file.create_group("steps/000000")
        group.attrs["time"] = 0.5
        group["solid/u"] = np.zeros((3, 3))
    now = time.time()
    os.utime(run / "solid.h5", (now, now))
    for age, name in ((5.0, "bed.h5"), (500.0, "solid.h5")):
        os.utime(run / "bed.h5", (now - age, now - age))
        assert watch_data.frame(run)["file"] == name
