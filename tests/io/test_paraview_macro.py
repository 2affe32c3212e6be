"""The macro beside an exported collection, in ParaView itself. FLEXCAM_REQUIRE_PARAVIEW=1: it must run."""

from __future__ import annotations

import ast
import json
import subprocess

import numpy as np
import pytest

from flexcam import InputError
from flexcam.io import write_macro, write_pvd

NAMED = 'a"""\nraise SystemExit("run")  # \\'
"""Name of a collection that ends a docstring and goes on as a statement; its last character escapes a quote."""

TELL = """
import json, sys
macro = sys.argv[1]
sys.argv = [macro, *sys.argv[2:]]
exec(compile(open(macro, encoding="utf-8").read(), macro, "exec"), {**globals(), "__file__": macro})
from paraview.simple import *
from paraview.servermanager import Fetch
parts = {name: FindSource(name) for name in ("moved", "members", "cam angle")}
view = GetActiveView()
for one in parts.values():
    one.UpdatePipeline(view.ViewTime)
text = Fetch(parts["cam angle"])
print("TOLD " + json.dumps({
    "time": view.ViewTime, "bounds": Fetch(parts["members"]).GetBounds(), "scale": parts["moved"].ScaleFactor,
    "angle": text.GetRowData().GetAbstractArray(0).GetValue(0),
}))
"""


@pytest.fixture
def exported(done, tmp_path):
    """Export every sixth instant with its macro, under a name that needs care."""
    files = write_pvd(done.result, tmp_path / "Größe & Maß.pvd", every=6)
    degrees = np.degrees(done.response.field_angle[::6])
    return write_macro(files[0], ["displacement", "stress_von_mises"], degrees.tolist()), degrees


def test_paraview_draws_the_members_at_the_cam_angle(pvbatch, exported, done, tmp_path):
    """Tubes reach as far as the moved nodes and a radius; the words say the angle that was asked for."""
    macro, degrees = exported
    script, picture = tmp_path / "tell.py", tmp_path / "made.png"
    script.write_text(TELL, encoding="utf-8")
    run = subprocess.run(
        [*pvbatch, script, macro, picture, str(degrees[3] + 1.0)], capture_output=True, text=True, timeout=240
    )
    told = [line.removeprefix("TOLD ") for line in run.stdout.splitlines() if line.startswith("TOLD ")]
    assert told, f"pvbatch ended with {run.returncode}\n{run.stdout}\n{run.stderr}"
    seen = json.loads(told[0])
    assert seen["time"] == pytest.approx(done.response.field_time[18], rel=1e-12)
    assert seen["angle"] == f"cam angle {degrees[3]:7.1f} deg"
    assert seen["scale"] == 1.0
    moved = done.result.mesh.nodes + done.result.field("displacement")[18]
    reach = float(done.result.still["radius"].max())
    low, high = np.array(seen["bounds"][::2]), np.array(seen["bounds"][1::2])
    # The shaft lies along x, so that across it a tube adds the radius, and along it nothing.
    assert low[1:] == pytest.approx(moved.min(axis=0)[1:] - reach, abs=1e-3 * reach)
    assert (low[0], high[0]) == pytest.approx((moved[:, 0].min(), moved[:, 0].max()), abs=1e-5)  # ends tilt
    assert _colourful(picture) > 0.02


def _colourful(path):
    """Return the share of pixels that are neither grey nor white."""
    image = pytest.importorskip("PIL.Image")
    with image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    return float((np.ptp(pixels, axis=2) > 30).mean())


def test_it_is_python_that_names_its_collection(exported):
    macro, degrees = exported
    tree = ast.parse(macro.read_text(encoding="utf-8"))
    values = {node.targets[0].id: ast.literal_eval(node.value) for node in tree.body
              if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "").isupper()}  # fmt: skip
    assert values["COLLECTION"] == "Größe & Maß.pvd"
    assert values["COLOUR"] == "stress_von_mises"
    assert values["DEGREES"] == pytest.approx(degrees.tolist(), abs=1e-6)
    assert values["WRITTEN_IN"] == str(macro.parent)


def test_it_writes_over_nothing_unasked(exported):
    macro, _ = exported
    with pytest.raises(InputError, match="overwrite"):
        write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0])
    write_macro(macro.with_name("Größe & Maß.pvd"), ["displacement"], [0.0], overwrite=True)
    assert "COLOUR = 'displacement'" in macro.read_text(encoding="utf-8")


def test_a_name_with_quotes_and_a_backslash_stays_a_name(tmp_path):
    macro = ast.parse(write_macro(tmp_path / f"{NAMED}.pvd", ["displacement"], [0.0]).read_text(encoding="utf-8"))
    assert ast.get_docstring(macro)
    assert not [one for one in macro.body if isinstance(one, ast.Raise)]
    given = {one.value for one in ast.walk(macro) if isinstance(one, ast.Constant)}
    assert {NAMED, f"{NAMED}.pvd"} <= given
