"""Functions of the pages' code, asked from tests: by node, or by a browser where there is none."""

import json
import shutil
import subprocess
from html import unescape
from pathlib import Path
from tempfile import TemporaryDirectory

import browser
import pytest

CODE = Path(__file__).resolve().parents[2] / "prepost" / "talus"


def asked(names: list[str], words: str, **given: object) -> object:
    """Return the value of `words`, JavaScript that sees the files `names` and what is `given`."""
    sources = [(CODE / f"{name}.js").read_text(encoding="utf-8") for name in names]
    head = "".join(f"const {name} = {json.dumps(value)};\n" for name, value in given.items())
    code = "\n".join([*sources, head, f"const answer = JSON.stringify({words});"])
    if shutil.which("node"):
        done = subprocess.run(
            ["node", "-"], input=code + "\nconsole.log(answer);",
            capture_output=True, text=True, timeout=120.0,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)
    if browser.fault():
        pytest.skip(f"no node here, and {browser.fault()}")
    with TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        code = code.replace("</", "<\\/")
        page.write_text(
            f"<!doctype html><pre id=a></pre><script>{code}\n"
            "document.getElementById('a').textContent = answer;</script>",
            encoding="utf-8",
        )
        text = browser.asked(page.as_uri(), Path(folder), "--dump-dom")
    return json.loads(unescape(text.partition('<pre id="a">')[2].partition("</pre>")[0]))
