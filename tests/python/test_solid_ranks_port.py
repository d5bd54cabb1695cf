"""A partner of a solid on ranks gets the replies that one rank gives."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ranked import Partner, Script, compare, talk

from talus.compare import max_of
from talus.mesh import Mesh, box, write_mesh

STEP = 1.0e-5
DECK = """&run      title = 'Block', gravity = 0.0, 0.0, -9.81 /
&mesh     file = 'block.h5' /
&{group} id = 'soil', density = 1500.0, {law} /
&section  group = 'all', material = 'soil', element = '{element}' /
&support  group = 'z0', fix = 'x', 'y', 'z' /
&traction group = 'x1', value = -100.0, 0.0, 50.0, curve = 'up' /
&pressure group = 'y0', value = 20.0, follower = {follower} /
&curve    id = 'up', times = 0.0, 1.0e-3, values = 0.0, 1.0 /
&analysis kind = '{kind}'{more} /
"""
USUAL = {"element": "hex8_bbar", "more": "", "follower": ".false.", "group": "material"}
ELASTIC = "young = 5.0e6, poisson = 0.3"
PLASTIC = "law = 'drucker_prager', young = 5.0e6, poisson = 0.3, cohesion = 100.0, " \
    "friction_deg = 25.0, dilation_deg = 5.0, hardening = 1.0e6"  # fmt: skip
POLAR = ("law = 'micropolar', micro_inertia = 1.0e-4, kappa = 2.0e6, alpha = 0.0, beta = 1.0, "
         "gamma = 20.0, lambda = 3.0e6, mu = 2.0e6")  # fmt: skip
MICRO = ("micro_inertia = 1.0e-4, lambda = 2.9e6, mu = 0.7e6, eta = 6.0e6, tau = 1.0e6, "
         "kappa = 1.0e6, nu = 0.8e6, sigma = 0.5e6, taus = 0, 0, 0, 0, 0, 0, 500.0, 0, 0, 0, 0")
FINITE = "law = 'neo_hookean', young = 5.0e6, poisson = 0.3"
RAYLEIGH = ", rayleigh_mass = 5.0, rayleigh_stiffness = 1.0e-6"


class Block:
    """A block of distorted bricks, what is chosen of it, and motions to prescribe."""

    def __init__(self) -> None:
        """Make it with the same random numbers at all times."""
        self.rng = np.random.default_rng(8)
        self.mesh = box(np.zeros(3), np.array([0.4, 0.3, 0.3]), (4, 3, 3))
        x = self.mesh.x
        free = (x[:, 2] > 0.05) & (x[:, 2] < 0.25)
        x[free] += 0.01 * self.rng.uniform(-1.0, 1.0, (free.sum(), 3))
        self.nodes = np.arange(1, len(x) + 1)
        self.top = self.nodes[x[:, 2] > 0.29]
        self.side = self.nodes[(x[:, 0] > 0.39) & (x[:, 2] > 0.05) & (x[:, 2] < 0.25)]
        self.elements = len(self.mesh.cells["hex8"])

    def way(self, k: int, nodes: np.ndarray) -> np.ndarray:
        """Displacements of nodes after k steps [m]."""
        wave = np.sin(np.add.outer(nodes.astype(float), np.arange(3.0)))
        return 1e-6 * k * (wave - [0.0, 0.0, 2.0])

    def pushes(self, nodes: np.ndarray) -> np.ndarray:
        """Forces on nodes [N]."""
        return np.cos(np.add.outer(nodes.astype(float), np.arange(3.0)))


def write_input(folder: Path, mesh: Mesh, **words: str) -> None:
    """Write deck and mesh."""
    folder.mkdir()
    write_mesh(folder / "block.h5", mesh)
    (folder / "deck.nml").write_text(DECK.format(**USUAL | words))


def describe(asker: Partner) -> Script:
    """Return the descriptions of all."""
    kept = [asker.numbers("DESCRIBE", what=what) for what in ("mesh", "quadrature", "moduli")]
    kept.append(asker.numbers("DESCRIBE", what="facets", group="x1"))
    return [*kept, asker.numbers("DESCRIBE", what="group", group="all")]


def select(asker: Partner, block: Block, fields: str = "u") -> Script:
    """Select a set of each role; return what is known of them."""
    return [asker.numbers("SELECT", set="moved", role="prescribe", id=block.top, fields=fields),
            asker.numbers("SELECT", set="pushed", role="load", id=block.side),
            asker.numbers("SELECT", set="all", role="report", id=block.nodes, fields=fields),
            ]  # fmt: skip


def weigh(asker: Partner, block: Block, points: int) -> Script:
    """Weights of points, and factors on masses."""
    value = block.rng.uniform(0.5, 1.0, points)
    value[: points // 4] = 0.0
    return [asker.numbers("SET", what="quad_weight", value=value),
            asker.numbers("SET", what="mass_factor", set="all",
                          value=block.rng.uniform(0.5, 1.5, len(block.nodes)))]  # fmt: skip


def set_elastic(asker: Partner, block: Block) -> Script:
    """Give some elements other moduli, all points a stress, some nodes another place."""
    some = np.arange(2, block.elements, 3)
    stress = block.rng.normal(scale=100.0, size=(8 * block.elements, 6))
    node = block.side[:3]
    kept = [asker.numbers("SET", what="moduli", element=some, young=np.full(len(some), 8.0e6),
                          poisson=np.full(len(some), 0.2)),
            asker.numbers("SET", what="initial_stress", value=stress),
            asker.numbers("SET", what="places", node=node,
                          x=block.mesh.x[node - 1] + [0.005, 0.0, 0.0]),
            asker.numbers("SET", what="dead_load", set="pushed",
                          force=block.pushes(block.side))]  # fmt: skip
    return kept + weigh(asker, block, 8 * block.elements)


def set_springs(asker: Partner, block: Block) -> Script:
    """Springs at the middles of facets."""
    facet = asker.ask("DESCRIBE", what="facets", group="x1").fields["connectivity"]
    return [asker.numbers("SET", what="springs", node=facet[:, :4], weight=np.full((len(facet), 4),
                          0.25), stiffness=np.linspace(1.0e3, 2.0e3, len(facet)))]  # fmt: skip


def advance(asker: Partner, block: Block) -> Script:
    """Steps of its own, one of which is rejected, and a checkpoint."""
    kept = [asker.numbers("READY")]
    for k in (1, 2, 2, 3):
        told = {"moved.u": block.way(k, block.top), "pushed.force": k * block.pushes(block.side)}
        kept.append(asker.numbers("ADVANCE", (k - 1) * STEP, k * STEP, **told))
        asker.ask("REJECT" if len(kept) == 3 else "ACCEPT")
    asker.ask("CHECKPOINT", tag="kept")
    return kept


def solve(asker: Partner, block: Block) -> Script:
    """Steps of a system of equations, one of which is rejected."""
    kept = [asker.numbers("READY")]
    for k in (1, 2, 2, 3):
        told = {"moved.u": block.way(20 * k, block.top),
                "pushed.force": k * block.pushes(block.side)}  # fmt: skip
        kept.append(asker.numbers("SOLVE", (k - 1) * 1e-3, k * 1e-3, **told))
        asker.ask("REJECT" if len(kept) == 3 else "ACCEPT")
    return [*kept, asker.numbers("DESCRIBE", what="quadrature")]


def step_together(asker: Partner, block: Block, size: float = 1.0) -> Script:
    """Kicks and drifts with forces of all scopes in between."""
    kept = [asker.numbers("READY")]
    for k in range(1, 5):
        t0, t1 = (k - 1) * STEP, k * STEP
        told = {"moved.u": size * block.way(k, block.top)}
        for scope in ("all", "interface", "balance", "loads"):
            kept.append(asker.numbers("FORCE", t0, t1, scope=scope, **told))
        kept.append(asker.numbers("FORCE", t0, t1, scope="interface", set="moved", **told))
        told["pushed.force"] = block.pushes(block.side)
        kept.append(asker.numbers("KICK_DRIFT", t0, t1, kick=STEP, drift=STEP, **told))
        kept.append(asker.numbers("KICK_DRIFT", t1, t1, kick=0.5 * STEP, drift=0.0, **told))
        asker.ask("ACCEPT")
    return kept


def elastic(asker: Partner, block: Block, steps: Callable, springs: bool) -> Script:
    """Describe, select, set, step, describe."""
    kept = describe(asker) + select(asker, block) + set_elastic(asker, block)
    if springs:
        kept += set_springs(asker, block)
    return kept + steps(asker, block) + describe(asker)


def plastic(asker: Partner, block: Block, steps: Callable) -> Script:
    """Begin from a stress, and yield."""
    kept = describe(asker) + select(asker, block)
    stress = np.tile([-200.0, -200.0, -300.0, 0.0, 0.0, 0.0], (8 * block.elements, 1))
    kept.append(asker.numbers("SET", what="initial_stress", value=stress))
    kept += steps(asker, block)
    return kept + describe(asker)


def polar(asker: Partner, block: Block, fields: str = "u,phi") -> Script:
    """Prescribe turns, or micro-deformations, and step together."""
    kept = describe(asker) + select(asker, block, fields) + weigh(asker, block, 8 * block.elements)
    return kept + step_together(asker, block)


RUNS = {
    "explicit": (dict(kind="explicit", law=ELASTIC, more=RAYLEIGH),
                 lambda a, b: elastic(a, b, advance, True)),
    "together": (dict(kind="explicit", law=ELASTIC),
                 lambda a, b: elastic(a, b, step_together, False)),
    "newmark": (dict(kind="newmark", law=ELASTIC), lambda a, b: elastic(a, b, solve, True)),
    "hht": (dict(kind="hht", law=ELASTIC, more=", alpha = -0.1"),
            lambda a, b: elastic(a, b, solve, True)),
    "static": (dict(kind="static", law=ELASTIC), lambda a, b: elastic(a, b, solve, True)),
    "yielding": (dict(kind="static", law=PLASTIC, more=", tolerance = 1.0e-13", follower=".true."),
                 lambda a, b: plastic(a, b, solve)),
    "yielding_together": (dict(kind="explicit", law=PLASTIC),
                          lambda a, b: plastic(a, b, lambda p, q: step_together(p, q, 20.0))),
    "polar": (dict(kind="explicit", law=POLAR, element="hex8/hex8"), polar),
    "micromorphic": (dict(kind="explicit", law=MICRO, element="hex8/hex8", group="micromorphic"),
                     lambda a, b: polar(a, b, "u,chi")),
}  # fmt: skip


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("name", RUNS)
def test_replies_are_those_of_one_rank(name: str, ranks: int, tmp_path: Path) -> None:
    """Every number of every reply, over the largest of its name."""
    deck, script = RUNS[name]
    kept = {}
    for count in (0, ranks):
        block = Block()
        write_input(tmp_path / str(count), block.mesh, **deck)
        kept[count] = talk("talus-fem", tmp_path / str(count), count,
                           lambda asker, block=block: script(asker, block))  # fmt: skip
    moved = max_of(np.abs(a["all.u"]).max() for a in kept[0] if "all.u" in a)
    assert moved > 1e-7
    compare(kept[0], kept[ranks])


def err(asker: Partner, block: Block) -> list[dict[str, bytes]]:
    """Ask for what cannot be, of elements of one rank or another."""
    select(asker, block)
    kept = []
    for e in (1, block.elements):
        kept.append(asker.fault("SET", what="moduli", element=np.array([e]), young=np.array([-1.0]),
                                poisson=np.array([0.3])))  # fmt: skip
    facet = block.top[None, [0, 1, 2, 8]]
    kept.append(asker.fault("SET", what="springs", node=facet, weight=np.full((1, 4), 0.25),
                            stiffness=np.ones(1)))  # fmt: skip
    kept.append(asker.fault("SET", what="quad_weight", value=np.ones(7)))
    kept.append(asker.fault("DESCRIBE", what="group", group="none"))
    asker.ask("READY")
    return kept


def begin_wrong(asker: Partner, block: Block) -> list[dict[str, bytes]]:
    """Begin outside the yield surface, in one element."""
    kept = []
    for e in (1, block.elements):
        stress = np.zeros((8 * block.elements, 6))
        stress[8 * e - 3] = [1.0e3, 1.0e3, 1.0e3, 0.0, 0.0, 0.0]
        kept.append(asker.fault("SET", what="initial_stress", value=stress))
    asker.ask("READY")
    return kept


def turn_inside_out(asker: Partner, block: Block) -> list[dict[str, bytes]]:
    """Push a corner through its element, which ends the run."""
    corner = block.top[-1:]
    asker.ask("SELECT", set="corner", role="prescribe", id=corner, fields="u")
    asker.ask("READY")
    told = {"corner.u": np.array([[0.0, 0.0, -0.3]])}
    return [asker.fault("FORCE", scope=scope, **told) for scope in ("interface", "all")]


@pytest.mark.parametrize(
    ("law", "script", "code"),
    [(ELASTIC, err, 0), (PLASTIC, begin_wrong, 0), (FINITE, turn_inside_out, 2)],
)
def test_faults_are_those_of_one_rank(
    law: str, script: Callable, code: int, tmp_path: Path
) -> None:
    """The fault of one rank is that of all, word for word, and so is the end of the run."""
    kept = []
    for count in (0, 3):
        block = Block()
        write_input(tmp_path / str(count), block.mesh, kind="explicit" if code else "static",
                    law=law)  # fmt: skip
        kept.append(talk("talus-fem", tmp_path / str(count), count,
                         lambda asker, block=block: script(asker, block), code))  # fmt: skip
    assert kept[0] == kept[1]
    assert len({fault["error.message"] for fault in kept[0]}) >= len(kept[0]) - 1
