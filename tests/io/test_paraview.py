"""ParaView opens a collection, animated modes and the macro, in one process, whose start takes seconds.

FLEXCAM_REQUIRE_PARAVIEW=1 makes the tests fail without ParaView. Bounds are compared in single precision, in which
ParaView stores points.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flexcam import modes
from flexcam.analysis.run import output_geometry
from flexcam.io import write_macro, write_modes, write_pvd

SCALE = 3.0
SCRIPT = """
import json, sys
from paraview.simple import *
from paraview.servermanager import Fetch

collection, shapes, macro, picture, scale, angle = sys.argv[1:]


def look(path, begin, scale):
    source = PVDReader(FileName=path)
    source.UpdatePipeline()
    data = source.PointData
    names = [data.GetArray(i).Name for i in range(data.GetNumberOfArrays())]
    name = next(name for name in names if name.startswith(begin))
    warped = WarpByVector(Input=source, Vectors=["POINTS", name], ScaleFactor=scale)
    tube = Tube(Input=warped, Radius=0.002)
    rows = []
    for time in source.TimestepValues:
        tube.UpdatePipeline(time)
        read, moved, drawn = map(Fetch, (source, warped, tube))
        vectors = read.GetPointData().GetArray(name)
        rows.append({
            "time": time, "components": vectors.GetNumberOfComponents(),
            "ranges": [vectors.GetRange(i) for i in range(3)], "bounds": moved.GetBounds(),
            "cells": read.GetNumberOfCells(), "tube": drawn.GetNumberOfCells(),
        })
    for one in (tube, warped, source):
        Delete(one)
    return {"names": names, "name": name, "steps": rows}


found = {"collection": look(collection, "displacement", float(scale)), "modes": look(shapes, "mode_02_", 1.0)}
sys.argv = [macro, picture, angle]
exec(compile(open(macro, encoding="utf-8").read(), macro, "exec"), {**globals(), "__file__": macro})
parts = {name: FindSource(name) for name in ("moved", "members", "cam angle")}
view = GetActiveView()
for one in parts.values():
    one.UpdatePipeline(view.ViewTime)
found["macro"] = {
    "time": view.ViewTime, "bounds": Fetch(parts["members"]).GetBounds(), "scale": parts["moved"].ScaleFactor,
    "angle": Fetch(parts["cam angle"]).GetRowData().GetAbstractArray(0).GetValue(0),
}
print("RESULT " + json.dumps(found))
"""


@pytest.fixture(scope="module")
def paraview(pvbatch, stored, ready, tmp_path_factory):
    """Return the data of ParaView for every sixth step, for the modes and for the macro, and the macro's picture."""
    folder = tmp_path_factory.mktemp("paraview")
    collection = write_pvd(stored.result, folder / "Größe & Maß.pvd", every=6)[0]
    degrees = np.degrees(stored.response.field_angle[::6])
    macro = write_macro(collection, ["displacement", "stress_von_mises"], degrees.tolist())
    found = modes(ready.case, 3).modes
    files = write_modes(folder / "inline-modes.vtkhdf", output_geometry(ready.model), found.frequencies, found.shapes)
    shapes = next(path for path in files if path.suffix == ".pvd")
    script, picture = folder / "look.py", folder / "made.png"
    script.write_text(SCRIPT, encoding="utf-8")
    words = [script, collection, shapes, macro, picture, SCALE, degrees[3] + 1.0]
    run = subprocess.run([*pvbatch, *map(str, words)], capture_output=True, text=True, timeout=240)
    output = [line.removeprefix("RESULT ") for line in run.stdout.splitlines() if line.startswith("RESULT ")]
    assert output, f"pvbatch ended with {run.returncode}\n{run.stdout}\n{run.stderr}"
    return {**json.loads(output[0]), "picture": picture}


def test_collection_times_warp_and_tube(paraview, stored):
    shown = paraview["collection"]["steps"]
    moved, nodes = stored.result.field("displacement")[::6], stored.result.mesh.nodes
    assert [one["time"] for one in shown] == stored.response.field_time[::6].tolist()
    for one, field in zip(shown, moved, strict=True):
        assert one["components"] == 3
        assert np.allclose(one["ranges"], np.column_stack([field.min(axis=0), field.max(axis=0)]), rtol=1e-12, atol=0.0)
        warped = nodes + SCALE * field
        bounds = np.column_stack([warped.min(axis=0), warped.max(axis=0)]).ravel()
        assert np.allclose(one["bounds"], bounds, rtol=1e-6, atol=1e-7)
        assert one["cells"] == 2
        assert one["tube"] >= 2


def test_mode_animation_has_24_steps(paraview, ready):
    shown, found = paraview["modes"], modes(ready.case, 3).modes
    names = [name[:8] for name in sorted(shown["names"]) if name.startswith("mode_")]
    assert names == ["mode_01_", "mode_02_", "mode_03_"]
    assert shown["name"] == f"mode_02_{found.frequencies[1]:.1f}Hz"
    assert [step["time"] for step in shown["steps"]] == pytest.approx([i / 24 for i in range(24)], abs=1e-12)
    assert min(step["tube"] for step in shown["steps"]) >= 2
    nodes = ready.model.mesh.nodes
    shape = output_geometry(ready.model).dofs.nodal(found.shapes[:, 1])[:, :3]
    shape *= 0.05 * np.linalg.norm(np.ptp(nodes, axis=0)) / np.linalg.norm(shape, axis=1).max()
    for i, step in enumerate(shown["steps"]):
        moved = nodes + np.cos(2.0 * np.pi * i / 24) * shape
        bounds = np.column_stack([moved.min(axis=0), moved.max(axis=0)]).ravel()
        assert np.allclose(step["bounds"], bounds, rtol=1e-6, atol=1e-7), i


def test_macro_draws_members_at_cam_angle(paraview, stored):
    """The bounds of the tubes are those of the moved nodes plus a radius; the annotation shows the given angle."""
    shown = paraview["macro"]
    assert shown["time"] == pytest.approx(stored.response.field_time[18], rel=1e-12)
    assert shown["angle"] == f"cam angle {np.degrees(stored.response.field_angle[18]):7.1f} deg"
    assert shown["scale"] == 1.0
    moved = stored.result.mesh.nodes + stored.result.field("displacement")[18]
    reach = float(stored.result.constant["radius"].max())
    low, high = np.array(shown["bounds"][::2]), np.array(shown["bounds"][1::2])
    # The shaft is along x: a tube adds its radius in y and z, and nothing in x.
    assert low[1:] == pytest.approx(moved.min(axis=0)[1:] - reach, abs=1e-3 * reach)
    assert (low[0], high[0]) == pytest.approx((moved[:, 0].min(), moved[:, 0].max()), abs=1e-5)  # the ends rotate
    assert _coloured_fraction(paraview["picture"]) > 0.02


def _coloured_fraction(path: Path):
    """Return the fraction of pixels that are neither grey nor white."""
    image = pytest.importorskip("PIL.Image")
    with image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    return float((np.ptp(pixels, axis=2) > 30).mean())
