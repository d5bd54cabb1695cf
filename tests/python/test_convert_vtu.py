"""VTU series of solids: all fields that the XDMF file describes, at nodes and elements alike."""

import re
import subprocess
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from talus import mesh as meshes
from talus.cli import main
from talus.faults import FaultError
from talus.fields import convert_to_vtu
from talus.orders import converted
from talus.programs import find_program

DECK = """&run title = 'Cube', t_end = 1.0e-3 /
&mesh file = 'cube.h5' /
&section group = 'all', material = 'soil'ELEMENT /
&support group = 'z0', fix = 'x', 'y', 'z' /
&curve id = 'ramp', times = 0.0, 1.0, values = 0.0, 1.0 /
&traction group = 'z1', value = 0.0, 1.0e3, -1.0e4, curve = 'ramp' /
&analysis kind = 'static', dt = 5.0e-4 /
&output every_time = 5.0e-4, fields = 'points' /
"""
CONE = "friction_deg = 35.0, dilation_deg = 10.0, hardening = 0.5e6"
POLAR = "lambda = 4.0e7, mu = 4.0e7, kappa = 1.0e7, alpha = 0.0, beta = 0.0, gamma = 20.0"
MICRO = (
    "lambda = 29.0e6, mu = 7.0e6, eta = 60.0e6, tau = 10.0e6, kappa = 10.0e6, nu = 8.0e6, "
    "sigma = 5.0e6, taus = 0, 0, 0, 0, 0, 0, 8.0e6, 0, 0, 0, 0, form = 'energy'"
)
BODIES = {
    "plastic": "&material id = 'soil', law = 'drucker_prager', density = 1.8e3, young = 1.0e8, "
    f"poisson = 0.25, cohesion = 2.0, {CONE} /\n",
    "polar": "&material id = 'soil', law = 'micropolar_drucker_prager', density = 1.8e3, "
    f"{POLAR}, cohesion = 2.0, {CONE}, plastic_length = 1.0e-3 /\n",
    "micro": f"&micromorphic id = 'soil', {MICRO} /\n"
    f"&cone level = 'macro', cohesion = 20.0, {CONE} /\n",
}
WANTED = {
    "plastic": {"stress", "plastic_strain", "yield", "hardening", "dissipation"},
    "polar": {"stress", "couple_stress", "plastic_curvature_12", "hardening"},
    "micro": {"stress", "micro_stress", "couple_stress", "z_macro", "plastic_strain"},
}
SIX = ("xx", "yy", "zz", "xy", "yz", "zx")


def described(text: str) -> set[tuple[str, str]]:
    """Return names and centres of the attributes of an XDMF file."""
    return set(re.findall(r'Attribute Name="(\w+)" AttributeType="\w+" Center="(\w+)"', text))


def as_described(name: str, shape: tuple[int, ...], centre: str) -> set[tuple[str, str]]:
    """Return the attributes by which XDMF shows an array, component by component of some."""
    count = shape[1] if len(shape) > 1 else 1
    if count in (1, 3, 9):
        return {(name, centre)}
    return {(f"{name}_{SIX[k] if count == 6 else k + 1}", centre) for k in range(count)}


@pytest.mark.parametrize("body", BODIES)
def test_all_fields_of_a_run(tmp_path: Path, body: str) -> None:
    """VTU has what the run's XDMF file describes, bit for bit, at the same places."""
    meshes.write_mesh(tmp_path / "cube.h5", meshes.box(np.zeros(3), np.full(3, 0.01), (2, 2, 2)))
    element = "" if body == "plastic" else ", element = 'hex8/hex8'"
    (tmp_path / "run.nml").write_text(DECK.replace("ELEMENT", element) + BODIES[body])
    command = [find_program("talus-fem"), "run.nml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    written = convert_to_vtu(tmp_path / "run.h5", tmp_path / "vtu")
    last = meshio.read(written[-2])
    cells = {name: parts[0] for name, parts in last.cell_data.items()}
    assert WANTED[body] <= set(cells)
    found = set()
    with h5py.File(tmp_path / "run.h5") as file:
        step = file["steps"][sorted(file["steps"])[-1]]
        for centre, fields in (("Node", last.point_data), ("Cell", cells)):
            for name, values in fields.items():
                found |= as_described(name, values.shape, centre)
                assert np.array_equal(values, step[name][...]), name
        left = set(step) - set(last.point_data) - set(cells)
    assert found == described((tmp_path / "run.xdmf").read_text())
    assert {"points_x", "stress_points", "state_points"} <= left
    assert all("points" in name for name in left)
    assert cells["yield"].max() == (0.0 if body == "micro" else 1.0)


def field_file(path: Path, mesh: meshes.Mesh, **fields: np.ndarray) -> Path:
    """Write a field file of one step."""
    with h5py.File(path, "w") as file:
        file["mesh/x"] = mesh.x
        for kind, rows in mesh.cells.items():
            file[f"mesh/{kind}"] = rows.astype(np.int32)
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.25
        for name, values in fields.items():
            step[name] = values
    return path


def test_as_many_nodes_as_elements(tmp_path: Path) -> None:
    """Where a field belongs is its own matter, not one of equal numbers."""
    mesh = converted(meshes.box(np.zeros(3), np.ones(3), (2, 1, 1)), "tet4")
    assert len(mesh.x) == mesh.count == 12
    u, stress = np.arange(36.0).reshape(12, 3), np.arange(72.0).reshape(12, 6)
    path = field_file(
        tmp_path / "a.h5", mesh, u=u, stress=stress, stress_nodal=-stress, hardening=u[:, 0],
        stress_points=stress, density=u[:, 1],
    )  # fmt: skip
    made = meshio.read(convert_to_vtu(path, tmp_path / "vtu")[0])
    assert set(made.point_data) == {"u", "stress_nodal"}
    assert set(made.cell_data) == {"stress", "hardening", "density"}
    assert np.array_equal(made.cell_data["hardening"][0], u[:, 0])
    assert np.array_equal(made.point_data["stress_nodal"], -stress)


def test_elements_of_two_kinds(tmp_path: Path) -> None:
    """Fields of elements follow the order of the kinds."""
    one, two = (converted(meshes.box(np.zeros(3), np.ones(3), (1, 1, 1)), kind)
                for kind in ("hex8", "wedge6"))  # fmt: skip
    cells = {"hex8": one.hex8, "wedge6": two.cells["wedge6"] + 8}
    mesh = meshes.Mesh(np.vstack([one.x, two.x + [2.0, 0.0, 0.0]]), cells)
    path = field_file(tmp_path / "a.h5", mesh, hardening=np.array([1.0, 2.0, 3.0]))
    made = meshio.read(convert_to_vtu(path, tmp_path / "vtu")[0])
    parts = dict(zip((block.type for block in made.cells), made.cell_data["hardening"],
                     strict=True))  # fmt: skip
    assert parts["hexahedron"].tolist() == [1.0]
    assert parts["wedge"].tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    ("name", "count", "text"),
    [("u", 8, "27 nodes"), ("hardening", 27, "8 elements"), ("stress_nodal", 64, "27 nodes")],
)
def test_fields_of_another_length(tmp_path: Path, name: str, count: int, text: str) -> None:
    """A field that does not fit its place is refused and nothing is left."""
    mesh = meshes.box(np.zeros(3), np.ones(3), (2, 2, 2))
    path = field_file(tmp_path / "a.h5", mesh, **{name: np.zeros((count, 3))})
    with pytest.raises(FaultError, match=text) as fault:
        convert_to_vtu(path, tmp_path / "vtu")
    assert fault.value.code == "E542"
    assert str(fault.value).count(name) == 1
    assert not list((tmp_path / "vtu").iterdir())


def test_steps_without_anything(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A file with steps, but neither grains nor a mesh, is refused."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_group("steps/000000").attrs["time"] = 0.0
    assert main(["convert", str(tmp_path / "a.h5"), "-o", str(tmp_path / "vtu")]) == 1
    assert "error E543" in capsys.readouterr().err
