"""Meshes generated and written by Gmsh: formats 2.2 and 4.1, text and binary."""

import os
import signal

import numpy as np
import pytest

from flexcam import InputError, read_mesh

REQUIRED = os.environ.get("FLEXCAM_REQUIRE_GMSH") == "1"

try:
    import gmsh
except (ImportError, OSError) as lacking:
    if REQUIRED:
        raise
    pytest.skip(
        f"GMSH WAS NOT TRIED: {lacking}; pip install gmsh, apt-get install libglu1-mesa", allow_module_level=True
    )

CORNERS = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.4, 0.1), (1.0, 1.0, 1.0), (1.0, 1.0, 0.5)]
FORMATS = [("2.2", 0), ("2.2", 1), ("4.1", 0), ("4.1", 1)]


@pytest.fixture
def model():
    """Make a bent member of 3 + 2 elements with opposite curve directions, a straight one of 4, and three points."""
    broken_pipe = signal.getsignal(signal.SIGPIPE)
    gmsh.initialize(interruptible=False)
    # Gmsh sets SIGPIPE to kill the process; later tests write to processes that they stop.
    signal.signal(signal.SIGPIPE, broken_pipe)
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    points = [geo.addPoint(*corner) for corner in CORNERS]
    curves = [geo.addLine(points[a], points[b]) for a, b in ((0, 1), (2, 1), (3, 4))]
    for curve, parts in zip(curves, (3, 2, 4), strict=True):
        geo.mesh.setTransfiniteCurve(curve, parts + 1)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(1, curves[:2], name="bent rod")
    gmsh.model.addPhysicalGroup(1, curves[2:], name="shaft")
    gmsh.model.addPhysicalGroup(0, [points[0]], name="foot")
    gmsh.model.addPhysicalGroup(0, [points[2], points[4]], name="ends")
    gmsh.model.addPhysicalGroup(0, [points[3]], name="shaft")  # names of members and of points are separate
    yield gmsh
    gmsh.finalize()


def write_mesh_file(gmsh, path, version, binary):
    gmsh.model.mesh.generate(1)
    gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(path))
    return path


def divide_segments(*corners):
    """Return equal segments between corners given as (corner, segments, ...)."""
    ends, parts = np.array(CORNERS)[list(corners[::2])], corners[1::2]
    pieces = [a + (b - a) * np.arange(n)[:, None] / n for a, b, n in zip(ends[:-1], ends[1:], parts, strict=True)]
    return np.concatenate([*pieces, ends[-1:]])


@pytest.mark.parametrize(("version", "binary"), FORMATS)
def test_groups_and_nodes_match_model(model, tmp_path, version, binary):
    """Gmsh rounds the equal parts; a chain may start at either end."""
    mesh = read_mesh(write_mesh_file(model, tmp_path / "bent.msh", version, binary))
    assert set(mesh.lines) == {"bent rod", "shaft"}
    assert set(mesh.points) == {"foot", "ends", "shaft"}
    for name, expected in (("bent rod", divide_segments(0, 3, 1, 2, 2)), ("shaft", divide_segments(3, 4, 4))):
        places = mesh.nodes[mesh.lines[name]]
        forward = places if np.allclose(places[0], expected[0]) else places[::-1]
        assert forward == pytest.approx(expected, abs=1e-10)  # Gmsh places nodes by an integral along the curve
    assert mesh.nodes[mesh.node("foot")].tolist() == list(CORNERS[0])
    assert sorted(mesh.nodes[mesh.points["ends"]].tolist()) == sorted(map(list, (CORNERS[2], CORNERS[4])))


@pytest.mark.parametrize(("version", "binary"), FORMATS)
def test_unnamed_group_is_refused(model, tmp_path, version, binary):
    a, b = model.model.geo.addPoint(5, 0, 0), model.model.geo.addPoint(6, 0, 0)
    line = model.model.geo.addLine(a, b)
    model.model.geo.synchronize()
    model.model.addPhysicalGroup(1, [line], tag=77)
    with pytest.raises(InputError) as refusal:
        read_mesh(write_mesh_file(model, tmp_path / "bent.msh", version, binary))
    assert "line elements in named groups" in str(refusal.value)
