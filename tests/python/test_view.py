"""`talus view`: the page holds what the field file holds, and a browser draws it."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import cli, picture_series, view, view_data
from talus.faults import FaultError
from talus.fields import FieldFile
from talus.pictures import Look, load_pyvista

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
X = np.array([[0.0, 0, 0], [0.003, 0, 0], [0, 0.004, 0.001], [0, 0, 0.004]])


def field_file(path: Path, steps: list[dict], time: float = 0.0) -> Path:
    """Write a field file of grains: ids, kinds, places a step; ellipsoids and a superquadric."""
    with h5py.File(path, "w") as file:
        for k, step in enumerate(steps):
            group = file.create_group(f"steps/{k:06d}")
            group.attrs["time"] = time + 0.1 * k
            n = len(step["id"])
            grains = {
                "quat": np.tile([1.0, 0, 0, 0], (n, 1)),
                "axes": np.array([[1.0e-3, 2.0e-3, 1.5e-3], [1.0e-3] * 3] * n)[:n],
                "skew": np.array([[0.2, 0.0, -0.1], [0.0] * 3] * n)[:n],
                "exponent": np.array([2.0, 4.0] * n)[:n],
                "v": np.ones((n, 3)) * (k + 1.0),
            }
            for name, data in (grains | step).items():
                group[f"grains/{name}"] = np.asarray(data)
    return path


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return grains of which the third enters at the second step, and a ghost becomes free."""
    first = {"id": [1, 2], "kind": [0, 3], "x": X[:2]}
    second = {"id": [1, 2, 5], "kind": [0, 3, 0], "x": X[:3]}
    third = {"id": [5, 1, 2], "kind": [0, 0, 0], "x": X[[2, 0, 1]] + [0.0, 0.0, -0.002]}
    return field_file(tmp_path / "grains.h5", [first, second, third])


def test_entry(run: Path) -> None:
    """Grains have moved since they entered, not since the first step."""
    with FieldFile(run) as fields:
        entry = fields.entry(2)
    assert entry.grains["id"].tolist() == [1, 2, 5]
    assert np.array_equal(entry.grains["x"], X[:3])


def test_entry_again(tmp_path: Path) -> None:
    """A grain that left and came back has entered where it came back."""
    rows = [([1, 2], X[:2]), ([1], X[:1]), ([1, 2], X[[0, 3]])]
    steps = [{"id": number, "kind": [0] * len(number), "x": x} for number, x in rows]
    with FieldFile(field_file(tmp_path / "g.h5", steps)) as fields:
        assert np.array_equal(fields.entry(-1).grains["x"], X[[0, 3]])


def blobs_of(text: str) -> tuple[view_data.Page, dict]:
    """Return what a page holds."""
    found = dict(re.findall(r'<script type="text/plain" id="b-([^"]+)">([^<]*)</script>', text))
    facts = re.search(r'<script id="facts" type="application/json">(.*?)</script>', text, re.S)
    return view_data.Page(found), json.loads(facts.group(1))


def test_round_trip(run: Path, tmp_path: Path) -> None:
    """Places, roles, turns, shapes and displacements come out of the page as they went in."""
    target = tmp_path / "view.html"
    assert cli.main(["view", str(run), "-o", str(target)]) == 0
    text = target.read_text()
    assert "http" not in text.replace("http-equiv", "")
    page, facts = blobs_of(text)
    assert [f["count"] for f in facts["frames"]] == [2, 3, 3]
    assert np.allclose(page.get("x1", "f4").reshape(-1, 3), X[:3], rtol=1.0e-6)
    assert page.get("kind1", "u1").tolist() == [0, 3, 0]
    assert page.get("kind2", "u1").tolist() == [0, 0, 0]
    assert page.get("quat0", "i2").reshape(-1, 4)[:, 0].tolist() == [32767, 32767]
    shape = page.get("shapes", "f4").reshape(-1, 12)[page.get("shape0", "u4")]
    assert np.allclose(shape[0, [0, 4, 2, 6]], [1.2e-3, 0.8e-3, 1.35e-3, 1.65e-3])
    assert shape[:, 3].tolist() == [2.0, 4.0]
    field = {f["name"]: f for f in facts["fields"]}["displacement"]
    step = field["high"] / 255.0
    moved = field["low"] + step * page.get("g.displacement2", "u1")
    assert np.abs(moved - 0.002).max() <= step
    assert page.get("g.displacement1", "u1").tolist() == [0, 0, 0]


def test_chosen_steps() -> None:
    """Steps are spread evenly and keep both ends."""
    assert view_data.chosen_steps(3, 20) == [0, 1, 2]
    assert view_data.chosen_steps(101, 5) == [0, 25, 50, 75, 100]
    assert view_data.chosen_steps(9, 1) == [0, 8]


def test_skin() -> None:
    """Two cubes side by side have ten outer faces and no face between them."""
    grid = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)], float)
    cells = np.array([[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]])
    triangles, edges = view_data.skin({"hex8": cells})
    a, b, c = (grid[triangles[:, k]] for k in range(3))
    assert len(triangles) == 20 and len(edges) == 20
    assert np.isclose(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0, 10.0)
    assert np.isclose((a * np.cross(b, c)).sum() / 6.0, 2.0)  # outward: the volume


def test_series(run: Path, tmp_path: Path) -> None:
    """A series has one scale: the largest displacement since entry, and the bounds of all steps."""
    look = picture_series.common(run, range(3), Look("displacement", (200, 150)))
    assert look.top == 2.0  # mm, of the third step
    assert np.allclose(look.bounds, [-2.0, 5.0, -2.0, 6.0, -4.0, 3.0])
    with pytest.raises(FaultError, match="a.xyz") as fault:
        picture_series.write(run, None, 1, tmp_path / "a.xyz", look)
    assert fault.value.code == "E554"


def test_gif_by_role(run: Path, tmp_path: Path) -> None:
    """A GIF has an image a step, and a ghost that becomes free changes its colour."""
    image = pytest.importorskip("PIL.Image")
    try:
        load_pyvista()
    except FaultError:
        pytest.skip("nothing to draw with")
    target = tmp_path / "role.gif"
    words = ["render", str(run), "--color", "role", "--every", "2", "--size", "300", "200"]
    assert cli.main([*words, "-o", str(target)]) == 0
    film = image.open(target)
    assert film.n_frames == 2
    blue = []
    for k in range(2):
        film.seek(k)
        pixel = np.asarray(film.convert("RGB"), float)[:, :200]
        blue.append(int((pixel[..., 2] > pixel[..., 0] + 40.0).sum()))
    assert blue[0] > 200 and blue[1] < 0.05 * blue[0]


@pytest.mark.parametrize(
    "words, code, text",
    [
        ("grains.h5 -o a.png", "E601", "'a.png'"),
        (". -o a.html", "E602", "several files"),
        ("empty -o a.html", "E602", "no field file"),
    ],
)
def test_faults(
    run: Path, words: str, code: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Say what cannot be viewed."""
    shutil.copy(run, run.with_name("other.h5"))
    (run.parent / "empty").mkdir()
    monkeypatch.chdir(run.parent)
    name, _, output = words.split()
    with pytest.raises(FaultError, match=text) as fault:
        view.write(Path(name), None, Path(output), 5, "")
    assert fault.value.code == code


@pytest.mark.skipif(not BROWSER, reason="no chromium here")
def test_picture(run: Path, tmp_path: Path) -> None:
    """A browser draws something in the middle of the page."""
    import matplotlib.image

    view.write(run, None, tmp_path / "view.html", 5, "three grains")
    shot = tmp_path / "shot.png"
    flags = ["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--window-size=900,600",
             "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
             f"--user-data-dir={tmp_path}/u", "--virtual-time-budget=1000",
             f"--screenshot={shot}"]  # fmt: skip
    page = (tmp_path / "view.html").as_uri() + "#colour=role"
    subprocess.run([BROWSER, *flags, page], timeout=60, capture_output=True)
    middle = matplotlib.image.imread(shot)[150:450, 300:700, :3]
    assert (np.ptp(middle, axis=2) > 0.25).mean() > 0.02  # grains of colour, not the grey ground
