"""`talus view`: the page holds what the field file holds, and a browser draws it."""

import json
import re
import shutil
from pathlib import Path

import h5py
import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest
from browser import asked, shot, working  # noqa: F401

from talus import cli, picture_series, view, view_data
from talus.faults import FaultError
from talus.fields import FieldFile
from talus.pictures import Look, load_pyvista

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


def test_names_of_the_code() -> None:
    """The files of the page's code share one space of names: none is given twice."""
    names = [
        name
        for part in view.CODE
        for name in re.findall(
            r"^(?:function|const|let) (\w+)", (view.HERE / f"{part}.js").read_text(), re.M
        )
    ]
    assert len(names) > 80 and sorted(set(names)) == sorted(names)


def test_page_without_grains_to_draw(run: Path, tmp_path: Path) -> None:
    """Shapes are drawn from their numbers: the page holds no triangles of grains."""
    view.write(run, None, tmp_path / "view.html", 5, "")
    page, _ = blobs_of((tmp_path / "view.html").read_text())
    assert not [name for name in page.text if name.startswith("net")]


# --- what a browser draws, beside rays that are followed here -----------------------------------

SIZE = (800, 480)
LIGHT = np.array([0.25, 0.1, 0.6])


def first_view(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return origins (h, w, 3) of the rays of the first view of a box [m], and their direction."""
    yaw, pitch = -0.85, 0.42
    back = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    up = np.cross(back, right)
    radius = 0.5 * np.linalg.norm(high - low)
    pixel = 2.0 * 1.05 * radius / SIZE[1]
    across = (np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2) * pixel
    upward = -(np.arange(SIZE[1]) + 0.5 - SIZE[1] / 2) * pixel
    origins = 0.5 * (low + high) + across[None, :, None] * right + upward[:, None, None] * up
    return origins + 4.0 * radius * back, -back


def gauge(p: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return (sum |p / a|^e)^(1/e) of a row of the table of shapes, 1 on the surface."""
    a = np.where(p >= 0.0, shape[0:3], shape[4:7])
    return ((np.abs(p) / a) ** shape[3]).sum(axis=-1) ** (1.0 / shape[3])


def hits(o: np.ndarray, d: np.ndarray, shape: np.ndarray, far: float) -> np.ndarray:
    """Return how far rays from o (..., 3) along d go to the shape, infinite where they miss.

    The gauge is convex along a ray: its least place by thirds, then the root by halves.
    """
    off = np.linalg.norm(np.cross(o, d), axis=-1)
    near = off < 1.8 * max(shape[[0, 1, 2, 4, 5, 6]])  # the box of a shape lies in this ball
    found = np.full(off.shape, np.inf)
    found[near] = hits_of(o[near], d, shape, far)
    return found


def hits_of(o: np.ndarray, d: np.ndarray, shape: np.ndarray, far: float) -> np.ndarray:
    """Return `hits` of rays that may meet the shape."""
    low, high = np.zeros(o.shape[:-1]), np.full(o.shape[:-1], far)
    for _ in range(60):
        third = (high - low) / 3.0
        left, right = low + third, high - third
        smaller = gauge(o + left[..., None] * d, shape) < gauge(o + right[..., None] * d, shape)
        low, high = np.where(smaller, low, left), np.where(smaller, right, high)
    least, near = 0.5 * (low + high), np.zeros(o.shape[:-1])
    met = gauge(o + least[..., None] * d, shape) <= 1.0
    for _ in range(40):
        middle = 0.5 * (near + least)
        inside = gauge(o + middle[..., None] * d, shape) <= 1.0
        near, least = np.where(inside, near, middle), np.where(inside, middle, least)
    return np.where(met, least, np.inf)


def rotation(q: np.ndarray) -> np.ndarray:
    """Return the matrix of a unit quaternion."""
    w, v = q[0], q[1:]
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew


def traced(page: view_data.Page, facts: dict, step: int, front: float | None) -> np.ndarray:
    """Return the picture (h, w, 3) of a step by roles; at y < `front` [m] grains are cut away."""
    tint = {k: np.array(matplotlib.colors.to_rgb(colour)) for k, _, colour in facts["roles"]}
    last = len(facts["frames"]) - 1
    ends = np.concatenate([page.get(f"x{k}", "f4").reshape(-1, 3) for k in (0, last)])
    origins, way = first_view(ends.min(axis=0) - facts["size"], ends.max(axis=0) + facts["size"])
    far = 8.0 * np.linalg.norm(np.ptp(ends, axis=0) + 2.0 * facts["size"])
    picture = np.full((*origins.shape[:2], 3), [0.97, 0.975, 0.98])
    depth = np.full(origins.shape[:2], np.inf)
    shapes = page.get("shapes", "f4").reshape(-1, 12).astype(float)
    kinds, x = page.get(f"kind{step}", "u1"), page.get(f"x{step}", "f4").reshape(-1, 3)
    quats = page.get(f"quat{step}", "i2").reshape(-1, 4) / 32767.0
    for number, kind, place, quat in zip(
        page.get(f"shape{step}", "u4"), kinds, x, quats, strict=True
    ):
        shape, turn = shapes[number], rotation(quat / np.linalg.norm(quat))
        o, d = (origins - place) @ turn + shape[8:11], way @ turn
        t = hits(o, d, shape, far)
        point = o + np.where(np.isfinite(t), t, 0.0)[..., None] * d
        slope = np.sign(point) * np.abs(point) ** (shape[3] - 1.0)
        slope /= np.where(point >= 0.0, shape[0:3], shape[4:7]) ** shape[3]
        normal = slope / np.linalg.norm(slope, axis=-1, keepdims=True) @ turn.T
        lit = LIGHT - way
        light = 0.45 + 0.5 * np.maximum(normal @ (lit / np.linalg.norm(lit)), 0.0)
        if front is not None:  # where the ray leaves what is taken away
            plane = (front - origins[..., 1]) / way[1]
            open_ = np.isfinite(t) & (t < plane)
            kept = gauge(o + plane[..., None] * d, shape) <= 1.0
            light = np.where(open_, 0.62, light)
            t = np.where(open_, np.where(kept, plane, np.inf), t)
        nearer = t < depth
        depth = np.where(nearer, t, depth)
        picture[nearer] = tint[int(kind)] * 1.05 * light[nearer][:, None]
    return np.clip(picture, 0.0, 1.0)


def tilted(tmp_path: Path) -> Path:
    """Return four grains of four shapes and roles, turned: one hides a part of another."""
    q = np.array([[1.0, 0.4, -0.3, 0.2], [0.8, -0.5, 0.1, 0.6], [1.0, 0, 0, 0.4], [0.3, 1, 0.2, 0]])
    step = {
        "id": [1, 2, 3, 4], "kind": [0, 1, 2, 3],
        "x": [[0, 0, 0], [0.0032, -0.0008, 0.0004], [0.001, 0.0026, 0.0012],
              [0.0005, 0.001, 0.0030]],
        "quat": q / np.linalg.norm(q, axis=1)[:, None],
        "axes": [[1.0e-3, 2.0e-3, 1.5e-3], [1.4e-3, 1.2e-3, 1.6e-3], [1.8e-3, 0.8e-3, 1.1e-3],
                 [1.5e-3, 1.0e-3, 0.9e-3]],
        "skew": [[0.0, 0.0, 0.0], [0.3, -0.2, 0.4], [0.0, 0.0, 0.0], [0.2, 0.1, -0.3]],
        "exponent": [2.0, 2.0, 5.0, 3.0], "v": np.zeros((4, 3)),
    }  # fmt: skip
    return field_file(tmp_path / "grains.h5", [step])


@pytest.mark.parametrize("front", [None, 0.45])
def test_picture(tmp_path: Path, browser: None, front: float | None) -> None:
    """A browser draws ellipsoid, poly-ellipsoid and superquadrics as the rays followed here do.

    Colours are kept in 256 steps and turns in 1/32767. What differs lies at outlines: a pixel wide,
    at most 1.5 % of the middle of this picture, as its outlines are some 1 100 of 150 000 pixels.
    """
    view.write(tilted(tmp_path), None, tmp_path / "view.html", 5, "four grains")
    page, facts = blobs_of((tmp_path / "view.html").read_text())
    words = "" if front is None else f"&axis=y&cut={front}"
    seen = shot((tmp_path / "view.html").as_uri() + "#colour=role" + words, tmp_path, SIZE)
    drawn = matplotlib.image.imread(seen)[..., :3]
    x = page.get("x0", "f4").reshape(-1, 3)[:, 1]
    low, high = x.min() - facts["size"], x.max() + facts["size"]
    at = None if front is None else low + front * (high - low)
    expected = traced(page, facts, 0, at)
    assert drawn.shape == expected.shape
    middle = np.s_[20:460, 270:620]  # without panel and key
    apart = np.abs(drawn - expected).max(axis=-1)[middle]
    covered = np.ptp(expected[middle], axis=-1) > 0.05
    assert covered.mean() > 0.2
    assert (apart > 0.03).mean() < 0.015, (apart > 0.03).mean()
    assert np.median(apart[covered]) < 0.01


def test_many(tmp_path: Path, browser: None) -> None:
    """A browser draws 50 000 ellipsoids, turns them, and says how many pictures a second."""
    count, random = 50_000, np.random.default_rng(3)
    cells = np.indices((32, 32, 49)).reshape(3, -1).T[:count]
    step = {
        "id": np.arange(count), "kind": np.zeros(count), "x": 2.1e-3 * cells,
        "quat": random.normal(size=(count, 4)), "axes": random.uniform(6e-4, 1.4e-3, (count, 3)),
        "skew": np.zeros((count, 3)), "exponent": np.full(count, 2.0), "v": np.ones((count, 3)),
    }  # fmt: skip
    step["quat"] /= np.linalg.norm(step["quat"], axis=1)[:, None]
    view.write(field_file(tmp_path / "g.h5", [step]), None, tmp_path / "view.html", 1, "many")
    text = asked((tmp_path / "view.html").as_uri() + "#rate=2", tmp_path, "--dump-dom")
    assert "50000 grains" in text
    rate = re.search(r'<span id="rate">([\d.e-]+) full pictures a second', text)
    assert rate and float(rate[1]) > 0.0
