"""ParaView opens the animated modes, warps by one of them and draws tubes. FLEXCAM_REQUIRE_PARAVIEW=1: it must run."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest

from flexcam import modes
from flexcam.analysis.run import output_geometry
from flexcam.io import write_modes

SCRIPT = """
import json, sys
from paraview.simple import *
source = PVDReader(FileName=sys.argv[1])
source.UpdatePipeline()
data = source.PointData
names = [data.GetArray(i).Name for i in range(data.GetNumberOfArrays())]
mode = next(name for name in names if name.startswith("mode_02_"))
warped = WarpByVector(Input=source, Vectors=["POINTS", mode], ScaleFactor=1.0)
tube = Tube(Input=warped, Radius=0.002)
told = []
for time in source.TimestepValues:
    tube.UpdatePipeline(time)
    moved, drawn = map(servermanager.Fetch, (warped, tube))
    told.append({"time": time, "bounds": moved.GetBounds(), "tube": drawn.GetNumberOfCells()})
print("TOLD " + json.dumps({"names": names, "mode": mode, "steps": told}))
"""


def test_twenty_four_instants_warp_and_tube(pvbatch, ready, tmp_path):
    """Bounds are compared in single precision: ParaView's filters make points of floats."""
    found, drawn = modes(ready.case, 3).modes, output_geometry(ready.model)
    files = write_modes(tmp_path / "inline-modes.vtkhdf", drawn, found.frequencies, found.shapes)
    collection = next(path for path in files if path.suffix == ".pvd")
    script = tmp_path / "look.py"
    script.write_text(SCRIPT)
    done = subprocess.run([*pvbatch, script, collection], capture_output=True, text=True, timeout=240)
    lines = [line.removeprefix("TOLD ") for line in done.stdout.splitlines() if line.startswith("TOLD ")]
    assert lines, f"pvbatch ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    told = json.loads(lines[0])
    assert [name[:8] for name in sorted(told["names"]) if name.startswith("mode_")] == [
        "mode_01_",
        "mode_02_",
        "mode_03_",
    ]
    assert told["mode"] == f"mode_02_{found.frequencies[1]:.1f}Hz"
    assert [step["time"] for step in told["steps"]] == pytest.approx([i / 24 for i in range(24)], abs=1e-12)
    assert min(step["tube"] for step in told["steps"]) >= 2
    nodes = ready.model.mesh.nodes
    shape = drawn.dofs.nodal(found.shapes[:, 1])[:, :3]
    shape *= 0.05 * np.linalg.norm(np.ptp(nodes, axis=0)) / np.linalg.norm(shape, axis=1).max()
    for i, step in enumerate(told["steps"]):
        moved = nodes + np.cos(2.0 * np.pi * i / 24) * shape
        bounds = np.column_stack([moved.min(axis=0), moved.max(axis=0)]).ravel()
        assert np.allclose(step["bounds"], bounds, rtol=1e-6, atol=1e-7), i
