"""Completion in bash, zsh and fish knows the commands, their options and choices, and files."""

import shutil
import subprocess
from pathlib import Path

import pytest

from talus import cli
from talus.commands import completion

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


# what zsh would offer is printed; `_files` stands for the files of the folder
ZSH = """compdef() {{ : }}; compadd() {{ print -l -- "${{@[2,-1]}}" }}; _files() {{ print -l *(N) }}
{0}
words=(talus {1}); CURRENT=$#words; _talus
"""
CASES = [
    ("rep", "report", "rolling_stones.h5"),
    ("pack clo", "cloud", "report"),
    ("render a.h5 --color rol", "role", "rolling_stones.h5"),
    ("render rol", "rolling_stones.h5", "role"),
    ("new hop", "hopper", "--step"),
]


@pytest.mark.skipif(not shutil.which("zsh"), reason="no zsh here")
@pytest.mark.parametrize(("line", "expected", "unwanted"), CASES)
def test_zsh(
    line: str, expected: str, unwanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The function of zsh offers what may stand at the last word."""
    assert expected in offered("zsh", ["zsh", "-fc"], ZSH, line, tmp_path, capsys)
    assert unwanted not in offered("zsh", ["zsh", "-fc"], ZSH, line, tmp_path, capsys)


@pytest.mark.skipif(not shutil.which("fish"), reason="no fish here")
@pytest.mark.parametrize(("line", "expected", "unwanted"), CASES)
def test_fish(
    line: str, expected: str, unwanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fish completes the last word by what may stand there."""
    ask = '{0}\ncomplete -C "talus {1}"\n'
    found = offered("fish", ["fish", "--no-config", "-c"], ask, line, tmp_path, capsys)
    assert expected in found and unwanted not in found


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_all_paths(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Every shell knows every command and option with the words behind it."""
    assert cli.main(["completion", shell]) == 0
    text = capsys.readouterr().out
    for path, words in completion.words_of(cli.build_parser()):
        place = text.index({"bash": f'["{path}"]=', "zsh": f'    "{path}" ',
                            "fish": f"case '{path}'\n"}[shell])  # fmt: skip
        assert " ".join(words) in text[place : place + 2000]


def offered(
    shell: str, command: list[str], ask: str, line: str, folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> list[str]:  # fmt: skip
    """Return what a shell offers for the last word of a line, in a folder with one file."""
    (folder / "rolling_stones.h5").touch()
    assert cli.main(["completion", shell]) == 0
    text = ask.format(capsys.readouterr().out, line)
    done = subprocess.run([*command, text], cwd=folder, capture_output=True, text=True, timeout=30)
    assert not done.stderr
    return done.stdout.split()
