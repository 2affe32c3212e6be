"""`flexcam export --paraview`: the collection with its macro, both or none."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def run(flexcam, case):
    assert flexcam("run", case, "-o", ".", "--set", "run.revolutions=0.1").code == 0
    return Path("case.vtkhdf")


def test_collection_and_macro(flexcam, run):
    made = flexcam("export", run, "--paraview", "--every", "4", "--json").json
    assert made["files"][:2] == ["case.pvd", "case.paraview.py"]
    assert all(Path(one).is_file() for one in made["files"])
    assert flexcam("export", run, "--paraview").code == 2
    ended = flexcam("export", run, "--paraview", "--overwrite")
    assert ended.code == 0
    assert "paraview --script=case.paraview.py" in ended.out


def test_where_the_macro_may_not_be_the_collection_is_not_written(flexcam, run):
    Path("case.paraview.py").write_text("mine")
    assert flexcam("export", run, "--paraview").code == 2
    assert not Path("case.pvd").exists()
    assert Path("case.paraview.py").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--format", "csv"), "--format pvd"),
        (("--field", "velocity"), "displacement among them"),
        (("--field", "displacement", "--field", "no"), "--field: got 'no'"),
    ],
)
def test_what_does_not_fit_is_refused(words, told, flexcam, run):
    refused = flexcam("export", run, "--paraview", *words)
    assert refused.code == 2
    assert told in refused.err
    assert not Path("case.pvd").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--instants", "9"), "--format csv"), (("--format", "pvd", "--probe", "valve"), "--format csv"),
        (("--format", "csv", "--field", "velocity"), "--format pvd"),
        (("--format", "csv", "--instants", "1"), "from 2 to"),
    ],
)  # fmt: skip
def test_an_option_of_another_format_is_not_passed_over(words, told, flexcam, run):
    refused = flexcam("export", run, *words)
    assert refused.code == 2
    assert told in refused.err
