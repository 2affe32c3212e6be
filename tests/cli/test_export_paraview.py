"""`flexcam export --paraview` writes the collection and its macro, or neither of them."""

from pathlib import Path

import pytest


@pytest.fixture
def result_path(flexcam, case):
    assert flexcam("run", case, "-o", ".", "--set", "run.revolutions=0.1").code == 0
    return Path("case.vtkhdf")


def test_paraview_export_writes_collection_and_macro(flexcam, result_path):
    report = flexcam("export", result_path, "--paraview", "--every", "4", "--json").json
    assert report["files"][:2] == ["case.pvd", "case.paraview.py"]
    assert all(Path(file).is_file() for file in report["files"])
    assert flexcam("export", result_path, "--paraview").code == 2
    done = flexcam("export", result_path, "--paraview", "--overwrite")
    assert done.code == 0
    assert "paraview --script=case.paraview.py" in done.out


def test_existing_macro_prevents_export_of_collection(flexcam, result_path):
    Path("case.paraview.py").write_text("mine")
    assert flexcam("export", result_path, "--paraview").code == 2
    assert not Path("case.pvd").exists()
    assert Path("case.paraview.py").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--format", "csv"), "--format pvd"),
        (("--field", "velocity"), "displacement among them"),
        (("--field", "displacement", "--field", "no"), "--field: got 'no'"),
    ],
)
def test_unsuitable_paraview_options_are_refused(words, message, flexcam, result_path):
    refused = flexcam("export", result_path, "--paraview", *words)
    assert refused.code == 2
    assert message in refused.err
    assert not Path("case.pvd").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--instants", "9"), "--format csv"), (("--format", "pvd", "--probe", "valve"), "--format csv"),
        (("--format", "csv", "--field", "velocity"), "--format pvd"),
        (("--format", "csv", "--instants", "1"), "from 2 to"),
    ],
)  # fmt: skip
def test_options_of_other_format_are_refused(words, message, flexcam, result_path):
    refused = flexcam("export", result_path, *words)
    assert refused.code == 2
    assert message in refused.err
