"""VTK's own reader opens every step of a result file and agrees in time, geometry and value."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

reading = pytest.importorskip("vtkmodules.vtkIOHDF")
numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")


@pytest.fixture(scope="module")
def reader(done):
    made = reading.vtkHDFReader()
    made.SetFileName(str(done.path))
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


def test_times(reader, done):
    assert times(reader) == done.response.field_time.tolist()


def test_every_step_agrees(reader, done, nodal):
    """Exact: the file holds doubles, and so does VTK."""
    node = done.result.still["node"]
    fields = {name: values[:, node] for name, values in nodal.items()}
    for step in range(len(done.response.field_time)):
        data = at_step(reader, step).GetPointData()
        for name, field in fields.items():
            assert np.array_equal(numpy_support.vtk_to_numpy(data.GetArray(name)), field[step]), (step, name)


def test_one_polyline_per_member(reader, done):
    """So that the Tube filter makes one tube per member; in every step."""
    mesh = done.ready.model.mesh
    for step in (0, 17, 36):
        output = at_step(reader, step)
        node = numpy_support.vtk_to_numpy(output.GetPointData().GetArray("node"))
        assert [node[ids].tolist() for ids in lines_of(output)] == [line.tolist() for line in mesh.lines.values()]
        assert output.GetNumberOfCells() == len(mesh.lines)
        assert np.array_equal(numpy_support.vtk_to_numpy(output.GetPoints().GetData()), mesh.nodes[node])


def test_members_and_radius(reader, done):
    output = at_step(reader, 3)
    assert numpy_support.vtk_to_numpy(output.GetCellData().GetArray("member")).tolist() == [0, 1]
    assert np.array_equal(
        numpy_support.vtk_to_numpy(output.GetPointData().GetArray("radius")), done.result.still["radius"]
    )


def test_the_last_step_is_the_end_of_the_run(reader, done):
    moved = numpy_support.vtk_to_numpy(at_step(reader, 36).GetPointData().GetArray("displacement"))
    top = done.result.still["node"].tolist().index(done.ready.model.mesh.node("pushrod-top"))
    ratio = 40.0 / 25.0
    assert moved[top, 1] * ratio == pytest.approx(done.response["valve"].displacement[-1], rel=1e-12)  # one product


def test_what_is_recovered_from_the_motion(reader, done):
    """Section forces and stresses too, in every step."""
    for step in (0, 36):
        data = at_step(reader, step).GetPointData()
        for name, values in done.result.recovered.items():
            assert np.array_equal(numpy_support.vtk_to_numpy(data.GetArray(name)), values[step]), name
