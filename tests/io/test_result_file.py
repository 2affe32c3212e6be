"""Result files: what is read back is what stood in memory; units, shapes, texts; nothing is written over."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, read_result
from flexcam.dynamics import Cause

DATA = Path(__file__).parents[1] / "data"
TIMES = "VTKHDF/Steps/Values"
"""The one quantity among the counts and offsets below Steps."""


@pytest.fixture(scope="module")
def datasets(done):
    """Every dataset of the file by path: shape, type, attributes."""
    found = {}
    with h5py.File(done.path, "r") as file:
        file.visititems(
            lambda n, d: found.update({n: (d.shape, d.dtype, dict(d.attrs))}) if isinstance(d, h5py.Dataset) else None
        )
    return found


def measures(name):
    """Whether a dataset holds physical quantities rather than counts, offsets, node numbers or text."""
    counts = ("VTKHDF/NumberOf", "points/", "about/", "status/", "VTKHDF/CellData/", "VTKHDF/Lines", "VTKHDF/Vertices",
              "VTKHDF/Polygons", "VTKHDF/Strips", "VTKHDF/Steps/", "mesh/points", "VTKHDF/PointData/node",
              "VTKHDF/PointData/axis_")  # fmt: skip
    return name == TIMES or not name.startswith(counts)


@pytest.mark.parametrize("series", ["displacement", "velocity", "acceleration"])
def test_probes_are_exact(done, series):
    for name in ("valve", "cam", "cam.uy"):
        assert np.array_equal(getattr(done.result.response[name], series), getattr(done.response[name], series))


def test_order_of_names_is_kept(done):
    """Columns side by side, and the first name of a node, hang on the order: HDF5 sorts names unless told otherwise."""
    read, kept = done.result.response, done.response
    assert read.outline.channels == kept.outline.channels
    assert list(done.result.mesh.points) == list(done.ready.model.mesh.points)
    assert read.outline.probes == kept.outline.probes
    assert np.array_equal(read.probes.displacement, kept.probes.displacement)


@pytest.mark.parametrize("name", ["time", "angle", "field_time", "field_angle"])
def test_instants_are_exact(done, name):
    assert np.array_equal(getattr(done.result.response, name), getattr(done.response, name))


def test_channels_are_exact(done):
    assert set(done.result.response.channels) == set(done.response.channels) != set()
    for name, values in done.response.channels.items():
        assert np.array_equal(done.result.response.channels[name], values)


def test_fields_are_spread_over_the_nodes(done, nodal):
    """Every unknown at its node and component, in the file itself and as it is read back."""
    node = done.result.still["node"]
    with h5py.File(done.path, "r") as file:
        for name, values in nodal.items():
            stored = file["VTKHDF/PointData"][name][()].reshape(37, len(node), 3)
            assert np.array_equal(stored, values[:, node]), name
            assert np.array_equal(done.result.field(name), values), name


def test_unknowns_come_back_node_after_node(done, nodal):
    read = done.result.response.fields
    for series, names in {
        "displacement": ("displacement", "rotation"), "velocity": ("velocity", "angular_velocity"),
        "acceleration": ("acceleration", "angular_acceleration"),
    }.items():  # fmt: skip
        six = np.concatenate([nodal[name] for name in names], axis=2)
        assert np.array_equal(getattr(read, series), six.reshape(37, -1))


def test_fields_are_not_all_zero(nodal):
    assert all(np.abs(values).max() > 0.0 for values in nodal.values())


def test_status_and_figures(done):
    assert done.result.response.status == done.response.status
    assert done.result.response.stats == done.response.stats
    assert done.result.response.stats.steps == 720


def test_the_case_is_kept_as_written(done):
    case = done.ready.case
    assert done.result.about["case"] == case.text == case.path.read_text(encoding="utf-8")
    assert done.result.about["title"] == "Nodes in the file"
    assert case.path.is_absolute()
    assert done.result.about["case_file"] == case.path.name, "no folder of this machine"
    assert {"flexcam", "python", "numpy", "platform", "created", "resolved", "overrides"} <= set(done.result.about)


def test_the_mesh_is_kept(done):
    mesh, read = done.ready.model.mesh, done.result.mesh
    assert np.array_equal(read.nodes, mesh.nodes)
    assert list(read.lines) == list(mesh.lines), "members in their order"
    for kind in ("lines", "points"):
        assert {n: i.tolist() for n, i in getattr(read, kind).items()} == {
            n: i.tolist() for n, i in getattr(mesh, kind).items()
        }


def test_drawn_radius(done):
    assert sorted(set(done.result.still["radius"])) == [0.004, 0.0125]


def test_h5py_finds_units_on_every_quantity(datasets):
    physical = {name: attrs for name, (_, dtype, attrs) in datasets.items() if dtype.kind in "fi" and measures(name)}
    assert len(physical) > 15
    assert not [name for name, attrs in physical.items() if not str(attrs.get("units", ""))]


@pytest.mark.parametrize(
    ("name", "unit"),
    [("history/time", "s"), ("history/cam_angle", "rad"), ("history/probes/valve/velocity", "m/s"), ("VTKHDF/Points", "m"),
     ("VTKHDF/PointData/rotation", "rad"), ("VTKHDF/PointData/acceleration", "m/s^2"), ("VTKHDF/PointData/angular_velocity", "rad/s"),
     ("VTKHDF/Steps/Values", "s"), ("history/channels/contacts.intake.force", "N"), ("history/channels/contacts.intake.torque", "N m")],
)  # fmt: skip
def test_units(datasets, name, unit):
    assert datasets[name][2]["units"].decode() == unit


@pytest.mark.parametrize(
    "path", ["probes/valve/displacement", "probes/cam/velocity", "channels/contacts.intake.force", "cam_angle"]
)
def test_histories_have_the_time_as_dimension_scale(done, path):
    with h5py.File(done.path, "r") as file:
        scales = [scale.name for scale in file["history"][path].dims[0].values()]
    assert scales == ["/history/time"]


def test_vtk_attributes(done):
    with h5py.File(done.path, "r") as file:
        kind = file["VTKHDF"].attrs.get_id("Type")
        assert kind.dtype.kind == "S", "fixed length: a variable-length string is not read by VTK"
        assert file["VTKHDF"].attrs["Type"] == b"PolyData"
        assert not kind.get_type().is_variable_str()
        assert kind.get_type().get_cset() == h5py.h5t.CSET_ASCII
        assert file["VTKHDF"].attrs["Version"].tolist() == [2, 0]


def test_point_vectors_have_three_components(datasets, nodal):
    """VTK warps a six-component displacement wrongly without a message."""
    shapes = {
        name.rpartition("/")[2]: shape
        for name, (shape, _, _) in datasets.items()
        if name.startswith("VTKHDF/PointData/")
    }
    assert set(nodal) <= set(shapes)
    assert all(shapes[name] == (37 * 6, 3) for name in nodal)
    assert {shape[1] for shape in shapes.values() if len(shape) == 2} == {3}


def test_every_step_has_its_offsets(done, nodal):
    with h5py.File(done.path, "r") as file:
        steps = file["VTKHDF/Steps"]
        assert steps.attrs["NSteps"] == len(steps["Values"]) == 37
        assert all(steps["PointDataOffsets"][name][()].tolist() == list(range(0, 37 * 6, 6)) for name in nodal)
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets", "NumberOfParts"):
            assert len(steps[name]) == 37
            assert np.all(steps[name][()] == (name == "NumberOfParts")), "the mesh is stored once"


def test_a_changed_byte_is_found(done, tmp_path):
    """fletcher32 guards every block of numbers."""
    with h5py.File(done.path, "r") as file:
        at = file["history/probes/valve/displacement"].id.get_chunk_info(0).byte_offset
    damaged = bytearray(done.path.read_bytes())
    damaged[at + 100] ^= 1
    (tmp_path / "damaged.vtkhdf").write_bytes(damaged)
    with pytest.raises(InputError, match="damaged"):
        read_result(tmp_path / "damaged.vtkhdf")


def test_writes_over_nothing_unasked(done, ready, solve_into):
    before = done.path.read_bytes()
    with pytest.raises(InputError, match="overwrite") as refusal:
        solve_into(ready, done.path.parent)
    assert "inline.vtkhdf" in refusal.value.faults[0].given
    assert done.path.read_bytes() == before


class Watch:
    """A sink that looks at the final file after every block."""

    def __init__(self, path):
        self.path, self.seen = path, []

    def write(self, block):
        self.seen.append(self.path.read_bytes())

    def close(self, status, stats):
        self.seen.append(self.path.read_bytes())


def test_a_complete_result_replaces_only_at_the_end(ready, solve_into, tmp_path):
    """The old result stands untouched until the new one is whole; afterwards no partial file is left."""
    _, sink = solve_into(ready, tmp_path)
    old = sink.path.read_bytes()
    watch = Watch(sink.path)
    solve_into(dataclasses.replace(ready), tmp_path, sinks=[watch], overwrite=True)
    assert len(watch.seen) == 3, "two blocks and the end"
    assert all(content == old for content in watch.seen[:-1])
    assert [p.name for p in tmp_path.iterdir()] == ["inline.vtkhdf"]
    assert read_result(sink.path).response.status.cause is Cause.DONE


@pytest.mark.parametrize("content", [b"", b"not hdf", None], ids=["empty", "text", "missing"])
def test_refuses_what_is_no_result(content, tmp_path):
    path = tmp_path / "x.vtkhdf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"x\.vtkhdf"):
        read_result(path)


def test_refuses_foreign_and_newer_files(done, tmp_path):
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["numbers"] = [1, 2]
    newer = tmp_path / "newer.vtkhdf"
    newer.write_bytes(done.path.read_bytes())
    with h5py.File(newer, "r+") as file:
        file["about/format"][()] = "4"
    for path in (tmp_path / "foreign.h5", newer):
        with pytest.raises(InputError, match=path.stem):
            read_result(path)


def test_a_short_run_makes_a_small_file(solve_into, tmp_path):
    """A block may be long, but it is stored in parts: some steps of some 30 histories are kilobytes, not megabytes."""
    ready = prepare(read_case(DATA / "inline.toml", ["output.field_every=5000", "run.revolutions=0.02"]))
    response, sink = solve_into(ready, tmp_path)
    assert len(response.time) < 100 < 5000 <= ready.save.block
    assert sink.path.stat().st_size < 1e6
    assert np.array_equal(read_result(sink.path).response.time, response.time)
