"""`talus explain`: keys, groups and codes against the tables they come from; near names."""

import pytest

from talus import cli, reference
from talus.commands.explain import users


def told(capsys: pytest.CaptureFixture[str], name: str) -> str:
    """Return what `talus explain` prints of a name that it knows."""
    assert cli.main(["explain", name]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_key_with_unit_default_and_case(capsys: pytest.CaptureFixture[str]) -> None:
    """Name text, type and unit of a key, in the group asked for only."""
    text = told(capsys, "material.density")
    assert "density of &material" in text and "unit kg/m3" in text
    assert "used by" in text and "&run" not in text


def test_users_are_of_the_program() -> None:
    """Count the decks of the program alone though both have the group and key."""
    of_dem, of_fem = (users(p, "material", "density") for p in ("talus-dem", "talus-fem"))
    assert "examples/02-element-tests" in of_dem and of_dem != of_fem
    assert users("talus-couple", "material", "density") == []


def test_few_pages(capsys: pytest.CaptureFixture[str]) -> None:
    """A common word lists the pages that speak of the key in its group, not all that use it."""
    assert cli.main(["explain", "window.surface"]) == 0
    (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("  manual")]
    assert len(line.split(", ")) <= 4 and "manual/learn-hopper.md" not in line


def test_group_names_its_keys(capsys: pytest.CaptureFixture[str]) -> None:
    """List what a program adds to a shared group beside the shared keys."""
    text = told(capsys, "&output")
    assert "talus-dem: &output" in text and "every_time" in text and "packing" in text


def test_code(capsys: pytest.CaptureFixture[str]) -> None:
    """Give title, explanation and failing deck of a code."""
    text = told(capsys, "i226")
    assert "I226: a surface with holes" in text and "example tests/errors/" in text


def test_all_names_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    """Every group has an explanation, and a code of each program."""
    firsts = {code[0]: code for code in reference.codes()}
    for name in [*{g.name for g in reference.groups()}, *firsts.values()]:
        assert len(told(capsys, name)) > len(name)


def test_near_name(capsys: pytest.CaptureFixture[str]) -> None:
    """Offer the name that was meant, as E600."""
    assert cli.main(["explain", "densty"]) == 1
    fault = capsys.readouterr().err
    assert "error E600" in fault and "did you mean density" in fault
