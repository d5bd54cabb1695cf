"""A partner of grains on ranks gets the replies that one rank gives."""

from pathlib import Path

import numpy as np
import pytest
from ranked import Partner, Script, compare, talk

from talus.compare import max_of
from talus.verification import write_packing

RADIUS, STEP, EXCHANGE = 1.0e-3, 2.0e-6, 4.0e-5
DECK = """&run       title = 'Loose lattice over a floor', gravity = 0.0, 0.0, -9.81 /
&material  id = 'quartz', density = 2650.0, young = 1.0e8, poisson = 0.25 /
&contact   between = 'quartz', 'quartz', law = 'hertz_mindlin', friction = 0.5,
           damping_ratio = 0.1 /
&particles file = 'pack.h5', material = 'quartz' /
&wall      id = 'floor', point = 0.0, 0.0, 0.0, normal = 0.0, 0.0, 1.0, material = 'quartz' /
&dynamics  dt = 2.0e-6 /
"""
LATE = np.array([7, 21, 30])  # grains that the partner takes over after a rehearsal


def write_input(folder: Path) -> np.ndarray:
    """Write deck and packing: 4 x 3 x 3 spheres that touch and move; return their places by id."""
    rng = np.random.default_rng(11)
    axes = np.meshgrid(np.arange(4), np.arange(3), np.arange(3))
    x = 1.99 * RADIUS * np.column_stack([a.ravel() for a in axes])
    x += rng.uniform(-1e-5, 1e-5, x.shape) + [0.0, 0.0, 0.99 * RADIUS]
    ids = rng.permutation(len(x)) + 1
    v = rng.normal(scale=0.05, size=x.shape)
    folder.mkdir()
    write_packing(folder / "pack.h5", x, np.full(x.shape, RADIUS), ids=ids, v=v)
    (folder / "deck.nml").write_text(DECK)
    return x[np.argsort(ids)]


def talk_to_grains(folder: Path, ranks: int, script: object) -> Script:
    """Return what a script kept of the replies of talus-dem."""
    x = write_input(folder)
    return talk("talus-dem", folder, ranks, lambda asker: script(asker, x))


def rehearse(asker: Partner, x: np.ndarray) -> Script:
    """Rehearse two exchanges, take over more grains, change masses, step, reject, step again."""
    kept = []
    asker.ask("SELECT", set="low", role="prescribe", id=np.array([3, 11]))
    asker.ask("SELECT", set="all", role="report", id=np.arange(1, len(x) + 1))
    asker.ask("READY", rehearsal=1)
    for k in range(2):
        place = x[[2, 10]] + [0.0, 0.0, 1e-6 * (k + 1)]
        told = {"low__x": place}
        kept.append(asker.numbers("ADVANCE", k * EXCHANGE, (k + 1) * EXCHANGE, **told))
        asker.ask("ACCEPT")
    asker.ask("READY", rehearsal=0)
    kept.append(asker.numbers("SELECT", set="late", role="prescribe", id=LATE))
    kept.append(asker.numbers("SET", what="mass_factor", set="all",
                                  value=np.linspace(0.5, 1.5, len(x))))  # fmt: skip
    kept.append(asker.numbers("READY"))
    for told in (x[LATE - 1] + [0.0, 2e-6, 0.0], x[LATE - 1] + [1e-6, 0.0, 0.0]):
        kept.append(asker.numbers("ADVANCE", 0.0, EXCHANGE, late__x=told))
        asker.ask("REJECT")
    kept.append(asker.numbers("ADVANCE", 0.0, EXCHANGE))
    asker.ask("ACCEPT")
    return kept


def step_together(asker: Partner, x: np.ndarray) -> Script:
    """Weigh contacts, step by FORCE and KICK_DRIFT after an exchange of ADVANCE."""
    kept = []
    asker.ask("SELECT", set="ghosts", role="prescribe", id=LATE)
    asker.ask("SELECT", set="all", role="report", id=np.arange(1, len(x) + 1))
    asker.ask("READY")
    kept.append(asker.numbers("ADVANCE", 0.0, EXCHANGE))
    asker.ask("ACCEPT")
    ids = asker.ask("DESCRIBE", what="contacts").fields["ids"]
    ids = ids[(ids > 0).all(axis=1)]
    weight = np.where(np.isin(ids, LATE).any(axis=1), 0.5, 1.0)
    asker.ask("SET", what="contact_weight", ids=ids, value=weight)
    for k in range(20):
        now = EXCHANGE + k * STEP
        kept.append(asker.numbers("FORCE", now, now))
        kept.append(asker.numbers("KICK_DRIFT", now, now + STEP, kick=STEP, drift=STEP))
    asker.ask("ACCEPT")
    now += STEP
    kept.append(asker.numbers("ADVANCE", now, now + EXCHANGE))
    asker.ask("ACCEPT")
    return kept


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("script", [rehearse, step_together])
def test_replies_are_those_of_one_rank(script: object, ranks: int, tmp_path: Path) -> None:
    """Every number of every reply, over the largest of its name."""
    one = talk_to_grains(tmp_path / "one", 0, script)
    several = talk_to_grains(tmp_path / "several", ranks, script)
    assert max_of(np.abs(a["all.v"]).max() for a in one if "all.v" in a) > 0.01
    compare(one, several)
