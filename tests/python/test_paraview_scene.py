"""`talus convert --to paraview`: the script that ParaView runs draws the grains as they are."""

import ast
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from talus import cli
from talus.faults import FaultError
from talus.paraview_scene import write_scene

PVPYTHON = shutil.which("pvpython")
SPIN = np.sqrt(0.5)  # quaternion of a quarter turn about z: (SPIN, 0, 0, SPIN)


def grains_of(folder: Path, **more: np.ndarray) -> Path:
    """Write a field file of two ellipsoids, the second turned by a quarter about z, and XDMF."""
    data = {
        "id": np.array([1, 2]),
        "kind": np.array([0, 0]),
        "x": np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]),
        "quat": np.array([[1.0, 0.0, 0.0, 0.0], [SPIN, 0.0, 0.0, SPIN]]),
        "axes": np.array([[1.0e-3, 2.0e-3, 3.0e-3], [1.0e-3, 2.0e-3, 3.0e-3]]),
        "v": np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]),
    } | more
    with h5py.File(folder / "grains.h5", "w") as file:
        step = file.create_group("steps/000000")
        step.attrs["time"] = 0.0
        for name, values in data.items():
            step[f"grains/{name}"] = values
    item = '<DataItem Format="HDF" NumberType="Float" Precision="8" Dimensions="{}">{}</DataItem>'
    place = "grains.h5:/steps/000000/grains/"
    attributes = "".join(
        f'<Attribute Name="{name}" AttributeType="Vector" Center="Node">'
        + item.format("2 3", place + name)
        + "</Attribute>"
        for name in ("axes", "v")
    )
    for k, part in enumerate("wxyz"):
        slab = f'<DataItem Dimensions="3 2" Format="XML">0 {k} 1 1 2 1</DataItem>'
        attributes += (
            f'<Attribute Name="quat_{part}" AttributeType="Scalar" Center="Node">'
            f'<DataItem ItemType="HyperSlab" Dimensions="2">{slab}'
            + item.format("2 4", place + "quat")
            + "</DataItem></Attribute>"
        )
    (folder / "grains.xdmf").write_text(
        '<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>'
        '<Grid Name="steps" GridType="Collection" CollectionType="Temporal">'
        '<Grid Name="000000"><Time Value="0"/>'
        '<Topology TopologyType="Polyvertex" NumberOfElements="2" NodesPerElement="1"/>'
        f'<Geometry GeometryType="XYZ">{item.format("2 3", place + "x")}</Geometry>'
        f"{attributes}</Grid></Grid></Domain></Xdmf>\n"
    )
    return folder / "grains.h5"


def filter_of(scene: Path) -> str:
    """Return the program of the filter that makes tensors of axes and orientations."""
    assigned = [node for node in ast.walk(ast.parse(scene.read_text())) if type(node) is ast.Assign]
    found = [node for node in assigned if ast.unparse(node.targets[0]) == "tensors.Script"]
    return ast.literal_eval(found[0].value)


def test_tensors(tmp_path: Path) -> None:
    """A grain turned by a quarter about z has its first two semi-axes exchanged."""
    source = grains_of(tmp_path)
    assert cli.main(["convert", str(source), "--to", "paraview", "-o", str(tmp_path / "s.py")]) == 0
    with h5py.File(source) as file:
        grains = {name: data[()] for name, data in file["steps/000000/grains"].items()}
    points = grains | {f"quat_{p}": grains["quat"][:, k] for k, p in enumerate("wxyz")}
    made: dict[str, np.ndarray] = {}
    output = SimpleNamespace(append=lambda data, name: made.update({name: data}))
    names = {"inputs": [SimpleNamespace(PointData=points)]}
    exec(filter_of(tmp_path / "s.py"), names | {"output": SimpleNamespace(PointData=output)})
    expected = [[1.0e-3, 2.0e-3, 3.0e-3], [2.0e-3, 1.0e-3, 3.0e-3]]
    for tensor, semi_axes in zip(made["ellipsoid"], expected, strict=True):
        assert np.allclose(tensor.reshape(3, 3), np.diag(semi_axes), rtol=0, atol=1e-17)
    assert np.allclose(made["speed"], [0.0, 5.0])


@pytest.mark.skipif(not PVPYTHON, reason="no ParaView here")
def test_in_paraview(tmp_path: Path) -> None:
    """ParaView's glyphs reach as far as the ellipsoids do."""
    write_scene([grains_of(tmp_path)], tmp_path / "s.py")
    lines = (tmp_path / "s.py").read_text().split("shown = Show")[0].splitlines()
    lines = [text for text in lines if not text.startswith("view")]  # it would want a screen
    ask = "glyphs.UpdatePipeline()\nprint('bounds', *glyphs.GetDataInformation().GetBounds())\n"
    (tmp_path / "ask.py").write_text("\n".join([*lines, ask]))
    done = subprocess.run([PVPYTHON, "ask.py"], cwd=tmp_path, capture_output=True, text=True,
                          timeout=120)  # fmt: skip
    line = next(text for text in done.stdout.splitlines() if text.startswith("bounds"))
    bounds = np.array(line.split()[1:], dtype=float)
    # a sphere of 16 x 12 facets reaches its poles, and its equator to one part in fifty
    expected = [-1.0e-3, 0.012, -2.0e-3, 2.0e-3, -3.0e-3, 3.0e-3]
    assert np.allclose(bounds, expected, rtol=0.02, atol=6e-5), done.stderr


def test_faults(tmp_path: Path) -> None:
    """Without the XDMF file, without shapes, with another ending, nothing is written."""
    target = tmp_path / "s.py"
    source = grains_of(tmp_path)
    with pytest.raises(FaultError, match="no name ending in .py") as fault:
        write_scene([source], tmp_path / "scene.pvsm")
    assert fault.value.code == "E555"
    (tmp_path / "grains.xdmf").unlink()
    with pytest.raises(FaultError, match="no such file: .*grains.xdmf") as fault:
        write_scene([source], target)
    assert fault.value.code == "E650" and "the run writes both" in fault.value.hint
    with h5py.File(source, "a") as file:
        del file["steps/000000/grains/v"]
    with pytest.raises(FaultError, match="holds no shapes and velocities") as fault:
        write_scene([source], target)
    assert fault.value.code == "E651" and not target.exists()
