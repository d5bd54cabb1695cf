"""What a running job has written so far: progress of its programs, histories, last frame."""

import re
import time
from pathlib import Path

import numpy as np

from talus import histories
from talus.faults import FaultError
from talus.fields import FieldFile, has_steps

MOST_POINTS, MOST_GRAINS = 400, 20000
TOGETHER = 30.0  # s between writings of the partners of a coupled run
HEAD_BYTES = 65536  # of a log: it has the deck as understood
T_END = re.compile(r"^\s+t_end\s+= *([-+.\deE]+)", flags=re.M)
DATE = re.compile(r"^\s+date\s+(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)", flags=re.M)
DONE = re.compile(r"^talus-\w+: (.*exit (\d+).*)$", flags=re.M)


def logs(folder: Path) -> list[Path]:
    """Return the logs of programs in a folder, oldest first."""
    found = [path for path in folder.glob("*.log") if head(path).startswith("talus-")]
    return sorted(found, key=lambda path: (path.stat().st_mtime, path.name))


def head(path: Path) -> str:
    """Return the first part of a log."""
    with path.open("rb") as file:
        return file.read(HEAD_BYTES).decode("utf-8", "replace")


def tail(path: Path) -> str:
    """Return the last part of a log."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 4096))
        return file.read().decode("utf-8", "replace")


def tables(folder: Path) -> list[str]:
    """Return the names of the histories of a folder."""
    names = []
    for path in sorted(folder.glob("*.csv")):
        with path.open("rb") as file:
            if file.read(10).startswith(b"time [s]"):
                names.append(path.name)
    return names


def reached(folder: Path, stem: str) -> tuple[float, float] | None:
    """Return the first and the last time [s] in the histories of a deck."""
    for name in tables(folder):
        if name.startswith(f"{stem}_"):
            try:
                times = histories.read(folder / name).columns["time"]
            except FaultError:
                continue
            if len(times):
                return float(times[0]), float(times[-1])
    return None


def progress(folder: Path, log: Path) -> dict:
    """Return program, state, time reached, end and time left [s] of one program."""
    start, end = head(log), tail(log)
    found: dict = {"name": log.stem, "program": start.split(",")[0].split(" ")[0]}
    wanted, date, done = T_END.search(start), DATE.search(start), DONE.search(end)
    found["t_end"] = float(wanted[1]) if wanted else None
    times = reached(folder, log.stem)
    found["time"] = times[1] if times else 0.0
    found["state"] = done[1] if done else "running"
    found["left"] = None
    if done or not (times and wanted and date) or times[1] <= times[0]:
        return found
    spent = time.time() - time.mktime(time.strptime(date[1], "%Y-%m-%d %H:%M:%S"))
    found["left"] = max(0.0, spent * (found["t_end"] - times[1]) / (times[1] - times[0]))
    return found


def curve(folder: Path, name: str) -> dict:
    """Return the columns of a history with their units, thinned to some hundred rows."""
    history = histories.read(folder / name)
    rows = len(history.columns["time"])
    some = np.unique(np.linspace(0, max(rows - 1, 0), min(rows, MOST_POINTS)).astype(int))
    columns = {
        title: [float(v) if np.isfinite(v) else None for v in values[some]]
        for title, values in history.columns.items()
    }
    return {"columns": columns, "units": history.units}


def frame(folder: Path) -> dict | None:
    """Return the last step: of grains centres, sizes and speeds, of a solid its nodes, moved.

    Of a coupled run the grains, which write at the same times as the solid.
    """
    first: dict | None = None
    newest = 0.0
    for path in sorted(folder.glob("*.h5"), key=lambda p: -p.stat().st_mtime):
        written = path.stat().st_mtime
        if first and written < newest - TOGETHER:
            break
        try:
            found = frame_of(path) if has_steps(path) else None
        except (FaultError, OSError):  # it is being written
            continue
        if found and found["what"].startswith("speed"):
            return found
        if found and first is None:
            first, newest = found, written
    return first


def frame_of(path: Path) -> dict | None:
    """Return the last step of a field file, or None where nothing is in it."""
    with FieldFile(path) as fields:
        step, mesh = fields.read(-1), fields.mesh
    if step.grains and len(step.grains["id"]):
        x, size = step.grains["x"], step.grains["axes"].mean(axis=1)
        speed = np.linalg.norm(step.grains.get("v", np.zeros_like(x)), axis=1)
    elif mesh is not None:
        moved = step.solid.get("u", np.zeros_like(mesh[0]))
        x, speed = mesh[0] + moved, np.linalg.norm(moved, axis=1)
        size = np.full(len(x), 0.004 * np.ptp(mesh[0], axis=0).max())
    else:
        return None
    some = slice(None, None, -(-len(x) // MOST_GRAINS))
    return {
        "file": path.name, "time": step.time, "count": len(x),
        "what": "speed [m/s]" if step.grains else "displacement [m]",
        "x": np.round(x[some], 9).tolist(), "size": np.round(size[some], 9).tolist(),
        "value": np.round(speed[some], 9).tolist(),
    }  # fmt: skip
