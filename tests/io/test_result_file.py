"""Result files: exact round trip, units, shapes and texts; existing files are not overwritten."""

# ruff: noqa: E501 - tables, a row to a line

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, read_result
from flexcam.dynamics import Cause

DATA = Path(__file__).parents[1] / "data"
TIMES = "VTKHDF/Steps/Values"
"""The only physical quantity among the counts and offsets in Steps."""


@pytest.fixture(scope="module")
def datasets(stored):
    """Return shape, type and attributes of all datasets by path."""
    found = {}
    with h5py.File(stored.path, "r") as file:
        file.visititems(
            lambda n, d: found.update({n: (d.shape, d.dtype, dict(d.attrs))}) if isinstance(d, h5py.Dataset) else None
        )
    return found


def is_physical(name):
    """Return whether a dataset contains physical quantities and not counts, offsets, node numbers or text."""
    counts = ("VTKHDF/NumberOf", "points/", "about/", "status/", "VTKHDF/CellData/", "VTKHDF/Lines", "VTKHDF/Vertices",
              "VTKHDF/Polygons", "VTKHDF/Strips", "VTKHDF/Steps/", "mesh/points", "VTKHDF/PointData/node",
              "VTKHDF/PointData/axis_")  # fmt: skip
    return name == TIMES or not name.startswith(counts)


JOINTS = {
    "spring": 'springs.joint={ at = "tappet", to = "cup", direction = "uy", stiffness = "50 MN/m", link = true }',
    "lash": 'contacts.joint={ from = "tappet", to = "cup", direction = "uy", model = "lash", gap = 0, stiffness = "50 MN/m", damping = "1 kN s/m" }',
    "rigid link": 'rigid_links.joint={ from = "tappet", to = ["cup"] }',
}  # fmt: skip


@pytest.mark.parametrize("joint", JOINTS)
def test_result_with_coincident_nodes_can_be_read(joint, solve_into, tmp_path):
    """A spring, a contact or a rigid link may join two nodes at the same place."""
    text = (DATA / "inline.toml").read_text(encoding="utf-8").replace('nodes = ["tappet",', 'nodes = ["cup",')
    text = text.replace("pushrod-top = [", 'cup = ["120 mm", "18 mm", "0 mm"]\npushrod-top = [', 1)
    text = text.replace('tappet = ["ux", "uz", "ry"]', 'tappet = ["ux", "uz", "rx", "ry", "rz"]')
    text = text.replace('model = "published-load"', 'model = "bilateral"\nstiffness = "1 MN/m"')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    overrides = [JOINTS[joint], "run.revolutions=0.02"]
    if joint != "rigid link":
        overrides.append('supports.cup=["ux", "uz", "ry"]')
    _, sink = solve_into(prepare(read_case(tmp_path / "case.toml", overrides)), tmp_path)
    mesh = read_result(sink.path).mesh
    assert mesh.nodes[mesh.node("cup")].tolist() == mesh.nodes[mesh.node("tappet")].tolist()


def test_order_of_names_is_preserved(stored):
    """The order of columns and the first name of a node depend on it: by default HDF5 sorts names."""
    read, expected = stored.result.response, stored.response
    assert read.outline.channels == expected.outline.channels
    assert list(stored.result.mesh.points) == list(stored.ready.model.mesh.points)
    assert read.outline.probes == expected.outline.probes
    assert np.array_equal(read.probes.displacement, expected.probes.displacement)


def test_field_round_trip_is_exact(stored, nodal_vectors):
    """Each unknown is at its node and component, in the file and in the result read back."""
    node = stored.result.constant["node"]
    with h5py.File(stored.path, "r") as file:
        for name, values in nodal_vectors.items():
            file_values = file["VTKHDF/PointData"][name][()].reshape(37, len(node), 3)
            assert np.array_equal(file_values, values[:, node]), name
            assert np.array_equal(stored.result.field(name), values), name
            assert np.abs(values).max() > 0.0, name


def test_unknowns_are_read_in_order_of_nodes(stored, nodal_vectors):
    read = stored.result.response.fields
    for series, names in {
        "displacement": ("displacement", "rotation"), "velocity": ("velocity", "angular_velocity"),
        "acceleration": ("acceleration", "angular_acceleration"),
    }.items():  # fmt: skip
        six = np.concatenate([nodal_vectors[name] for name in names], axis=2)
        assert np.array_equal(getattr(read, series), six.reshape(37, -1))


def test_result_contains_case_text(stored):
    case = stored.ready.case
    assert stored.result.about["case"] == case.text == case.path.read_text(encoding="utf-8")
    assert stored.result.about["title"] == "Nodes in the file"
    assert case.path.is_absolute()
    assert stored.result.about["case_file"] == case.path.name, "the path of this machine is stored"
    assert {"flexcam", "python", "numpy", "platform", "created", "resolved", "overrides"} <= set(stored.result.about)


def test_mesh_round_trip_is_exact(stored):
    mesh, read = stored.ready.model.mesh, stored.result.mesh
    assert np.array_equal(read.nodes, mesh.nodes)
    assert list(read.lines) == list(mesh.lines), "the order of members differs"
    for kind in ("lines", "points"):
        assert {n: i.tolist() for n, i in getattr(read, kind).items()} == {
            n: i.tolist() for n, i in getattr(mesh, kind).items()
        }


def test_result_contains_section_radii(stored):
    assert sorted(set(stored.result.constant["radius"])) == [0.004, 0.0125]


def test_physical_datasets_have_units(datasets):
    physical = {name: attrs for name, (_, dtype, attrs) in datasets.items() if dtype.kind in "fi" and is_physical(name)}
    assert len(physical) > 15
    assert not [name for name, attrs in physical.items() if not str(attrs.get("units", ""))]


UNITS = {
    "history/time": "s", "history/cam_angle": "rad", "history/probes/valve/velocity": "m/s", "VTKHDF/Points": "m",
    "VTKHDF/PointData/rotation": "rad", "VTKHDF/PointData/acceleration": "m/s^2", "VTKHDF/PointData/angular_velocity": "rad/s",
    "VTKHDF/Steps/Values": "s", "history/channels/contacts.intake.force": "N", "history/channels/contacts.intake.torque": "N m",
}  # fmt: skip


def test_datasets_have_units(datasets):
    assert {name: datasets[name][2]["units"].decode() for name in UNITS} == UNITS


def test_dimension_scale_of_histories_is_time(stored):
    with h5py.File(stored.path, "r") as file:
        for path in ("probes/valve/displacement", "channels/contacts.intake.force", "cam_angle"):
            assert [scale.name for scale in file["history"][path].dims[0].values()] == ["/history/time"], path


def test_vtk_attributes_have_required_types(stored):
    with h5py.File(stored.path, "r") as file:
        kind = file["VTKHDF"].attrs.get_id("Type")
        assert kind.dtype.kind == "S", "fixed length: a variable-length string is not read by VTK"
        assert file["VTKHDF"].attrs["Type"] == b"PolyData"
        assert not kind.get_type().is_variable_str()
        assert kind.get_type().get_cset() == h5py.h5t.CSET_ASCII
        assert file["VTKHDF"].attrs["Version"].tolist() == [2, 0]


def test_point_vectors_have_three_components(datasets, nodal_vectors):
    """VTK warps a displacement of six components wrongly, without a message."""
    shapes = {
        name.rpartition("/")[2]: shape
        for name, (shape, _, _) in datasets.items()
        if name.startswith("VTKHDF/PointData/")
    }
    assert set(nodal_vectors) <= set(shapes)
    assert all(shapes[name] == (37 * 6, 3) for name in nodal_vectors)
    assert {shape[1] for shape in shapes.values() if len(shape) == 2} == {3}


def test_all_steps_have_offsets(stored, nodal_vectors):
    with h5py.File(stored.path, "r") as file:
        steps = file["VTKHDF/Steps"]
        assert steps.attrs["NSteps"] == len(steps["Values"]) == 37
        assert all(steps["PointDataOffsets"][name][()].tolist() == list(range(0, 37 * 6, 6)) for name in nodal_vectors)
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets", "NumberOfParts"):
            assert len(steps[name]) == 37
            assert np.all(steps[name][()] == (name == "NumberOfParts")), "the mesh is stored once"


def test_existing_result_is_not_overwritten(stored, ready, solve_into):
    before = stored.path.read_bytes()
    with pytest.raises(InputError, match="overwrite") as refusal:
        solve_into(ready, stored.path.parent)
    assert "inline.vtkhdf" in refusal.value.faults[0].given
    assert stored.path.read_bytes() == before


class FileWatch:
    """Sink that reads the final file after each block."""

    def __init__(self, path):
        self.path, self.contents = path, []

    def write(self, block):
        self.contents.append(self.path.read_bytes())

    def close(self, status, stats):
        self.contents.append(self.path.read_bytes())


def test_result_is_replaced_only_at_end_of_run(ready, solve_into, tmp_path):
    """The old result is unchanged until the new one is complete; afterwards there is no partial file."""
    _, sink = solve_into(ready, tmp_path)
    old = sink.path.read_bytes()
    watch = FileWatch(sink.path)
    solve_into(dataclasses.replace(ready), tmp_path, sinks=[watch], overwrite=True)
    assert len(watch.contents) == 3, "two blocks and the end"
    assert all(content == old for content in watch.contents[:-1])
    assert [p.name for p in tmp_path.iterdir()] == ["inline.vtkhdf"]
    assert read_result(sink.path).response.status.cause is Cause.DONE


@pytest.mark.parametrize("content", [b"", b"not hdf", None], ids=["empty", "text", "missing"])
def test_invalid_or_missing_result_is_refused(content, tmp_path):
    path = tmp_path / "x.vtkhdf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"x\.vtkhdf"):
        read_result(path)


def test_foreign_and_newer_files_are_refused(stored, tmp_path):
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["numbers"] = [1, 2]
    newer = tmp_path / "newer.vtkhdf"
    newer.write_bytes(stored.path.read_bytes())
    with h5py.File(newer, "r+") as file:
        file["about/format"][()] = "4"
    for path in (tmp_path / "foreign.h5", newer):
        with pytest.raises(InputError, match=path.stem):
            read_result(path)


def test_short_run_gives_small_file(solve_into, tmp_path):
    """Long blocks are stored in parts: some steps of about 30 histories take kilobytes, not megabytes."""
    ready = prepare(read_case(DATA / "inline.toml", ["output.field_every=5000", "run.revolutions=0.02"]))
    response, sink = solve_into(ready, tmp_path)
    assert len(response.time) < 100 < 5000 <= ready.save.block
    assert sink.path.stat().st_size < 1e6
    assert np.array_equal(read_result(sink.path).response.time, response.time)
