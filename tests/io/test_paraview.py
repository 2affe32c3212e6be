"""ParaView itself opens the collection, warps it and draws tubes. Set FLEXCAM_REQUIRE_PARAVIEW=1 where it must run."""

from __future__ import annotations

import json
import subprocess

import numpy as np

from flexcam.io import write_pvd

SCRIPT = """
import json, sys
from paraview.simple import *
source = PVDReader(FileName=sys.argv[1])
warped = WarpByVector(Input=source, Vectors=["POINTS", "displacement"], ScaleFactor=float(sys.argv[2]))
tube = Tube(Input=warped, Radius=0.002)
told = []
for time in source.TimestepValues:
    tube.UpdatePipeline(time)
    read, moved, drawn = map(servermanager.Fetch, (source, warped, tube))
    vectors = read.GetPointData().GetArray("displacement")
    told.append({
        "time": time, "components": vectors.GetNumberOfComponents(), "ranges": [vectors.GetRange(i) for i in range(3)],
        "bounds": moved.GetBounds(), "cells": read.GetNumberOfCells(), "tube": drawn.GetNumberOfCells(),
    })
print("TOLD " + json.dumps(told))
"""
SCALE = 3.0


def in_paraview(command, path, folder):
    script = folder / "look.py"
    script.write_text(SCRIPT)
    run = subprocess.run([*command, script, path, str(SCALE)], capture_output=True, text=True, timeout=240)
    told = [line.removeprefix("TOLD ") for line in run.stdout.splitlines() if line.startswith("TOLD ")]
    assert told, f"pvbatch ended with {run.returncode}\n{run.stdout}\n{run.stderr}"
    return json.loads(told[0])


def test_times_warp_and_tube(pvbatch, done, tmp_path):
    """Bounds are compared in single precision: ParaView's filters make points of floats."""
    files = write_pvd(done.result, tmp_path / "Größe & Maß.pvd", every=6)
    told = in_paraview(pvbatch, files[0], tmp_path)
    moved, nodes = done.result.field("displacement")[::6], done.result.mesh.nodes
    assert [one["time"] for one in told] == done.response.field_time[::6].tolist()
    for one, field in zip(told, moved, strict=True):
        assert one["components"] == 3
        assert np.allclose(one["ranges"], np.column_stack([field.min(axis=0), field.max(axis=0)]), rtol=1e-12, atol=0.0)
        warped = nodes + SCALE * field
        bounds = np.column_stack([warped.min(axis=0), warped.max(axis=0)]).ravel()
        assert np.allclose(one["bounds"], bounds, rtol=1e-6, atol=1e-7)
        assert one["cells"] == 2
        assert one["tube"] >= 2
