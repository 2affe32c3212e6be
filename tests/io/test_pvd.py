"""ParaView collections: VTK's XML reader finds all exported steps exactly, for any folder name."""

import xml.etree.ElementTree as ET  # flexcam has written the files

import numpy as np
import pytest

from flexcam import InputError
from flexcam.io import write_pvd

pyvista = pytest.importorskip("pyvista")


def test_pyvista_reads_exact_times_and_values(collection, stored, nodal_vectors):
    files, every = collection
    reader = pyvista.get_reader(files[0])
    assert reader.time_values == stored.response.field_time[::every].tolist()
    node = stored.result.constant["node"]
    fields = {name: values[::every, node] for name, values in nodal_vectors.items()}
    for i, time in enumerate(reader.time_values):
        reader.set_active_time_value(time)
        (block,) = reader.read()
        for name, field in fields.items():
            assert np.array_equal(block.point_data[name], field[i]), (i, name)
        assert np.array_equal(block.points, stored.result.mesh.nodes[node])
        assert np.array_equal(block.point_data["radius"], stored.result.constant["radius"])


def test_each_member_is_one_polyline(collection, stored):
    piece = pyvista.read(collection[0][1])
    assert piece.n_cells == piece.n_lines == len(stored.result.mesh.lines)
    node = stored.result.constant["node"]
    along = [node[piece.get_cell(i).point_ids].tolist() for i in range(2)]
    assert along == [line.tolist() for line in stored.result.mesh.lines.values()]
    assert piece.cell_data["member"].tolist() == [0, 1]


def test_returned_files_are_listed_in_collection(collection):
    files, every = collection
    assert len(files) == 1 + len(range(0, 37, every))
    assert all(path.is_file() for path in files)
    listed = [entry.get("file") for entry in ET.parse(files[0]).iter("DataSet")]  # noqa: S314
    assert [files[0].parent / name for name in listed] == files[1:]


def test_arrays_have_one_or_three_components(collection):
    for array in ET.parse(collection[0][1]).find(".//PointData"):  # noqa: S314
        assert array.get("NumberOfComponents") in {"1", "3"}, array.get("Name")


def test_existing_file_is_overwritten_only_on_request(stored, tmp_path):
    path = tmp_path / "x.pvd"
    path.write_text("mine")
    with pytest.raises(InputError, match="overwrite"):
        write_pvd(stored.result, path)
    assert path.read_text() == "mine"
    assert len(write_pvd(stored.result, path, every=36, overwrite=True)) == 3


@pytest.mark.parametrize("every", [0, -1])
def test_stride_below_one_is_refused(every, stored, tmp_path):
    with pytest.raises(InputError, match="every"):
        write_pvd(stored.result, tmp_path / "x.pvd", every=every)
    assert not list(tmp_path.iterdir())
