"""Uniaxial tension of a block 2 x 1 x 1 of distorted elements, kind by kind."""

import numpy as np

from talus import mesh as meshes
from talus.elements import KINDS, VTK
from talus.orders import converted
from talus.verification import Case, field_steps

YOUNG, POISSON, TRACTION = 1.0e6, 0.3, 1.0e4
SIZE = np.array([2.0, 1.0, 1.0])
ROUND_OFF = 1.0e-12  # relative; the solution is exact in the space of every element


def distorted(kind: str) -> meshes.Mesh:
    """A block of one kind; nodes inside are moved, so that edges inside bend."""
    mesh = converted(meshes.box(np.zeros(3), SIZE, (3, 2, 2)), kind)
    bubble = np.prod(mesh.x * (SIZE - mesh.x), axis=1)[:, None]
    mesh.x = mesh.x + bubble * np.array([0.5, -0.35, 0.2])
    return mesh


def mixed() -> meshes.Mesh:
    """A hexahedron beside two wedges."""
    whole = meshes.box(np.zeros(3), SIZE, (2, 1, 1))
    left, right = whole.hex8
    cells = {"hex8": left[None], "wedge6": right[[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]}
    groups = {"all": np.arange(3)}
    return meshes.Mesh(whole.x, cells, groups, {"x1": right[None, [1, 2, 6, 5]]}, whole.nodes)


def run(case: Case) -> None:
    """Judge displacements, stresses, and what VTK reads; plot the errors."""
    errors = {}
    deck = (case.folder / "deck.nml").read_text()
    for name in (*KINDS, "hex27_bbar", "mixed"):
        mesh = mixed() if name == "mixed" else distorted(name.split("_")[0])
        element = name if "_" in name else "auto"
        (case.folder / "deck.nml").write_text(deck.replace("ELEMENT", element))
        meshes.write_mesh(case.folder / "patch.h5", mesh)
        case.run("talus-fem", "deck.nml")
        found = field_steps(case.folder / "deck.h5")[-1].solid
        exact = mesh.x * np.array([1.0, -POISSON, -POISSON]) * TRACTION / YOUNG
        scale = np.abs(exact).max()
        stress = np.array([TRACTION, 0.0, 0.0, 0.0, 0.0, 0.0])
        errors[name] = (
            np.abs(found["u"] - exact).max() / scale,
            np.abs(found["stress"] - stress).max() / TRACTION,
            np.abs(found["stress_nodal"] - stress).max() / TRACTION,
        )
        case.below(f"{name}: relative error of the displacement", errors[name][0], ROUND_OFF)
        case.below(f"{name}: of the stress of elements", errors[name][1], ROUND_OFF)
        case.below(f"{name}: of the nodal stress", errors[name][2], ROUND_OFF)
        case.metric(f"{name}: cells and volume as VTK reads them", *read_back(case, mesh), 1e-12)
    plot(case, errors)


def read_back(case: Case, mesh: meshes.Mesh) -> tuple[float, float]:
    """Volume that VTK finds in the XDMF file (NaN for other cells), and the block's [m3]."""
    import pyvista
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    reader = vtkXdmfReader()
    reader.SetFileName(str(case.folder / "deck.xdmf"))
    reader.Update()
    grid = pyvista.wrap(reader.GetOutputDataObject(0))
    same = all(
        np.array_equal(grid.cells_dict.get(VTK[kind]), rows) for kind, rows in mesh.cells.items()
    )
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    good = same and (sizes > 0.0).all()
    return float(sizes.sum()) if good else float("nan"), float(SIZE.prod())


def plot(case: Case, errors: dict[str, tuple[float, ...]]) -> None:
    """Errors of every kind against round-off."""
    fig, ax = case.figure()
    labels = ("displacement", "stress of elements", "nodal stress")
    for k, (label, mark) in enumerate(zip(labels, "osd", strict=True)):
        ax.semilogy(list(errors), [max(e[k], 1e-17) for e in errors.values()], mark, label=label)
    ax.axhline(ROUND_OFF, color="k", lw=1, label="limit")
    ax.set(xlabel="elements", ylabel="relative error [-]", ylim=(1e-17, 1e-10))
    ax.legend()
    case.save(fig)
