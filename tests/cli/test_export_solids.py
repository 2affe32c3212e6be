"""`flexcam export` of solids: STL, VTM and GLB files of results and cases, and unsuitable options."""

from pathlib import Path

import pytest

pyvista = pytest.importorskip("pyvista")

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_export_solids_of_case_and_result(flexcam, intake):
    files = flexcam("export", intake, "--format", "stl", "--at", "90deg", "-o", ".", "--json").json["files"]
    assert "intake-solids/lobe-intake.stl" in files
    assert all(Path(file).is_file() for file in files)
    assert flexcam("export", intake, "--format", "stl", "-o", ".").code == 2
    words = ("export", intake, "--format", "vtm", "--instants", "4", "--field", "stress_von_mises", "-o", ".")
    files = flexcam(*words, "--json").json["files"]
    assert files[0] == "intake-solids.pvd"
    rod = pyvista.read("intake-solids/member-pushrod_000002.vtp")
    assert rod["stress von mises, MPa"].max() > 1.0
    assert flexcam("export", intake, "--format", "glb", "--instants", "4", "-o", ".").out == "intake.glb\n"
    case = ROOT / "cases/direct-acting/finger.toml"
    for extension, name in (("stl", "finger-solids/valve.stl"), ("glb", "finger.glb")):
        ended = flexcam("export", case, "--format", extension, "-o", ".")
        assert ended.code == 0, ended.err
        assert Path(name).is_file()
        assert "Use --overwrite" in flexcam("export", case, "--format", extension, "-o", ".").err


REFUSED = {
    ("--format", "glb", "--at", "9deg"): "--format stl",
    ("--format", "glb", "--field", "velocity"): "--format pvd or vtm",
    ("--format", "stl", "--instants", "9"): "--format csv or vtm or glb",
    ("--format", "vtm", "--every", "2"): "--format pvd or csv",
    ("--format", "glb", "--instants", "1"): "from 2 to 720",
    ("--format", "stl", "--at", "90"): "90 deg",
    ("--format", "vtm", "--field", "velocity", "--field", "displacement"): "one field",
    ("--format", "vtm", "--field", "stress_von_mises"): "Solve it with flexcam run",
}


@pytest.mark.parametrize("words", REFUSED, ids=" ".join)
def test_unsuitable_options_are_refused(words, flexcam, tmp_path):
    refused = flexcam("export", ROOT / "cases/direct-acting/finger.toml", *words, "-o", tmp_path / "out")
    assert refused.code == 2
    assert REFUSED[words] in refused.err
    assert not list(tmp_path.glob("out/*"))
