"""Every command as text and with --json: stable keys, results on standard output, messages on standard error."""

# ruff: noqa: E501 - tables, a row to a line

import math
import re

import pytest

from flexcam import read_mesh, read_result
from tests.thinning import mostly_slow

KEYS = {
    "check": {"status", "elements", "dof"},
    "modes": {"status", "frequencies_hz"},
    "compare": {"status", "speed_rpm", "peak_deviation", "rms_deviation", "peak_acceleration_ratio"},
    "run": {"status", "result", "steps", "dof"},
}


@pytest.mark.parametrize("verb", KEYS)
def test_json_has_stable_keys(verb, flexcam, case):
    done = flexcam(verb, "case.toml", "--json")
    assert done.code == 0
    assert KEYS[verb] <= set(done.json)
    assert done.err == ""


@pytest.mark.parametrize(
    ("verb", "words"),
    [("check", ["degrees of freedom", "21", "3000 rpm"]), ("modes", ["67.11", "Hz"]), ("compare", ["valve", "3000 rpm", "published load"]),
     ("run", ["results/case.vtkhdf", "720 steps"])],
)  # fmt: skip
def test_output_text_of_commands(verb, words, flexcam, case):
    done = flexcam(verb, "case.toml")
    assert done.code == 0
    assert not [word for word in words if word not in done.out], done.out
    assert done.err == ""


@pytest.mark.parametrize(("model", "elements", "dof"), [(1, 4, 21), (2, 8, 25), (3, 10, 47)])
def test_element_and_dof_counts_of_published_models(model, elements, dof, flexcam, tayeb):
    found = flexcam("check", tayeb(model), "--json").json
    assert (found["elements"], found["dof"]) == (elements, dof)


def test_inline_nodes_give_frequencies_of_mesh(flexcam, case, tayeb):
    """The inline case is published model 1: only the order of the unknowns may differ, hence rounding."""
    inline, mesh = (flexcam("modes", path, "--json").json["frequencies_hz"] for path in (case, tayeb(1)))
    assert inline == pytest.approx(mesh, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize(
    "verb", [pytest.param("check", marks=pytest.mark.slow), "modes", pytest.param("run", marks=pytest.mark.slow)]
)
def test_output_begins_with_case_title(verb, flexcam, case):
    """The file name replaces a missing title."""
    overwrite = ["--overwrite"] if verb == "run" else []
    assert flexcam(verb, "case.toml", *overwrite).out.startswith("Nodes in the file")
    assert flexcam(verb, "case.toml", "--set", "title=[odd] name", *overwrite).out.startswith("[odd] name")
    assert flexcam(verb, "case.toml", "--set", 'title=""', *overwrite).out.startswith("case")
    if not overwrite:
        assert flexcam(verb, "case.toml", "--json").json["title"] == "Nodes in the file"


@pytest.mark.parametrize(
    "words", mostly_slow(["compare", "campbell --count 2 --response", "campbell --count 2", "modes"], 2)
)
def test_narrow_terminal_truncates_no_number(words, flexcam, case, monkeypatch):
    verb, *few = words.split()
    wide = flexcam(verb, case, *few, "--set", "run.steps_per_revolution=360").out
    monkeypatch.setenv("COLUMNS", "80")
    narrow = flexcam(verb, case, *few, "--set", "run.steps_per_revolution=360").out
    assert "…" not in narrow
    assert max(map(len, narrow.splitlines())) <= 80
    numbers = [set(re.findall(r"-?\d+\.\d+\S*", output)) for output in (wide, narrow)]
    assert numbers[0] == numbers[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check",), "CASE (--case) is missing. See flexcam check --help."),
        (("synthesize", "law"), "MINIMIZE (--minimize) is missing. See flexcam synthesize law --help."),
        (("run", "case.toml", "other.toml"), "no argument or option accepts 'other.toml'. See flexcam run --help."),
        (("run", "case.toml", "--set"), "--set needs a value"),
        (("chek",), 'Did you mean "check"?'),
    ],
)
def test_invalid_command_line_is_refused_with_hint(flexcam, case, words, message):
    refused = flexcam(*words)
    assert refused.code == 2
    assert message in refused.err


def test_info_and_run_print_same_number_of_unknowns(flexcam, tmp_path, tayeb):
    """Supports and camshaft nodes without a beam have fewer unknowns: six per node would be more."""
    output = flexcam("run", tayeb(1), "--set", "run.revolutions=0.01", "-o", tmp_path).out
    summary = next(line for line in output.splitlines() if " unknowns" in line).partition(";")[0]
    assert summary.split(" of ")[1] in flexcam("info", tmp_path / "model-1-shm.vtkhdf").out


def test_run_json_describes_written_result(flexcam, case, tmp_path):
    report = flexcam("run", "case.toml", "-o", "out", "--json").json
    assert report["status"] == "done"
    assert report["result"] == "out/case.vtkhdf"
    assert (report["steps"], report["dof"]) == (720, 21)
    result = read_result(tmp_path / report["result"])
    assert result.response.status.ok
    assert len(result.response.time) == 721
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["case.vtkhdf"]


def test_compare_at_published_speed(flexcam, case):
    """The digits of the published table at 3000 rpm, SHM, for published model 1."""
    finer = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=3600")
    found = flexcam("compare", case, *finer, "--json").json
    assert found["peak_deviation"] == pytest.approx(1.238, rel=5e-4)
    assert found["speed_rpm"] == pytest.approx(3000.0, rel=1e-12)
    assert 0.0 < found["rms_deviation"] < found["peak_deviation"]
    assert found["peak_acceleration_ratio"] > 1.0


@pytest.mark.parametrize(
    "words",
    [
        ["--set", "run.speed=4000rpm"],
        ["--set=run.speed=4000rpm"],
        ["--set", "run.speed=1000 rpm", "--set", "run.speed=4000rpm"],
    ],
)
def test_override_sets_speed_of_case(words, flexcam, case):
    found = flexcam("check", "case.toml", *words, "--json").json
    assert found["case"]["run"]["speed"] == pytest.approx(4000.0 * math.pi / 30.0, rel=1e-15)
    assert found["step_s"] == pytest.approx(60.0 / 4000.0 / 720.0, rel=1e-12)


def test_crank_speed_is_twice_camshaft_speed(flexcam, case):
    case.write_text(case.read_text().replace('speed = "3000 rpm"', 'crank_speed = "6000 rpm"'))
    assert flexcam("compare", "case.toml", "--json").json["speed_rpm"] == pytest.approx(3000.0, rel=1e-12)


@pytest.mark.slow
def test_export_of_pvd_files(flexcam, case, tmp_path):
    flexcam("run", "case.toml", "-o", "out")
    done = flexcam("export", "out/case.vtkhdf", "--format", "pvd", "--every", "6", "--json")
    assert done.code == 0
    assert done.json["files"][0] == "out/case.pvd"
    assert len(done.json["files"]) == 8
    assert all((tmp_path / name).is_file() for name in done.json["files"])
    assert "out/case.pvd" in flexcam("export", "out/case.vtkhdf", "--overwrite").out


def test_exported_mesh_can_be_read(flexcam, case, tmp_path):
    report = flexcam("export", "case.toml", "--format", "msh", "-o", "mesh", "--json").json
    assert report["files"] == ["mesh/case.msh"]
    assert set(read_mesh(tmp_path / "mesh/case.msh").lines) == {"camshaft", "pushrod"}


def test_exported_mesh_lists_missing_rigid_links(flexcam):
    flexcam("new", "valve-bridge")
    done = flexcam("export", "valve-bridge.toml", "--format", "inp")
    assert done.code == 0
    assert "lacks rigid_links.rocker, rigid_links.cup, rigid_links.bridge: connect" in " ".join(done.err.split())


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["--version"]])
def test_help_and_version_print_to_stdout(words, flexcam):
    done = flexcam(*words)
    assert done.code == 0
    assert done.out.strip()
    assert done.err == ""


def test_help_shows_examples(flexcam):
    assert "flexcam run engine.toml" in flexcam("--help").out


def test_title_with_brackets_is_printed_literally(flexcam, tmp_path):
    case = tmp_path / "train.toml"
    assert flexcam("new", "lumped-train", "-o", case).code == 0
    text = case.read_text(encoding="utf-8").replace("Lumped valve train", "[red]A[/red] [m] [/x]", 1)
    case.write_text(text.replace("3600", "360"), encoding="utf-8")
    title = "[red]A[/red] [m] [/x]"
    for command in (("check", case), ("run", case, "-o", tmp_path), ("info", tmp_path / "train.vtkhdf")):
        done = flexcam(*command)
        assert done.code == 0, done.err
        assert title in done.out
