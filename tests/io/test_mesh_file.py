"""Gmsh files: exact round trip, formats 2.2 and 4.1, and refused files."""

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam import InputError, Mesh, read_mesh, write_mesh

AWKWARD = [
    [0.1, 1.0 / 3.0, -1e-17],
    [np.nextafter(1.0, 2.0), 2.0e5, 0.3],
    [np.pi, -0.0, 7e-9],
    [1.0, 2.0, 3.0],
    [4.0, 5.0, 6.0],
]


def assert_same(read, mesh):
    assert np.array_equal(read.nodes, mesh.nodes)
    for kind in ("lines", "points"):
        expected, found = getattr(mesh, kind), getattr(read, kind)
        assert list(found) == list(expected)
        for name, index in expected.items():
            assert found[name].tolist() == index.tolist(), name


def round_trip(mesh, folder):
    write_mesh(mesh, folder / "mesh.msh")
    return read_mesh(folder / "mesh.msh")


@pytest.mark.parametrize(
    ("lines", "points"),
    [
        ({"shaft": [0, 1, 2], "rod": [3, 4]}, {"drive": [0], "bearings": [0, 2], "tip": [4]}),
        ({"backwards": [4, 2, 0], "rod": [3, 1]}, {"tip": [0]}),
        ({"z": [2, 3], "a": [0, 1], "m": [1, 2]}, {"y": [3], "b": [0]}),
        ({"bar": [1, 3]}, {}),
        ({"bar": [0, 4]}, {"one": [4], "two": [4], "three": [0, 4]}),
        ({"two words": [0, 1, 2]}, {"front bearing": [1], "Lager-2_b": [2]}),
    ],
    ids=["plain", "reversed", "order of names", "no points", "one node in three groups", "spaces"],
)  # fmt: skip
def test_mesh_round_trip_is_exact(lines, points, tmp_path):
    mesh = Mesh(AWKWARD, lines, points)
    assert_same(round_trip(mesh, tmp_path), mesh)


def test_round_trip_of_member_and_point_with_same_name(tmp_path):
    """Names of members and of points are separate."""
    mesh = Mesh(AWKWARD, {"valve": [0, 1]}, {"valve": [1]})
    assert_same(round_trip(mesh, tmp_path), mesh)


def test_abaqus_file_is_read_by_meshio(tmp_path):
    """Members are ordered element sets, points are node sets, and coordinates are exact."""
    mesh = Mesh(AWKWARD, {"shaft": [0, 1, 2], "rod": [4, 3]}, {"bearings": [0, 2]})
    write_mesh(mesh, tmp_path / "mesh.inp")
    found = meshio.read(tmp_path / "mesh.inp")
    np.testing.assert_array_equal(found.points, AWKWARD)
    pairs = {
        name: [row for block, rows in zip(found.cells, sets, strict=True) for row in block.data[rows].tolist()]
        for name, sets in found.cell_sets.items()
    }
    assert pairs == {"shaft": [[0, 1], [1, 2]], "rod": [[4, 3]]}
    assert {name: rows.tolist() for name, rows in found.point_sets.items()} == {"bearings": [0, 2]}
    assert "TYPE=B31\n" in (tmp_path / "mesh.inp").read_text()


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_random_mesh_round_trip_is_exact(data, tmp_path_factory):
    thirds = st.integers(-3_000_000, 3_000_000).map(lambda n: n / 3.0)  # all digits, and no coincident nodes
    nodes = data.draw(st.lists(st.lists(thirds, min_size=3, max_size=3), min_size=3, max_size=8, unique_by=tuple))
    order = data.draw(st.permutations(range(len(nodes))))
    cut = data.draw(st.integers(2, len(nodes)))
    points = {"all": sorted(order[:cut]), "last": [order[-1]]}
    lines = {"first": order[:cut], "second": order[cut - 2 :]} if cut < len(nodes) else {"first": order}
    mesh = Mesh(nodes, lines, points)
    assert_same(round_trip(mesh, tmp_path_factory.mktemp("any")), mesh)


GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
0 2 "front"
0 3 "rear"
1 1 "shaft"
$EndPhysicalNames
$Entities
2 1 0 0
1 0 0 0 1 2
2 0.5 0 0 1 3
1 0 0 0 0.5 0 0 1 1 2 1 -2
$EndEntities
$Nodes
3 3 1 3
0 1 0 1
1
0 0 0
0 2 0 1
2
0.5 0 0
1 1 0 1
3
0.25 0 0
$EndNodes
$Elements
3 4 1 4
0 1 15 1
1 1
0 2 15 1
2 2
1 1 1 2
3 1 3
4 3 2
$EndElements
"""


def test_gmsh_4_1_is_read(tmp_path):
    path = tmp_path / "shaft.msh"
    path.write_text(GMSH_41)
    mesh = read_mesh(path)
    assert mesh.nodes[mesh.lines["shaft"]][:, 0].tolist() == [0.0, 0.25, 0.5]
    assert [mesh.nodes[mesh.node(name), 0] for name in ("front", "rear")] == [0.0, 0.5]


HEAD = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 1 "bar"\n$EndPhysicalNames\n'
FOUR = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 2 0 0\n4 1 1 0\n$EndNodes\n"


def gmsh(*elements):
    rows = "\n".join(f"{i} {row}" for i, row in enumerate(elements, start=1))
    return f"{HEAD}{FOUR}$Elements\n{len(elements)}\n{rows}\n$EndElements\n"


LINE = "1 2 1 1"  # a line in group 1
INVALID = {
    "branched": (gmsh(f"{LINE} 1 2", f"{LINE} 2 3", f"{LINE} 2 4"), "chain"),
    "closed": (gmsh(f"{LINE} 1 2", f"{LINE} 2 3", f"{LINE} 3 1"), "chain"),
    "gap": (gmsh(f"{LINE} 1 2", f"{LINE} 3 4"), "chain"),
    "chain and loop": (gmsh(f"{LINE} 1 2", f"{LINE} 3 4", f"{LINE} 4 3"), "chain"),
    "line twice": (gmsh(f"{LINE} 1 2", f"{LINE} 1 2"), "chain"),
    "unnamed group": (gmsh(f"{LINE} 1 2", "1 2 7 7 2 3"), "physical"),
    "no group": (gmsh("1 2 0 1 1 2"), "physical"),
    "triangle": (gmsh(f"{LINE} 1 2", "2 2 1 1 1 2 4"), "lines"),
    "second order": (gmsh("8 2 1 1 1 3 2"), "lines"),
    "points only": (gmsh("15 2 1 1 1"), "line"),
    "not gmsh": ("solid ascii\nfacet\n", "Gmsh"),
    "empty": ("", "Gmsh"),
    "cut": (gmsh(f"{LINE} 1 2")[:120], "mesh"),
    "node that is not there": (gmsh(f"{LINE} 1 9"), "mesh"),
    "not a number": (gmsh(f"{LINE} 1 2").replace("2 1 0 0", "2 nan 0 0"), "finite"),
}


@pytest.mark.parametrize("case", INVALID)
def test_invalid_mesh_is_refused(case, tmp_path, capfd):
    text, word = INVALID[case]
    path = tmp_path / "bad.msh"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read_mesh(path)
    assert word in str(refusal.value)
    assert not any(capfd.readouterr()), "output of meshio is printed"


@pytest.mark.parametrize("name", ["nothere.msh", "mesh.vtu", "mesh.xdmf"])
def test_missing_file_and_other_formats_are_refused(name, tmp_path):
    with pytest.raises(InputError, match=name):
        read_mesh(tmp_path / name)


def test_existing_mesh_is_not_overwritten(tmp_path):
    path = tmp_path / "mesh.msh"
    path.write_text("mine")
    with pytest.raises(InputError, match=r"mesh\.msh"):
        write_mesh(Mesh(AWKWARD, {"bar": [0, 1]}, {}), path)
    assert path.read_text() == "mine"
