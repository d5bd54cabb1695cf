"""What the cases of solids share: meshes of all kinds, prescribed fields, the decks for them."""

from pathlib import Path

import numpy as np

from talus.elements import CORNERS
from talus.mesh import Mesh, structured, write_mesh
from talus.orders import converted

MATERIAL = (
    "law = 'micropolar', density = 1.0, lambda = {0!r}, mu = {1!r}, kappa = {2!r}, "
    "alpha = {3!r}, beta = {4!r}, gamma = {5!r}"
)


def shape_of(element: str) -> str:
    """Kind of the cells of an element formulation: hex20 of hex20/hex8."""
    return element.split("/")[0].split("_")[0]


def polar_nodes(mesh: Mesh, element: str) -> np.ndarray:
    """Nodes that have a micro-rotation."""
    if "/" not in element:
        return np.array([], int)
    cells = mesh.cells[shape_of(element)]
    count = CORNERS[shape_of(element)]
    if element.split("/")[1] == shape_of(element):
        count = cells.shape[1]
    return np.unique(cells[:, :count])


def distorted_cube(n: int, kind: str, amount: float = 0.15, seed: int = 2) -> Mesh:
    """Unit cube of n^3 hexahedra with inner nodes moved at random, as elements of a kind."""
    line = np.linspace(0.0, 1.0, n + 1)
    x, hex8 = structured((line, line, line))
    inner = np.all((x > 1e-9) & (x < 1 - 1e-9), axis=1)
    x[inner] += np.random.default_rng(seed).uniform(-amount, amount, size=(inner.sum(), 3)) / n
    return converted(Mesh(x, hex8, {"all": np.arange(len(hex8))}), kind)


def outer_nodes(mesh: Mesh) -> np.ndarray:
    """Nodes on the surface of the unit cube."""
    return np.flatnonzero(np.any((mesh.x < 1e-9) | (mesh.x > 1 - 1e-9), axis=1))


def prescribe(mesh: Mesh, nodes: np.ndarray, u: np.ndarray, phi: np.ndarray | None,
              polar: np.ndarray) -> str:  # fmt: skip
    """Deck lines that move nodes by u (n, 3) and phi (n, 3); adds a group a node to the mesh."""
    has = np.zeros(len(mesh.x), bool)
    has[polar] = True
    lines = ["&curve    id = 'on', times = 0.0, 1.0, values = 0.0, 1.0 /"]
    for n in nodes:
        mesh.nodes[f"n{n}"] = np.array([n])
        values = [(c, u[n, k]) for k, c in enumerate("xyz")]
        if has[n] and phi is not None:
            values += [("r" + c, phi[n, k]) for k, c in enumerate("xyz")]
        lines += [
            f"&motion group = 'n{n}', component = '{c}', curve = 'on', scale = {float(v)!r} /"
            for c, v in values
        ]
    return "\n".join(lines) + "\n"


def save(mesh: Mesh, path: Path) -> None:
    """Write mesh.h5."""
    write_mesh(path, mesh)
