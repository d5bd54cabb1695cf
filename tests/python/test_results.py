"""Results: histories, field files, figures, VTU series, report; tools that judge."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from talus import fields, histories, overlap_plots, plots, sets_picture
from talus.cli import main
from talus.faults import FaultError
from talus.verification import read_history

ROOT = Path(__file__).resolve().parents[2]
PNG = b"\x89PNG"


def write_grains(path: Path, moved: float) -> None:
    """Write a field file with two steps: a free grain, a wall grain that moves, a driven one."""
    with h5py.File(path, "w") as file:
        for step in (0, 1):
            group = file.create_group(f"steps/{step:06d}")
            group.attrs["time"] = 0.5 * step
            ids = np.array([3, 1, 2])
            x = np.array([[0.0, 0.0, 2.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]) * 1e-2
            x[2, 0] += moved * step
            grains = group.create_group("grains")
            grains["id"], grains["x"], grains["kind"] = ids, x, np.array([2, 0, 1], np.int32)
            grains["axes"], grains["v"] = np.full((3, 3), 1e-3), np.zeros((3, 3))
            grains["quat"] = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))


def test_history(tmp_path: Path) -> None:
    """Names without units are keys; an unfinished last row is skipped, a broken one is not."""
    path = tmp_path / "run_energy.csv"
    path.write_text("time [s],kinetic [J],note x [-]\n0,1.5E+000,2\n1.0,2.5,3\n2.0,3.")
    history = histories.read(path)
    assert history["time"].tolist() == [0.0, 1.0]
    assert history["kinetic"].tolist() == [1.5, 2.5]
    assert history.of_unit("J") == ["kinetic"]
    with pytest.raises(FaultError, match="no column 'work'"):
        history["work"]
    path.write_text("time [s],kinetic [J]\n0,1\n1,oops\n2,3\n")
    with pytest.raises(FaultError, match="run_energy.csv:3"):
        histories.read(path)
    path.write_text("time [s],kinetic [J]\n0,1\n2,1\n1,4\n3,5\n")
    with pytest.raises(FaultError, match="runs back from 2 to 1 s"):
        histories.read(path)
    path.write_text("time [s],kinetic [J]\n0,1\n1,4\n")
    assert read_history(path)["kinetic"].tolist() == [1.0, 4.0]
    path.write_text("hello\n")
    with pytest.raises(FaultError, match="E545"):
        histories.read(path)


def test_history_of_another_editor(tmp_path: Path) -> None:
    """A byte order mark is no part of a name; a table of NaN alone is no history."""
    path = tmp_path / "run_energy.csv"
    path.write_bytes(b"\xef\xbb\xbftime [s],kinetic [J]\r\n0,1\r\n1,nan\r\n")
    assert histories.read(path)["time"].tolist() == [0.0, 1.0]
    path.write_text("time [s],kinetic [J]\n0,nan\n1,nan\n")
    with pytest.raises(FaultError, match="no finite number"):
        histories.read(path)


def test_fields(tmp_path: Path) -> None:
    """Grains come sorted by id; ghosts are fixed grains that moved; steps count from the end."""
    path = tmp_path / "grains.h5"
    write_grains(path, moved=1e-4)
    with fields.FieldFile(path) as file:
        first, last = file.read(0), file.read(-1)
        with pytest.raises(FaultError, match="E544"):
            file.read(2)
    assert last.time == 0.5
    assert last.grains["id"].tolist() == [1, 2, 3]
    assert fields.ghost_rows(first.grains, last.grains).tolist() == [1]
    moved = fields.displacement(first.grains, last.grains)
    assert np.allclose(moved, [[0, 0, 0], [1e-4, 0, 0], [0, 0, 0]])
    with pytest.raises(FaultError, match="E542"):
        fields.FieldFile(tmp_path / "absent.h5")


def test_vtu_series(tmp_path: Path) -> None:
    """Every step becomes a VTU with all fields, and the collection names them with their times."""
    write_grains(tmp_path / "grains.h5", moved=1e-4)
    assert main(["convert", str(tmp_path / "grains.h5"), "-o", str(tmp_path / "vtu")]) == 0
    series = (tmp_path / "vtu/grains.pvd").read_text()
    assert 'timestep="0.5" part="0" file="grains_000001.vtu"' in series
    mesh = meshio.read(tmp_path / "vtu/grains_000001.vtu")
    assert len(mesh.points) == 3
    assert mesh.point_data["id"].tolist() == [1, 2, 3]
    assert mesh.points[1, 0] == pytest.approx(1.01e-2)
    # unturned spheres of 1 mm: the tensor is 1 mm times the unit tensor
    assert np.allclose(mesh.point_data["ellipsoid"], 1e-3 * np.eye(3).ravel())
    assert not list((tmp_path / "vtu").glob("*.tmp*"))


def test_force_curve(tmp_path: Path) -> None:
    """Depth is the way down from the first row; the mean of a straight line is that line."""
    path = tmp_path / "rigid_driven.csv"
    rows = [f"{0.1 * k},7,0,0,{0.05 - 1e-3 * k},0,0,{2.0 * k},0,0,0,0" for k in range(200)]
    head = "time [s],id [-],x [m],y [m],z [m],force_x [N],force_y [N],force_z [N]"
    head += ",moment_x [N m],moment_y [N m],moment_z [N m],work [J]"
    path.write_text("\n".join([head, *rows]) + "\n")
    curve = plots.force_curve(path)
    assert np.allclose(curve["depth"], np.arange(200))
    assert np.allclose(curve["mean"], curve["force"])
    with pytest.raises(FaultError, match="E547"):
        plots.force_curve(path, tool=8)
    out, table = tmp_path / "force.png", tmp_path / "force.csv"
    assert main(["plot", "force", f"{path}=one", "-o", str(out), "--csv", str(table)]) == 0
    assert out.read_bytes().startswith(PNG)
    assert table.read_text().splitlines()[2] == '"one",1,2,2'


def test_ghost_figure_and_report(tmp_path: Path) -> None:
    """Ghosts make a figure, a rigid run says that it has none; the report holds all of a folder."""
    write_grains(tmp_path / "grains.h5", moved=1e-4)
    assert main(["plot", "ghosts", str(tmp_path / "grains.h5"), "-o", str(tmp_path / "g.png")]) == 0
    assert (tmp_path / "g.png").read_bytes().startswith(PNG)
    write_grains(tmp_path / "rigid.h5", moved=0.0)
    with pytest.raises(FaultError, match="E548"):
        plots.ghosts(tmp_path / "rigid.h5")
    facts = {
        "program": "talus-dem",
        "version": "1",
        "exit_code": 2,
        "health": {"energy_error": 1e-9},
    }
    facts["errors"] = [{"code": "N201", "message": "a < b", "place": "", "hint": ""}]
    (tmp_path / "run_summary.json").write_text(json.dumps(facts))
    (tmp_path / "run_energy.csv").write_text("time [s],kinetic [J],closure [J]\n0,0,0\n1,2,1e-9\n")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 2  # the figure, and the ledger made for the page
    assert "numerical fault" in page
    assert "N201: a &lt; b" in page
    assert "1e-09" in page


def test_verify_names_the_nearest_case() -> None:
    """An unknown case is refused with the nearest id."""
    command = [sys.executable, str(ROOT / "tools/verify.py"), "--case", "deposit_smal"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert "no case 'deposit_smal'; did you mean 'deposit_small'?" in done.stderr


def test_style_finds_what_it_must(tmp_path: Path) -> None:
    """Each rule of the style check is broken once and named with its line."""
    folder = tmp_path / "dem"
    folder.mkdir()
    good = "module dem_a\n  implicit none\n  private\n  real, parameter :: b = 1.0_wp ! 2.0 'x\n"
    good += "end module dem_a\n"
    (folder / "dem_a.f90").write_text(good)
    bad = [
        "module dem_c",
        "  use dem_a",
        "  real, pointer :: p",
        "  real, save :: s",
        "  goto 10",
        "  a = 1.5e3 + b('2.0')",
        "  include 'x.h'",
        "  common /c/ d",
        "  " + "x" * 100,
        "end module dem_c",
    ]
    (folder / "dem_b.f90").write_text("\n".join(bad) + "\n")
    command = [sys.executable, str(ROOT / "tools/style.py"), "--root", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    for line, rule in (
        (1, "another name"), (1, "no implicit none"), (1, "no private"), (2, "use without only"),
        (3, "pointer"), (4, "save"), (5, "goto"), (6, "real literal 1.5e3"), (7, "include"),
        (8, "common block"), (9, "line of 102 columns"),
    ):  # fmt: skip
        assert any(t.startswith(f"dem/dem_b.f90:{line}:") and rule in t for t in lines), rule
    assert "2.0" not in done.stdout
    assert "dem_a.f90" not in done.stdout


def test_error_codes_are_listed() -> None:
    """Every code that the package raises stands in errors.toml, and no other."""
    import re
    import tomllib

    listed = tomllib.loads((ROOT / "prepost/errors.toml").read_text())
    used = set()
    for path in (ROOT / "prepost/talus").rglob("*.py"):
        used |= set(re.findall(r'"(E[56]\d\d)"', path.read_text()))
    assert used == set(listed)
    assert all(entry["title"] and entry["explain"] for entry in listed.values())


def test_pins_agree() -> None:
    """A package that two requirement lists name has the same version in both."""
    pins: dict[str, str] = {}
    for path in sorted((ROOT / "prepost").glob("requirements-*.txt")):
        for line in path.read_text().splitlines():
            if line.strip() and not line.startswith("#"):
                name, version = line.strip().lower().replace("_", "-").split("==")
                assert pins.setdefault(name, version) == version, name
    assert {"numpy", "h5py", "pyvista", "pytest"} <= set(pins)


def test_profile_and_sets(tmp_path: Path) -> None:
    """Layers are means of their grains, ghosts left out; a file that holds no sets is refused."""
    place, value = overlap_plots.layers(
        np.array([0.0, 0.01, 1.0, 1.01]), np.array([1.0, 3.0, 5.0, 7.0]), 0.5
    )
    assert np.allclose(place, [0.005, 1.005])
    assert np.allclose(value, [2.0, 6.0])
    assert overlap_plots.chosen_steps(3) == [0, 1, 2]
    assert overlap_plots.chosen_steps(100)[-1] == 99
    grains, out = tmp_path / "grains.h5", tmp_path / "p.png"
    write_grains(grains, 0.0)
    assert main(["plot", "profile", str(grains), "-o", str(out)]) == 0
    assert out.read_bytes().startswith(PNG)
    assert main(["plot", "profile", str(grains), str(grains), "-o", str(out)]) == 1
    sets = tmp_path / "c_sets.h5"
    with h5py.File(sets, "w") as file:
        file.attrs["format"] = "talus-sets"
        file["grains/id"], file["grains/set"] = np.array([1, 3]), np.array([1, 2])
        file["nodes/set"], file["elements/part"] = np.array([1]), np.array([2])
    found = sets_picture.read_sets(sets)
    assert sets_picture.sets_of(found, np.array([3, 2, 1])).tolist() == [2, 0, 1]
    with pytest.raises(FaultError, match="holds no sets"):
        sets_picture.read_sets(grains)
