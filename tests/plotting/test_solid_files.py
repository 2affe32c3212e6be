"""Files of solids: closed STL of correct volume, GLB with the positions of the scene, named blocks in ParaView."""

import json
import math
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case
from flexcam.case.builder import build_model
from flexcam.plotting.scene.mechanism import build_mechanism
from flexcam.plotting.scene.motion import case_motion
from flexcam.plotting.scene.solids import CIRCLE_POINTS, cylinder
from flexcam.plotting.solid_files import Part, collect_parts, write_glb, write_stl, write_vtm
from flexcam.valvetrain import build_structure
from tests.thinning import mostly_slow

pyvista = pytest.importorskip("pyvista")

ROOT = Path(__file__).parents[2]
CASES = ["pushrod-engine/intake", "direct-acting/bucket", "direct-acting/finger", "li/valve-train", "checks/cantilever"]


def build_scene(name, count):
    structure = build_structure(build_model(read_case(ROOT / f"cases/{name}.toml")))
    drawn = build_mechanism(structure)
    return drawn, collect_parts(drawn, case_motion(structure, 100.0, count=count))


def test_volume_of_cylinder(tmp_path):
    """Values in mm, to single precision, with exact facets of a circle."""
    solid = cylinder("mass", np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.25, 0.3]), 0.02)
    (path,) = write_stl(tmp_path, [Part("mass-a", "mass", solid.faces, solid.points[None], None)])
    mesh = pyvista.read(path)
    area = 0.5 * CIRCLE_POINTS * math.sin(2.0 * math.pi / CIRCLE_POINTS) * 20.0**2
    assert mesh.volume == pytest.approx(50.0 * area, rel=1e-5)
    assert mesh.bounds == pytest.approx((80.0, 120.0, 200.0, 250.0, 280.0, 320.0), abs=1e-4)
    assert path.stat().st_size == 84 + 50 * len(solid.faces)


@pytest.mark.parametrize("name", mostly_slow(CASES, 2))
def test_every_part_is_watertight(name, tmp_path):
    _, parts = build_scene(name, 1)
    for path, part in zip(write_stl(tmp_path, parts), parts, strict=True):
        mesh = pyvista.read(path).clean()
        assert (mesh.is_manifold, mesh.n_open_edges) == (True, 0), path.name
        a, b, c = np.moveaxis(part.points[0][part.faces], 1, 0)
        volume = 1e9 * np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
        assert mesh.volume == pytest.approx(volume, rel=1e-4)
        assert volume > 0.0


def read_glb(path):
    """Return the content of a GLB file and its binary part, after a check of all lengths."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    size, kind = struct.unpack_from("<I4s", data, 12)
    content = json.loads(data[20 : 20 + size])
    binary, other = struct.unpack_from("<I4s", data, 20 + size)
    assert (magic, version, length, kind, other) == (b"glTF", 2, len(data), b"JSON", b"BIN\0")
    assert (size % 4, 28 + size + binary, content["buffers"]) == (0, length, [{"byteLength": binary}])
    return content, data[28 + size :]


def read_accessor(content, binary, number):
    """Return the numbers of an accessor, after a check of its bounds."""
    accessor = content["accessors"][number]
    view = content["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    start = view["byteOffset"] + accessor["byteOffset"]
    dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    read = np.frombuffer(binary, dtype, accessor["count"] * width, start).reshape(-1, width)
    assert start + read.nbytes <= view["byteOffset"] + view["byteLength"] <= len(binary)
    if "min" in accessor:
        assert (accessor["min"], accessor["max"]) == (read.min(axis=0).tolist(), read.max(axis=0).tolist())
    return read


@pytest.mark.slow
@pytest.mark.parametrize("name", ["direct-acting/finger"])
def test_targets_and_weights_give_points(name, tmp_path):
    """Base points plus weighted displacements give the points of the scene at every keyframe, with names of parts."""
    drawn, parts = build_scene(name, 8)
    content, binary = read_glb(write_glb(tmp_path / "a.glb", parts, drawn.upwards, "A train"))
    assert [node["name"] for node in content["nodes"]] == [*(part.name for part in parts), "A train"]
    (animation,) = content["animations"]
    (sampler,) = animation["samplers"]
    weights = read_accessor(content, binary, sampler["output"]).reshape(8, 7)
    assert read_accessor(content, binary, sampler["input"]).ravel() == pytest.approx(np.arange(8) / 24.0)
    animated = {channel["target"]["node"] for channel in animation["channels"]}
    for i, part in enumerate(parts):
        mesh = content["meshes"][content["nodes"][i]["mesh"]]
        (primitive,) = mesh["primitives"]
        material = content["materials"][primitive["material"]]
        assert material["name"] == part.kind
        assert np.array_equal(read_accessor(content, binary, primitive["indices"]).reshape(-1, 3), part.faces)
        base = read_accessor(content, binary, primitive["attributes"]["POSITION"])
        targets = [read_accessor(content, binary, target["POSITION"]) for target in primitive.get("targets", [])]
        assert len(targets) == len(mesh.get("weights", [])) == (7 if i in animated else 0)
        for k in range(8):
            moved = base + (np.tensordot(weights[k], targets, 1) if targets else 0.0)
            assert moved == pytest.approx(part.points[k], abs=1e-7)
    assert any(part.name == "valve" or part.name.startswith("valve-") for part in parts)


def test_root_rotates_lift_to_y(tmp_path):
    _, parts = build_scene("checks/cantilever", 1)
    upwards = np.array([0.0, 0.6, 0.8])
    content, _ = read_glb(write_glb(tmp_path / "a.glb", parts, upwards))
    x, y, z, w = content["nodes"][-1]["rotation"]
    turned = upwards + 2.0 * np.cross([x, y, z], np.cross([x, y, z], upwards) + w * upwards)
    assert turned == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert "animations" not in content


@pytest.mark.slow
def test_vtk_reader_reproduces_motion(tmp_path):
    """The glTF reader of VTK, with animation, gives the bounds of all parts at every instant."""
    vtk = pytest.importorskip("vtk")
    drawn, parts = build_scene("pushrod-engine/intake", 6)
    reader = vtk.vtkGLTFReader()
    reader.SetFileName(str(write_glb(tmp_path / "a.glb", parts, drawn.upwards)))
    reader.SetApplyDeformationsToGeometry(True)
    reader.UpdateInformation()
    reader.EnableAnimation(0)
    reader.SetFrameRate(24)
    reader.UpdateInformation()
    for k in range(6):
        reader.UpdateTimeStep(k / 24.0)
        blocks = [pyvista.wrap(reader.GetOutput()).combine(merge_points=False).bounds]
        points = np.concatenate([part.points[k] for part in parts])
        ends = np.column_stack([points.min(axis=0), points.max(axis=0)]).ravel()
        assert blocks[0] == pytest.approx(ends.tolist(), abs=1e-6)


def test_named_blocks_with_fixed_parts_written_once(tmp_path):
    _, parts = build_scene("pushrod-engine/intake", 3)
    collection, *files = write_vtm(tmp_path / "a-solids.pvd", parts, np.array([0.0, 0.5, 1.0]))
    assert sum(path.suffix == ".vtm" for path in files) == 3
    assert sum(path.name.startswith("lobe-intake_") for path in files) == 3
    assert sum(path.name.startswith("seat-valve_") for path in files) == 1
    reader = pyvista.get_reader(collection)
    assert reader.time_values == [0.0, 0.5, 1.0]
    for k, time in enumerate(reader.time_values):
        reader.set_active_time_value(time)
        (blocks,) = reader.read()
        assert blocks.keys() == [part.name for part in parts]
        for part in parts:
            assert np.array_equal(blocks[part.name].points, part.points[k])
            assert np.array_equal(blocks[part.name].regular_faces, part.faces)


SCRIPT = """
import json, sys
from paraview.simple import *
from paraview.servermanager import Fetch

source = PVDReader(FileName=sys.argv[1])
found = []
for time in source.TimestepValues:
    source.UpdatePipeline(time)
    read = Fetch(source)
    names = [read.GetMetaData(i).Get(read.NAME()) for i in range(read.GetNumberOfBlocks())]
    found.append({name: read.GetBlock(i).GetBounds() for i, name in enumerate(names)})
print("TOLD " + json.dumps([list(source.TimestepValues), found]))
"""


@pytest.mark.slow
def test_paraview_shows_named_blocks(pvbatch, tmp_path):
    _, parts = build_scene("direct-acting/finger", 3)
    collection = write_vtm(tmp_path / "a-solids.pvd", parts, np.array([0.0, 0.5, 1.0]))[0]
    (tmp_path / "look.py").write_text(SCRIPT, encoding="utf-8")
    words = [*pvbatch, str(tmp_path / "look.py"), str(collection)]
    run = subprocess.run(words, capture_output=True, text=True, timeout=240)
    lines = [line.removeprefix("TOLD ") for line in run.stdout.splitlines() if line.startswith("TOLD ")]
    assert lines, f"pvbatch ended with {run.returncode}\n{run.stdout}\n{run.stderr}"
    times, found = json.loads(lines[0])
    assert times == [0.0, 0.5, 1.0]
    for k, blocks in enumerate(found):
        assert list(blocks) == [part.name for part in parts]
        for part in parts:
            ends = np.column_stack([part.points[k].min(axis=0), part.points[k].max(axis=0)]).ravel()
            assert blocks[part.name] == pytest.approx(ends.tolist(), abs=1e-12)
