"""Pages of other commands in a browser: that of `talus watch`, and the view within a report."""

import io
import shutil
import subprocess
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from browser import working  # noqa: F401
from browser_page import BrowserPage
from test_report import grains_file, write_run
from test_watch import END, run, served  # noqa: F401

from talus import reports

LINE = (0x1B, 0x4F, 0x72)  # of the curve

# colours (r, g, b) of pixels of a canvas, by its id
PIXELS = """(id, spots) => { const pen = document.getElementById(id).getContext('2d');
  return spots.map(([x, y]) => [...pen.getImageData(x, y, 1, 1).data].slice(0, 3)); }"""


def test_watch(run: Path, served: tuple[int, subprocess.Popen], tmp_path: Path,  # noqa: F811
               browser: None) -> None:  # fmt: skip
    """The page of a running job shows its curve, its last frame and its end without a reload.

    The history is t^2 up to 0.5 s; of two spheres the upper one is the faster.
    """
    with BrowserPage(f"http://127.0.0.1:{served[0]}/", tmp_path) as page:
        page.wait("document.getElementById('note').textContent.includes('2 points')")
        assert page.value("document.getElementById('column').value") == "kinetic"
        assert page.value("document.getElementById('note').textContent").endswith("5.00 (yellow)")
        row = page.value("document.getElementById('runs').textContent")
        assert "talus-dem bed" in row and "0.5000 of 2 s" in row and "running" in row
        x = [70 + 510 * t / 0.5 for t in (0.1, 0.25, 0.4)]
        y = [360 - 330 * (t / 0.5) ** 2 for t in (0.1, 0.25, 0.4)]
        for at, height in zip(x, y, strict=True):  # the line is 1.5 pixels wide
            spots = [[round(at), round(height) + k] for k in range(-2, 3)]
            found = np.array(page.value(f"({PIXELS})('curve', {spots})"))
            assert np.abs(found - LINE).sum(axis=1).min() < 60, (at, found)
        # 190 pixels a unit: spheres of 0.5 at 1 and 2 above the lower edge of 10 pixels
        upper, lower, beside = page.value(
            f"({PIXELS})('frame', [[250, 105], [250, 295], [30, 200]])"
        )
        assert lower[2] > 1.5 * lower[0] and upper[0] > 1.5 * upper[2] and beside == [0, 0, 0]
        image = matplotlib.image.imread(io.BytesIO(page.picture()), format="png")
        assert image.shape[:2] == (720, 1280) and np.ptp(image[..., :3]) > 0.8
        with (run / "bed.log").open("a") as log:
            log.write(END)
        page.wait("document.getElementById('runs').textContent.includes('finished, exit 0')")


def test_view_in_a_report(tmp_path: Path, browser: None) -> None:
    """The view within a report is drawn when it is opened, and nothing comes from the network."""
    folder = write_run(tmp_path / "a")
    shutil.copy(grains_file(tmp_path), folder / "run.h5")
    path = tmp_path / "report.html"
    path.write_text(reports.build(folder, ""), encoding="utf-8")
    inside = "document.querySelector('#view iframe').contentDocument"
    with BrowserPage(path.as_uri(), tmp_path) as page:
        page.value("document.getElementById('view').open = true; "
                   "document.getElementById('view').scrollIntoView()")  # fmt: skip
        page.wait(f"{inside}?.getElementById('pace')?.textContent === 'full picture'")
        assert page.value(f"{inside}.getElementById('fault').textContent") == ""
        page.value("new Promise((d) => requestAnimationFrame(() => requestAnimationFrame(d)))")
        scene = f"{inside}.querySelector('#scene')"
        size = page.value(f"(({{ width, height }}) => [width, height])({scene})")
        frame = "document.querySelector('#view iframe').getBoundingClientRect()"
        box = page.value(f"(({{ x, y, width, height }}) => [x, y, width, height])({frame})")
        assert page.value("performance.getEntriesByType('resource').length") == 0
        image = matplotlib.image.imread(io.BytesIO(page.picture()), format="png")[..., :3]
    assert size == pytest.approx([2 * box[2], 2 * box[3]], abs=8)
    left, top = int(box[0] + 0.3 * box[2]), max(0, int(box[1]))
    seen = image[top : int(box[1] + box[3]), left : int(box[0] + 0.85 * box[2])]
    assert (np.ptp(seen, axis=-1) > 0.1).mean() > 0.01
