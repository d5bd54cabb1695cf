"""The view in a browser while it moves: its rate, its quality, and the full picture afterwards."""

import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from browser import working  # noqa: F401
from browser_page import BrowserPage
from javascript import asked
from test_view import field_file

from talus import view

SLOW = 1.15 * 1000.0 / 30.0  # ms a picture above which the page draws less
IDLE = "!now.moving && !now.job && !now.asked && el('pace').textContent === 'full picture'"


def block(path: Path, cells: tuple[int, int, int], mixed: bool = False) -> Path:
    """Write a page of a block of ellipsoids, turned at random; `mixed` with other shapes, too."""
    random = np.random.default_rng(3)
    x = 2.1e-3 * np.indices(cells).reshape(3, -1).T
    n = len(x)
    quat = random.normal(size=(n, 4))
    step = {
        "id": np.arange(n), "kind": np.zeros(n), "x": x,
        "quat": quat / np.linalg.norm(quat, axis=1)[:, None],
        "axes": random.uniform(6e-4, 1.4e-3, (n, 3)), "skew": np.zeros((n, 3)),
        "exponent": np.full(n, 2.0), "v": random.normal(size=(n, 3)),
    }  # fmt: skip
    if mixed:
        step["skew"] = random.uniform(-0.5, 0.5, (n, 3)) * (random.random((n, 1)) < 0.6)
        step["exponent"] = np.where(random.random(n) < 0.5, 2.0, random.uniform(2.0, 8.0, n))
    view.write(field_file(path.with_suffix(".h5"), [step]), None, path, 1, "block")
    return path


def scene(page: BrowserPage) -> np.ndarray:
    """Return the picture of a page (h, w, 3), 0 to 1, without what stands in its corners."""
    image = matplotlib.image.imread(io.BytesIO(page.picture()), format="png")[..., :3]
    return image[:, 260:1120]


def at_rest(page: BrowserPage) -> np.ndarray:
    """Return the full picture, when it is made and seen."""
    page.wait(IDLE)
    page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return scene(page)


def test_turning(tmp_path: Path, browser: None) -> None:
    """50 000 ellipsoids turn at 30 pictures a second, or at the last level; then all is as before.

    How far the level must fall is the machine's affair; that it falls until the rate is held, and
    that the full picture after it is the same to the bit, is not.
    """
    path = block(tmp_path / "view.html", (32, 32, 49))
    with BrowserPage(path.as_uri() + "#colour=g.v", tmp_path) as page:
        still = at_rest(page)
        for _ in range(15):
            told = page.value("turn(3)")
            if told["pictures"] > 5 and (told["floor"] or told["ms"] <= SLOW):
                break
        assert told["pictures"] > 5 and (told["floor"] or told["ms"] <= SLOW), told
        level = asked(["view_pace"], f"LEVELS[{told['level']}]")
        share = level["share"]
        assert f"{100 * level['resolution']:.0f} % of the resolution" in told["text"]
        assert ("all grains" if share == 1.0 else f"{100 * share:.0f} % of the gr") in told["text"]
        assert told["text"] in page.value("document.getElementById('rate').textContent")
        turned = at_rest(page)
        page.value("resetCamera(), redraw()")
        again = at_rest(page)
    assert np.ptp(still, axis=-1).max() > 0.3
    assert np.mean(np.abs(turned - still).max(axis=-1) > 0.05) > 0.02
    assert np.array_equal(again, still)


@pytest.mark.parametrize("words", ["", "&axis=y&cut=0.4", "&axis=x&whole=1"])
def test_hidden_grains(tmp_path: Path, browser: None, words: str) -> None:
    """The full picture without the grains that are hidden is that with all of them, bit by bit."""
    path = block(tmp_path / "view.html", (9, 8, 10), mixed=True)
    with BrowserPage(path.as_uri() + "#colour=g.v" + words, tmp_path) as page:
        fewer = at_rest(page)
        count = page.value("beginFull().count")
        page.value("seenGrains = ({ n }) => Uint32Array.from({ length: n }, (_, k) => k); redraw()")
        every = at_rest(page)
        assert page.value("beginFull().count") == 720
    assert 50 < count < 650  # of 720: some are left out
    assert np.ptp(every, axis=-1).max() > 0.3
    assert np.array_equal(fewer, every)


def test_quick_picture(tmp_path: Path, browser: None) -> None:
    """What is drawn while the hand moves shows the grains of the full picture, also cut open.

    At the resolution of the screen only outlines differ: they are not smooth.
    """
    path = block(tmp_path / "view.html", (8, 7, 6))
    with BrowserPage(path.as_uri() + "#colour=g.v&axis=y", tmp_path) as page:
        full = at_rest(page)
        page.value("now.moving = true, drawQuick(LEVELS[1])")
        page.value("new Promise((done) => requestAnimationFrame(() => "
                   "{ drawQuick(LEVELS[1]); requestAnimationFrame(done); }))")  # fmt: skip
        quick, width = scene(page), page.value("canvas.width")
    covered = np.ptp(full, axis=-1) > 0.05
    apart = np.abs(quick - full).max(axis=-1)
    assert width == 1280 and covered.mean() > 0.2
    assert np.median(apart[covered]) < 0.01
    assert (apart > 0.1).mean() < 0.05, (apart > 0.1).mean()


def test_drag(tmp_path: Path, browser: None) -> None:
    """The mouse turns the camera with quick pictures; a fifth of a second later the full one comes.

    `full quality always` leaves the quick ones out.
    """
    path = block(tmp_path / "view.html", (8, 7, 6))
    with BrowserPage(path.as_uri(), tmp_path) as page:
        at_rest(page)
        page.value("window.quicks = 0; const plain = drawQuick; "
                   "drawQuick = (level) => { quicks++; plain(level); }; 0")  # fmt: skip
        page.drag((700, 400), [(10, 3)] * 8, 0.03)
        assert page.value("quicks") > 0
        yaw, pitch = page.value("[camera.yaw, camera.pitch]")
        assert yaw == pytest.approx(-0.85 - 0.64) and pitch == pytest.approx(0.42 + 8 * 0.024)
        at_rest(page)
        assert page.value("canvas.width") == 2 * 1280
        before = page.value("el('always').checked = true; quicks")
        page.mouse("mouseMoved", 700, 420)
        at_rest(page)
        assert page.value("quicks") == before and page.value("camera.yaw") > yaw
