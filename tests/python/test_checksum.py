"""Checksums of packings and meshes: damage is found, meant changes are accepted."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from talus import cli, mesh
from talus.checksum import check_checksum, crc64, created, edited, has_checksum
from talus.faults import FaultError
from talus.packing import make_packing, read_h5, write_h5


def two_grains(path: Path) -> None:
    """Write a packing of two spheres."""
    write_h5(path, make_packing(np.array([[0.0, 0, 0], [3.0, 0, 0]]), np.ones((2, 3))))


def test_check_value() -> None:
    """The catalogue's check value of CRC-64/XZ, in one part and in two."""
    assert crc64(b"123456789") == 0x995DC9BBDF1939FA
    assert crc64(b"6789", crc64(b"12345")) == 0x995DC9BBDF1939FA


def test_damage_is_refused(tmp_path: Path) -> None:
    """A flipped bit anywhere and a file cut off are E508."""
    path = tmp_path / "p.h5"
    two_grains(path)
    whole = path.read_bytes()
    for place in np.random.default_rng(1).integers(0, len(whole), 40):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        with pytest.raises(FaultError, match="truncated or damaged") as caught:
            read_h5(path)
        assert caught.value.code == "E508"
    path.write_bytes(whole[:-1])
    with pytest.raises(FaultError, match="truncated or damaged"):
        read_h5(path)
    path.write_bytes(whole)
    assert read_h5(path).count == 2


def test_changes_that_are_meant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A change by another program is refused until `talus checksum` accepts it."""
    path = tmp_path / "p.h5"
    two_grains(path)
    with h5py.File(path, "r+") as file:
        file["grains/x"][1, 0] = 4.0
    assert cli.main(["pack", "h52text", str(path), "-o", str(tmp_path / "p.txt")]) == 1
    assert "E508" in capsys.readouterr().err
    assert cli.main(["checksum", str(path)]) == 0
    assert read_h5(path).x[1, 0] == 4.0
    with edited(path) as file:
        file["grains/x"][1, 0] = 5.0
    assert read_h5(path).x[1, 0] == 5.0


def test_files_without(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files of other programs are read without a checksum, and get none."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = 1.0
    check_checksum(tmp_path / "a.h5")
    assert not has_checksum(tmp_path / "a.h5")
    assert cli.main(["checksum", str(tmp_path / "a.h5")]) == 0
    assert "has no checksum" in capsys.readouterr().out
    assert cli.main(["checksum", str(tmp_path / "none.h5")]) == 1


def test_damaged_beyond_reading(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that HDF5 cannot open gets no new checksum."""
    path = tmp_path / "a.h5"
    with created(path) as file:
        file["x"] = 1.0
    path.write_bytes(path.read_bytes()[:900])
    assert cli.main(["checksum", str(path)]) == 1
    assert "is damaged" in capsys.readouterr().err


def test_meshes_have_one(tmp_path: Path) -> None:
    """A mesh is checked like a packing."""
    path = tmp_path / "m.h5"
    mesh.write_mesh(path, mesh.box(np.zeros(3), np.ones(3), (1, 1, 1)))
    assert has_checksum(path)
    mesh.read_mesh(path)
    path.write_bytes(path.read_bytes() + b"x")
    with pytest.raises(FaultError, match="checksum differs"):
        mesh.read_mesh(path)
