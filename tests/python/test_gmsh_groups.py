"""Physical groups of gmsh files: all arrive in the mesh, or the file is refused with the reason."""

from pathlib import Path

import gmsh
import h5py
import numpy as np
import pytest

from talus import mesh as meshes
from talus.cli import main
from talus.faults import FaultError
from talus.gmsh_file import from_gmsh

Groups = list[tuple[int, str, int, str]]  # dimension, faces, number, name

# faces of two cubes that meet at x = 1, by the letter and place of their centre
FACES = {"x0": 0.0, "x1": 1.0, "x2": 2.0, "y0": 0.0, "y1": 1.0, "z0": 0.0, "z1": 1.0}
USUAL = [
    (3, "both", 1, "all"), (3, "right", 2, "right"), (2, "z1 x2", 3, "wet"), (2, "z1", 4, "top"),
    (2, "-x0", 5, "all"), (2, "x1", 6, "mid"), (1, "", 7, "edge"), (0, "", 8, "corner"),
]  # fmt: skip


def surfaces(words: str) -> list[int]:
    """Return the tags of faces of the model, negative ones of names with a minus."""
    tags = []
    for word in words.split():
        axis, place = "xyz".index(word.lstrip("-")[0]), FACES[word.lstrip("-")]
        for _, tag in gmsh.model.getEntities(2):
            box = np.reshape(gmsh.model.getBoundingBox(2, tag), (2, 3))[:, axis]
            if np.abs(box - place).max() < 1e-6:
                tags.append(-tag if word.startswith("-") else tag)
    return tags


def write_cubes(path: Path, groups: Groups, parts: int = 0, **options: float) -> None:
    """Mesh two cubes with a common face by 8 hexahedra each, and write them by gmsh."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addBox(1, 0, 0, 1, 1, 1))])
        occ.synchronize()
        for _, tag in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(tag, 3)
        for _, tag in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(tag)
            gmsh.model.mesh.setRecombine(2, tag)
        for _, tag in gmsh.model.getEntities(3):
            gmsh.model.mesh.setTransfiniteVolume(tag)
        volumes = {"both": [1, 2], "left": [1], "right": [2]}
        for dim, words, number, name in groups:
            tags = surfaces(words) if dim == 2 else volumes.get(words, [1])
            gmsh.model.addPhysicalGroup(dim, tags, number, name=name)
        gmsh.model.mesh.generate(3)
        if parts:
            gmsh.model.mesh.partition(parts)
        for name, value in options.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    # gmsh knows a name once in a dimension; other programs may not: a~ becomes a
    path.write_bytes(path.read_bytes().replace(b'~"', b'"'))


def converted(folder: Path) -> meshes.Mesh:
    """Convert a.msh of a folder by the command and read what it made."""
    assert main(["mesh", "convert", str(folder / "a.msh"), "-o", str(folder / "a.h5")]) == 0
    return meshes.read_mesh(folder / "a.h5")


def check_usual(mesh: meshes.Mesh, names: dict[str, str]) -> None:
    """Compare the groups USUAL, by names of this mesh, with the geometry."""
    named = lambda name: names.get(name, name)  # noqa: E731
    assert mesh.count == 16
    assert {k: len(v) for k, v in mesh.volumes.items()} == {
        named("all 3"): 16, named("right"): 8,
    }  # fmt: skip
    middles = mesh.x[mesh.hex8].mean(axis=1)
    assert (middles[mesh.volumes[named("right")], 0] > 1.0).all()
    assert {k: meshes.facet_count(v) for k, v in mesh.facets.items()} == {
        named("wet"): 12, named("top"): 8, named("all 2"): 4,
    }  # fmt: skip
    assert (mesh.x[mesh.facets[named("top")], 2] == 1.0).all()
    assert (mesh.x[mesh.facets[named("all 2")], 0] == 0.0).all()
    wet = mesh.x[mesh.facets[named("wet")]]
    assert (((wet[:, :, 2] == 1.0).all(axis=1)) | ((wet[:, :, 0] == 2.0).all(axis=1))).all()
    assert {k: len(v) for k, v in mesh.nodes.items()} == {
        named("mid"): 9, named("edge"): 3, named("corner"): 1,
    }  # fmt: skip
    assert sorted(mesh.nodes[named("mid")]) == np.flatnonzero(mesh.x[:, 0] == 1.0).tolist()


NAMELESS = {
    "all 3": "volume_1", "right": "volume_2", "wet": "surface_3", "top": "surface_4",
    "all 2": "surface_5", "mid": "surface_6", "edge": "curve_7", "corner": "point_8",
}  # fmt: skip


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_all_groups_arrive(tmp_path: Path, version: float, binary: int, named: bool) -> None:
    """Entities in two groups, names in two dimensions, groups without names, inner surfaces."""
    groups = [(dim, faces, k, name if named else "") for dim, faces, k, name in USUAL]
    write_cubes(tmp_path / "a.msh", groups, MshFileVersion=version, Binary=binary)
    check_usual(converted(tmp_path), {"all 3": "all", "all 2": "all"} if named else NAMELESS)


@pytest.mark.parametrize("binary", [0, 1])
def test_files_with_all_elements(tmp_path: Path, binary: int) -> None:
    """SaveAll writes elements of no group, too: in version 4.1 the groups are those of entities."""
    write_cubes(tmp_path / "a.msh", USUAL, MshFileVersion=4.1, Binary=binary, SaveAll=1)
    check_usual(converted(tmp_path), {"all 3": "all", "all 2": "all"})


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_partitions(tmp_path: Path, version: float, binary: int) -> None:
    """Groups of a mesh that gmsh has parted are those of the whole."""
    write_cubes(tmp_path / "a.msh", USUAL, 2, MshFileVersion=version, Binary=binary)
    check_usual(converted(tmp_path), {"all 3": "all", "all 2": "all"})


def test_one_name_of_two_groups(tmp_path: Path) -> None:
    """Two groups of one dimension and name are one group, which holds each facet once."""
    groups = [(3, "both", 1, "all"), (2, "z1 x0", 3, "wet"), (2, "z1 x2", 4, "wet~")]
    write_cubes(tmp_path / "a.msh", groups)
    assert len(converted(tmp_path).facets["wet"]) == 16


ALL = (3, "both", 1, "all")


@pytest.mark.parametrize(
    ("groups", "options", "code", "text"),
    [
        ([ALL, (2, "x1 z1", 2, "a")], {}, "E524", "of the 12 facets of the group 'a' .* 4 lie in"),
        ([(3, "left", 1, "l"), (2, "x2", 2, "a")], {}, "E529", "9 of the 9 nodes of the group 'a'"),
        ([ALL, (2, "x2", 2, "a/b")], {}, "E529", r"'a/b' \(physical surface 2\) cannot be named"),
        ([ALL, (2, "x2", 2, "a" * 65)], {}, "E529", "cannot be named so"),
        ([ALL, (2, "x2", 2, "a"), (1, "", 3, "a")], {}, "E529", "surface 2.*curve 3.* one group"),
        ([ALL, (2, "x2", 2, "a"), (2, "x1", 3, "a~")], {}, "E529", "surface 2.*surface 3.* one gr"),
        ([ALL, (1, "", 2, "a"), (0, "", 3, "a")], {}, "E529", "curve 2.*point 3.* one group"),
        ([ALL, (2, "x2", 2, ""), (2, "x0", 3, "surface_2")], {}, "E529", "surface 2.*surface 3"),
        ([ALL], {"MshFileVersion": 2.2, "SaveAll": 1}, "E529", "'all'.* has no elements"),
        ([ALL], {"MshFileVersion": 4.0}, "E520", "version 4.0"),
    ],
)  # fmt: skip
def test_what_would_be_lost_is_refused(
    tmp_path: Path, groups: Groups, options: dict[str, float], code: str, text: str
) -> None:
    """A group that cannot be kept is named with the reason."""
    write_cubes(tmp_path / "a.msh", groups, **options)
    with pytest.raises(FaultError, match=text) as fault:
        from_gmsh(tmp_path / "a.msh")
    assert fault.value.code == code
    assert str(tmp_path / "a.msh") in str(fault.value)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (b'2 2 "top"', b"2 2 top", "in .PhysicalNames"),
        (b'2 2 "top"', b'5 2 "top"', "dimension 5"),
        (b"$EndEntities", b"$EndEntity", "Entities has no end"),
        (b"$EndPhysicalNames\n$Entities\n12 ", b"$EndPhysicalNames\n$Entities\n9999 ", "damaged"),
        (
            b"$EndPhysicalNames\n$Entities\n12 ",
            b"$EndPhysicalNames\n$Entities\n11 ",
            "cannot|damaged|entity",
        ),
    ],
)
def test_damaged_tables(tmp_path: Path, old: bytes, new: bytes, text: str) -> None:
    """A damaged table of groups is fault E520, whatever it says."""
    write_cubes(tmp_path / "a.msh", [ALL, (2, "z1", 2, "top")], MshFileVersion=4.1)
    whole = (tmp_path / "a.msh").read_bytes()
    assert old in whole
    (tmp_path / "a.msh").write_bytes(whole.replace(old, new))
    with pytest.raises(FaultError, match=text) as fault:
        from_gmsh(tmp_path / "a.msh")
    assert fault.value.code == "E520"


def test_facets_off_the_surface_say_why(tmp_path: Path) -> None:
    """Fault E524 of a mesh tells inner facets from those that are no face of an element."""
    good = meshes.box(np.zeros(3), np.ones(3), (2, 1, 1))
    inner = np.flatnonzero(np.isclose(good.x[:, 0], 0.5))[[0, 1, 3, 2]]
    for facet, reason in (
        (inner, "inside the mesh, between elements 1 and 2"),
        (np.array([0, 1, 2, 4]), "is no face of an element"),
    ):
        mesh = meshes.Mesh(good.x, good.hex8, facets={"mid": facet[None]})
        with pytest.raises(FaultError, match=reason):
            meshes.write_mesh(tmp_path / "bad.h5", mesh)


def test_nodes_twice(tmp_path: Path) -> None:
    """The file has each group once: no element, facet or node twice (talus-fem: I310)."""
    write_cubes(tmp_path / "a.msh", USUAL, MshFileVersion=2.2)
    converted(tmp_path)
    with h5py.File(tmp_path / "a.h5") as file:
        rows = file["cells/hex8"][...]
        assert len(np.unique(np.sort(rows, axis=1), axis=0)) == len(rows)
        for group in file["facet_groups"].values():
            facets = np.sort(group["quad4"][...], axis=1)
            assert len(np.unique(facets, axis=0)) == len(facets) == len(group["cell"])
        for folder in ("volume_groups", "node_groups"):
            for group in file[folder].values():
                assert len(np.unique(group[...])) == len(group)


def test_a_group_given_twice(tmp_path: Path) -> None:
    """A file of version 2.2 with all elements and names written twice is the same mesh."""
    write_cubes(tmp_path / "a.msh", USUAL, MshFileVersion=2.2)
    lines = (tmp_path / "a.msh").read_text().splitlines()
    for section in ("PhysicalNames", "Elements"):
        first, last = lines.index(f"${section}") + 2, lines.index(f"$End{section}")
        lines[first - 1] = str(2 * (last - first))
        lines[last:last] = lines[first:last]
    (tmp_path / "a.msh").write_text("\n".join([*lines, ""]))
    check_usual(converted(tmp_path), {"all 3": "all", "all 2": "all"})
