"""A browser without a screen, for tests of pages: Chromium, or what the variable CHROMIUM names."""

import functools
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import manual_pdf  # noqa: E402

BROWSER = manual_pdf.browser()
#: graphics by SwiftShader: no card, the same picture on every machine
FLAGS = (
    "--headless=new", "--no-sandbox", "--no-first-run", "--disable-dev-shm-usage",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--hide-scrollbars",
)  # fmt: skip
LIMIT = 300.0  # seconds for one page on a machine that does other work


def asked(page: str, folder: Path, *flags: str, limit: float = LIMIT) -> str:
    """Open a page by its address; return what the browser prints. Its profile lies in `folder`."""
    words = [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", *flags, page]
    return subprocess.run(words, timeout=limit, capture_output=True, text=True, check=True).stdout


def shot(page: str, folder: Path, size: tuple[int, int]) -> Path:
    """Return a picture of a page, `size` pixels, written in `folder`."""
    target = folder / "shot.png"
    window = f"--window-size={size[0]},{size[1]}"
    asked(page, folder, window, "--virtual-time-budget=1000", f"--screenshot={target}")
    return target


@functools.cache
def fault() -> str:
    """Return why no page can be looked at here; an empty text where it can."""
    if not BROWSER:
        return "no chromium here, and CHROMIUM names none"
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text("<!doctype html><title>t</title><p>seen")
        try:
            seen = "seen" in asked(page.as_uri(), Path(folder), "--dump-dom", limit=60.0)
        except (OSError, subprocess.SubprocessError) as wrong:
            return f"{BROWSER} opens no page: {type(wrong).__name__}"
    return "" if seen else f"{BROWSER} prints no page"


@pytest.fixture(name="browser")
def working() -> None:
    """Skip the test, with the reason, where no browser works."""
    if fault():
        pytest.skip(fault())
