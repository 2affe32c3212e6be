"""Exit code 2: refused input, also with --json; existing results are not overwritten."""

import pytest

from tests.thinning import mostly_slow

ERROR_KEYS = {"where", "given", "allowed", "why", "remedy"}
COMMANDS = {
    "no case": ["check", "nosuch.toml"],
    "bad case": ["check", "bad.toml"],
    "bad case to run": ["run", "bad.toml"],
    "bad case to compare": ["compare", "bad.toml"],
    "bad case for modes": ["modes", "bad.toml"],
    "bad case to export": ["export", "bad.toml", "--format", "msh"],
    "no modes": ["modes", "case.toml", "--count", "0"],
    "no such probe": ["compare", "case.toml", "--probe", "vale"],
    "probe of six": ["compare", "case.toml", "--probe", "cam"],
    "probe that stands still": ["compare", "case.toml", "--probe", "cam.uz"],
    "wrong override": ["check", "case.toml", "--set", "run.sped=3rpm"],
    "no override": ["check", "case.toml", "--set"],
    "unknown command": ["chekc", "case.toml"],
    "unknown option": ["check", "case.toml", "--josn"],
    "no argument": ["check"],
    "not a number": ["modes", "case.toml", "--count", "many"],
    "unknown format": ["export", "case.toml", "--format", "xdmf"],
    "no result": ["export", "nosuch.vtkhdf"],
    "no result but a case": ["export", "case.toml"],
    "every zero": ["export", "out/case.vtkhdf", "--every", "0"],
    "folder is a file": ["run", "case.toml", "-o", "bad.toml"],
    "folder of an export is a file": ["export", "case.toml", "--format", "msh", "-o", "bad.toml"],
    "a result for its folder": ["run", "case.toml", "-o", "new.vtkhdf"],
    "a table for the folder of a sweep": ["sweep", "case.toml", "--set", "run.speed=1000,2000rpm", "-o", "grid.h5"],
    "shapes for their folder": ["modes", "case.toml", "-o", "shapes.vtkhdf"],
    "a table for the folder of an export": ["export", "case.toml", "--format", "msh", "-o", "new.msh"],
    "a profile for its folder": ["cam", "case.toml", "-o", "cam.CSV"],
    "result exists": ["run", "case.toml", "-o", "out"],
    "a picture for the folder of a cam's": ["cam", "case.toml", "--plot", "cam.png"],
    "no orders": ["campbell", "case.toml", "--response", "--orders", "0"],
}


@pytest.fixture
def files(flexcam, case, tmp_path):
    (tmp_path / "bad.toml").write_text(case.read_text().replace("density", "densty").replace('"3000 rpm"', '"0 rpm"'))
    (tmp_path / "out").mkdir()
    return tmp_path


@pytest.mark.parametrize("name", mostly_slow(COMMANDS))
def test_refused_command_prints_errors_as_json(name, flexcam, files):
    (files / "out/case.vtkhdf").write_text("mine")
    before = sorted(files.rglob("*"))
    done = flexcam(*COMMANDS[name], "--json")
    assert done.code == 2
    assert done.json["status"] == "refused"
    assert done.json["errors"]
    assert all(
        set(error) == ERROR_KEYS and error["given"] and (error["allowed"] or error["why"])
        for error in done.json["errors"]
    )
    assert sorted(files.rglob("*")) == before, "a refused command leaves nothing behind"


def test_result_given_as_case_is_refused(flexcam, files):
    """The message names the result, not its invalid text encoding."""
    (files / "out/case.vtkhdf").write_bytes(b"\x89HDF")
    (fault,) = flexcam("run", "out/case.vtkhdf", "--json").json["errors"]
    assert fault["why"] == "it is a result"
    assert fault["remedy"] == "give the case file of this result"


@pytest.mark.parametrize("name", ["bad case", "unknown option", "result exists", "folder of an export is a file"])
def test_refused_command_prints_errors_to_stderr(name, flexcam, files):
    (files / "out/case.vtkhdf").write_text("mine")
    done = flexcam(*COMMANDS[name])
    assert done.code == 2
    assert done.out == "", "messages go to standard error"
    assert len(done.err.splitlines()) >= 1


def test_all_faults_of_case_are_reported(flexcam, files):
    errors = flexcam("check", "bad.toml", "--json").json["errors"]
    assert {"materials.steel.densty", "run.speed"} <= {error["where"].split(" (")[0] for error in errors}
    assert any("did you mean 'density'" in error["remedy"] for error in errors)


@pytest.mark.parametrize(
    "first",
    [
        pytest.param(["run", "case.toml", "-o", "out"], id="run"),
        pytest.param(["export", "out/case.vtkhdf"], id="pvd", marks=pytest.mark.slow),
        pytest.param(["export", "case.toml", "--format", "msh", "-o", "out"], id="msh"),
    ],
)
def test_existing_results_require_overwrite(first, flexcam, case, tmp_path):
    flexcam("run", "case.toml", "-o", "out")
    target = (
        tmp_path
        / "out"
        / {"run": "case.vtkhdf", "case.toml": "case.msh"}.get(first[0] if first[0] == "run" else first[1], "case.pvd")
    )
    flexcam(*first)
    content = target.read_bytes()
    again = flexcam(*first)
    assert again.code == 2
    assert target.name in again.err
    assert target.read_bytes() == content
    assert flexcam(*first, "--overwrite").code == 0
    assert target.is_file()
