"""Fragments that grow: mass, ledger, same bits for threads and restarts amid growth, ranks."""

from pathlib import Path

import numpy as np
import pytest
from test_breakage import BOX, LIMIT, OUTPUT, contents, masses, run, write_loose

from talus.verification import field_steps, read_history

GROW = "seed = 1, regrow = 5.0e-5"
END = 2.0e-4  # [s]
FEWER = "family = 'halves', seed = 3, regrow = 5.0e-5, size_exponent = 0.5"


@pytest.mark.parametrize(("words", "shapes"), [(GROW, False), (FEWER, True)])
def test_grown_fragments_have_the_volume_of_their_grain(
    tmp_path: Path, words: str, shapes: bool
) -> None:
    """No mass leaves, the ledger closes with the work of growth, volumes end as they began."""
    write_loose(tmp_path, shapes=shapes)
    run(tmp_path, BOX, OUTPUT, LIMIT, words=words, t_end=END, smallest=0.9e-3)
    rows = read_history(tmp_path / "deck_breakage.csv")
    energy = read_history(tmp_path / "deck_energy.csv")
    steps = field_steps(tmp_path / "deck.h5")
    start = masses(steps[0].grains).sum()
    assert rows["broken"][-1] > 5
    assert np.abs(rows["fines_mass"]).max() < 1e-14 * start
    assert energy["growth"][-1] > 0.0
    assert energy["relative_closure"][-1] < 5e-3
    kept, at_birth = masses(steps[-1].grains).sum(), 0.7 if shapes else 0.53
    grown = steps[-1].grains["generation"] > 0
    assert grown.any()
    assert at_birth * start < kept < start * (1.0 + 1e-12)


def test_growth_goes_on_by_the_same_bits(tmp_path: Path) -> None:
    """Two threads from a checkpoint amid growth end by the bits of one; rows of events as well."""
    write_loose(tmp_path)
    often = OUTPUT.replace("3.0e-5", "2.0e-5")
    run(tmp_path, BOX, often, LIMIT, words=GROW, t_end=END, smallest=0.9e-3)
    end = contents(tmp_path / "end.h5")
    names = ("broken", "breakage", "energy")
    texts = {name: (tmp_path / f"deck_{name}.csv").read_text() for name in names}
    broken = read_history(tmp_path / "deck_broken.csv")["time"]
    kept = sorted(tmp_path.glob("deck.chk.*.h5"))
    kept = next(path for path in kept if amid(path))
    kept = kept.rename(tmp_path / "kept.h5")
    assert broken[-1] > broken[0]
    run(tmp_path, BOX, often, LIMIT, words=GROW, t_end=END, smallest=0.9e-3, threads=2,
        options=(f"--restart={kept.name}",))  # fmt: skip
    assert contents(tmp_path / "end.h5") == end
    for name, text in texts.items():
        assert (tmp_path / f"deck_{name}.csv").read_text() == text


def amid(path: Path) -> bool:
    """Is a fragment of a checkpoint between its first and its last size?"""
    rows = np.frombuffer(
        next(v for k, v in contents(path).items() if "growing" in k)
    )  # id, start, reached, end, size
    rows = rows.reshape(-1, 5)
    return bool(((rows[:, 2] > 1.0) & (rows[:, 2] < rows[:, 3])).any())


def test_ranks_grow_the_same_fragments(tmp_path: Path) -> None:
    """On two ranks the first fragments have the sizes and masses of one rank."""
    write_loose(tmp_path)
    found = {}
    for ranks in (1, 2):
        run(tmp_path, BOX, OUTPUT, LIMIT, words=GROW, t_end=1.0e-4, ranks=ranks, smallest=0.9e-3)
        found[ranks] = field_steps(tmp_path / "deck.h5")[-1].grains
        assert read_history(tmp_path / "deck_energy.csv")["relative_closure"][-1] < 5e-3
    assert list(found[1]["id"]) == list(found[2]["id"])
    assert (found[1]["generation"] > 0).sum() >= 14
    assert found[2]["axes"] == pytest.approx(found[1]["axes"], rel=1e-12)
