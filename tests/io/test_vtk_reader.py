"""VTK's reader opens all steps of a result file, with equal times, geometry and values."""

import itertools

import numpy as np
import pytest

reading = pytest.importorskip("vtkmodules.vtkIOHDF")
numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")


@pytest.fixture(scope="module")
def reader(stored):
    made = reading.vtkHDFReader()
    made.SetFileName(str(stored.path))
    made.UpdateInformation()
    return made


def times(reader):
    information = reader.GetOutputInformation(0)
    key = reader.GetExecutive().TIME_STEPS()
    return [information.Get(key, i) for i in range(information.Length(key))]


def at_step(reader, step):
    reader.SetStep(step)
    reader.Update()
    return reader.GetOutput()


def lines_of(output):
    cells = output.GetLines()
    ids, ends = (numpy_support.vtk_to_numpy(a) for a in (cells.GetConnectivityArray(), cells.GetOffsetsArray()))
    return [ids[a:b].tolist() for a, b in itertools.pairwise(ends)]


def test_vtk_times_equal_field_times(reader, stored):
    assert times(reader) == stored.response.field_time.tolist()


def test_vtk_values_equal_response_in_all_steps(reader, stored, nodal_vectors):
    """The comparison is exact, since the file and VTK use double precision."""
    node = stored.result.constant["node"]
    fields = {name: values[:, node] for name, values in nodal_vectors.items()}
    for step in range(len(stored.response.field_time)):
        data = at_step(reader, step).GetPointData()
        for name, field in fields.items():
            assert np.array_equal(numpy_support.vtk_to_numpy(data.GetArray(name)), field[step]), (step, name)


def test_each_member_is_one_polyline(reader, stored):
    """The Tube filter then makes one tube per member, in all steps."""
    mesh = stored.ready.model.mesh
    for step in (0, 17, 36):
        output = at_step(reader, step)
        node = numpy_support.vtk_to_numpy(output.GetPointData().GetArray("node"))
        assert [node[ids].tolist() for ids in lines_of(output)] == [line.tolist() for line in mesh.lines.values()]
        assert output.GetNumberOfCells() == len(mesh.lines)
        assert np.array_equal(numpy_support.vtk_to_numpy(output.GetPoints().GetData()), mesh.nodes[node])


def test_member_numbers_and_radii_are_read(reader, stored):
    output = at_step(reader, 3)
    assert numpy_support.vtk_to_numpy(output.GetCellData().GetArray("member")).tolist() == [0, 1]
    assert np.array_equal(
        numpy_support.vtk_to_numpy(output.GetPointData().GetArray("radius")), stored.result.constant["radius"]
    )


def test_last_step_equals_end_of_run(reader, stored):
    vectors = numpy_support.vtk_to_numpy(at_step(reader, 36).GetPointData().GetArray("displacement"))
    top = stored.result.constant["node"].tolist().index(stored.ready.model.mesh.node("pushrod-top"))
    ratio = 40.0 / 25.0
    # The tolerance is the rounding of one product.
    assert vectors[top, 1] * ratio == pytest.approx(stored.response["valve"].displacement[-1], rel=1e-12)


def test_recovered_forces_and_stresses_are_read(reader, stored):
    """Section forces and stresses are compared in the first and last step."""
    for step in (0, 36):
        data = at_step(reader, step).GetPointData()
        for name, values in stored.result.recovered.items():
            assert np.array_equal(numpy_support.vtk_to_numpy(data.GetArray(name)), values[step]), name
