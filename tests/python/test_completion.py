"""Completion in bash knows the commands, their options and their choices, and files."""

import subprocess
from pathlib import Path

import pytest

from talus import cli

ASK = """{0}
COMP_WORDS=(talus {1}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _talus
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.parametrize(
    ("line", "expected", "unwanted"),
    [
        ("rep", "report", "render"),
        ("pack clo", "cloud", "column"),
        ("pack cloud --per", "--periodic", "--seed"),
        ("render a.h5 --color rol", "role", "rolling stones.h5"),
        ("render a.h5 --color ''", "speed", "--step"),
        ("render rol", "rolling stones.h5", "role"),
        ("render a.h5 -o rol", "rolling stones.h5", "role"),
        ("view --fra", "--frames", "--title"),
        ("new hop", "hopper", "drum"),
        ("''", "report", "rolling stones.h5"),
    ],
)
def test_words(
    line: str, expected: str, unwanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last word of a line is completed, by what may stand there alone."""
    (tmp_path / "rolling stones.h5").touch()
    assert cli.main(["completion", "bash"]) == 0
    text = ASK.format(capsys.readouterr().out, line)
    done = subprocess.run(["bash", "-uc", text], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr
    found = done.stdout.splitlines()
    assert expected in found and unwanted not in found
