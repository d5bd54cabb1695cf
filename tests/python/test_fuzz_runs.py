"""Short campaigns of the fuzzers (tests/fuzz): changed decks, damaged files, port, signals."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from talus.programs import find_program

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["decks", "files", "texts", "port", "signals"])
def test_short_campaign(name: str) -> None:
    """Every check of the campaign is passed, and there are some."""
    binaries = Path(find_program("talus-couple")).parent
    command = [sys.executable, str(ROOT / f"tests/fuzz/{name}.py"), f"--bin={binaries}"]
    path = {"PYTHONPATH": f"{ROOT / 'prepost'}"}
    done = subprocess.run(command, env=os.environ | path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed, 0 failed" in done.stdout
    assert int(done.stdout.split(" passed, 0 failed")[0].split()[-1]) > 20
