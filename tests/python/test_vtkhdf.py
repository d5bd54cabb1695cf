"""VTKHDF files are read back by VTK's own reader: all times, points, cells and fields."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import mesh as meshes
from talus.cli import main
from talus.elements import KINDS, VTK
from talus.orders import converted

hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
TIMES = (0.0, 0.25, 1.5)


def numbers(array: object) -> np.ndarray:
    """Return an array of VTK."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(array)


def steps_of(path: Path) -> list[tuple[float, object]]:
    """Return times and grids of a file, by VTK."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    found = []
    for time in reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()):
        reader.UpdateTimeStep(time)
        grid = reader.GetOutputDataObject(0).NewInstance()
        grid.DeepCopy(reader.GetOutputDataObject(0))
        found.append((time, grid))
    return found


def write_steps(path: Path, steps: list[dict], mesh: meshes.Mesh | None = None) -> Path:
    """Write a field file with a step at each of TIMES."""
    with h5py.File(path, "w") as file:
        if mesh:
            file["mesh/x"] = mesh.x
            for kind, rows in mesh.cells.items():
                file[f"mesh/{kind}"] = rows.astype(np.int32)
        for k, fields in enumerate(steps):
            step = file.create_group(f"steps/{k:06d}")
            step.attrs["time"] = TIMES[k]
            for name, values in fields.items():
                step[name] = values
    return path


def grains(ids: list[int]) -> dict[str, np.ndarray]:
    """Return grains of a step: places by id, semi-axes along z, x, y."""
    n, number = len(ids), np.array(ids)
    quat = np.tile([0.5, 0.5, 0.5, 0.5], (n, 1))
    fields = {"id": number, "kind": np.zeros(n, np.int32), "quat": quat, "x": number[:, None]
              * [1.0, 2.0, 3.0], "axes": np.tile([3.0, 2.0, 1.0], (n, 1)),
              "v": number[:, None] * np.array([-1.0, 0.5, 4.0])}  # fmt: skip
    return {f"grains/{name}": values for name, values in fields.items()}


def test_grains_that_come_and_go(tmp_path: Path) -> None:
    """Each step has its own grains; the glyph's tensor is that of turned ellipsoids."""
    sets = [[4, 2, 9], [2, 9], [1, 2, 3, 4, 5]]
    source = write_steps(tmp_path / "grains.h5", [grains(ids) for ids in sets])
    target = tmp_path / "grains.vtkhdf"
    assert main(["convert", str(source), "--to", "vtkhdf", "-o", str(target)]) == 0
    found = steps_of(target)
    assert [time for time, _ in found] == list(TIMES)
    for ids, (_, grid) in zip(sets, found, strict=True):
        number = np.array(sorted(ids))
        data = grid.GetPointData()
        assert grid.GetNumberOfCells() == len(ids) and grid.GetCellType(0) == 1
        assert np.array_equal(numbers(data.GetArray("id")), number)
        assert np.array_equal(numbers(grid.GetPoints().GetData()), number[:, None] * [1, 2, 3])
        assert np.array_equal(numbers(data.GetArray("v")), number[:, None] * [-1.0, 0.5, 4.0])
        # a turn by 120 degrees about (1, 1, 1): x to y, y to z, z to x
        tensor = numbers(data.GetArray("ellipsoid"))[0].reshape(3, 3)
        assert np.allclose(tensor @ tensor, np.diag([1.0, 9.0, 4.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_solid(kind: str, tmp_path: Path) -> None:
    """Kinds, nodes of the elements and both sorts of fields; the mesh is there once."""
    mesh = converted(meshes.box(np.zeros(3), np.ones(3), (2, 1, 1)), kind)
    rows, n = mesh.cells[kind], len(mesh.x)
    u = [k * np.arange(3.0 * n).reshape(n, 3) for k in range(3)]
    stress = [k + np.arange(6.0 * len(rows)).reshape(len(rows), 6) for k in range(3)]
    fields = [{"u": a, "stress": b} for a, b in zip(u, stress, strict=True)]
    source = write_steps(tmp_path / "solid.h5", fields, mesh)
    target = tmp_path / "solid.vtkhdf"
    assert main(["convert", str(source), "--to", "vtkhdf", "-o", str(target)]) == 0
    with h5py.File(target) as file:
        assert len(file["VTKHDF/Points"]) == n
        assert file["VTKHDF/Connectivity"].dtype == file["VTKHDF/Offsets"].dtype
    for k, (time, grid) in enumerate(steps_of(target)):
        assert time == TIMES[k] and grid.GetNumberOfCells() == len(rows)
        assert np.array_equal(numbers(grid.GetPoints().GetData()), mesh.x)
        cells = numbers(grid.GetCells().GetConnectivityArray()).reshape(rows.shape)
        assert np.array_equal(cells, rows) and grid.GetCellType(1) == VTK[kind]
        assert np.array_equal(numbers(grid.GetPointData().GetArray("u")), u[k])
        assert np.array_equal(numbers(grid.GetCellData().GetArray("stress")), stress[k])


def test_volumes(tmp_path: Path) -> None:
    """VTK finds the volume of the box in elements of each kind: their nodes are in its order."""
    sizes = pytest.importorskip("vtkmodules.vtkFiltersVerdict")
    for kind in ("hex8", "tet4", "wedge6"):
        mesh = converted(meshes.box(np.zeros(3), np.array([2.0, 1.0, 3.0]), (2, 1, 1)), kind)
        source = write_steps(tmp_path / f"{kind}.h5", [{"u": mesh.x}, {"u": mesh.x}], mesh)
        target = tmp_path / f"{kind}.vtkhdf"
        assert main(["convert", str(source), "--to", "vtkhdf", "-o", str(target)]) == 0
        measure = sizes.vtkCellSizeFilter()
        measure.SetInputData(steps_of(target)[0][1])
        measure.Update()
        found = numbers(measure.GetOutput().GetCellData().GetArray("Volume"))
        assert (found > 0.0).all() and np.isclose(found.sum(), 6.0)


def test_faults(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Another ending, steps with other fields: nothing is left behind."""
    mesh = meshes.box(np.zeros(3), np.ones(3), (1, 1, 1))
    source = write_steps(tmp_path / "a.h5", [{"u": mesh.x}, {"v": mesh.x}], mesh)
    assert main(["convert", str(source), "--to", "vtkhdf", "-o", str(tmp_path / "a.vtu")]) == 1
    assert "E555" in capsys.readouterr().err
    assert main(["convert", str(source), "--to", "vtkhdf", "-o", str(tmp_path / "a.vtkhdf")]) == 1
    said = capsys.readouterr().err
    assert "E542" in said and "not all steps have the fields u, v" in said
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
