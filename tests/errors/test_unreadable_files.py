"""Case files that cannot be read, faults of a mesh file, and overrides with --set."""

# ruff: noqa: E501 - tables, a row to a line

import math

import pytest

from flexcam import InputError, prepare, read_case


@pytest.mark.parametrize(
    ("text", "line", "allowed"),
    [
        ("format = 1\ntitle = Nodes\n", 2, "TOML"), ("[run\n", 1, "TOML"),
        ("a = 1\na = 2\n", 2, "every key and table only once"), ("\n\n= 3\n", 3, "TOML"),
    ],
)  # fmt: skip
def test_toml_syntax_error_names_line(text, line, allowed, faults_of):
    (fault,) = faults_of(text)
    assert "case.toml" in fault.where
    assert f"line {line}" in str(fault)
    assert allowed in fault.allowed
    assert fault.remedy


@pytest.mark.parametrize("given", ["modle-1-shm.toml", "Model-1-shm.toml", "model-1-shm.tml"])
def test_missing_file_suggests_similar_name(given, tmp_path):
    (tmp_path / "model-1-shm.toml").touch()
    with pytest.raises(InputError) as refusal:
        read_case(tmp_path / given)
    (fault,) = refusal.value.faults
    assert given in fault.given
    assert fault.remedy == "did you mean 'model-1-shm.toml'?"


@pytest.mark.parametrize("name", ["gone/case.toml", "."])
def test_missing_folder_or_folder_as_case_is_refused(name, tmp_path):
    with pytest.raises(InputError):
        read_case(tmp_path / name)


def test_latin_1_encoding_is_refused(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "Größe"'.encode("latin-1"))
    with pytest.raises(InputError, match="UTF-8"):
        read_case(path)


def test_empty_file_reports_required_keys(faults_of):
    wheres = {fault.where for fault in faults_of("")}
    assert {"format", "case file", "run"} <= wheres


def test_deeply_nested_arrays_are_refused(faults_of):
    assert faults_of("a = " + "[" * 5000 + "]" * 5000)


# changes of the case with a mesh, and parts of the message
MESH_FAULTS = {
    "missing mesh": ([("tayeb-1.msh", "tayeb-9.msh")], ["mesh (line", "tayeb-9.msh", "Did you mean 'tayeb-"]),
    "other format": ([("tayeb-1.msh", "tayeb-1.vtu")], ["mesh (line", ".msh"]),
    "member without lines": ([("pushrod = { material", "pushrode = { material")], ["members.pushrode (line", "Did you mean 'pushrod'", "mesh group 'pushrod'"]),
    "nodes beside a mesh": ([("pushrod = { ", 'pushrod = { nodes = ["a", "b"], ')], ["members.pushrod.nodes (line"]),
    "a group for one node": ([('lobe = { at = "cam"', 'lobe = { at = "bearings"')], ["masses.lobe.at (line", "'bearings'", "2 nodes"]),
    "cam at a group": ([('at = "cam"\nlaw', 'at = "bearings"\nlaw')], ["cams.intake.at (line", "2 nodes"]),
    "point that no group names": ([('bearings = ["uy", "uz"]', 'bearing = ["uy", "uz"]')], ["supports.bearing (line", "Did you mean 'bearings'"]),
    "mesh as a number": ([('mesh = "', 'mesh = 3 # "')], ["mesh (line", "3", "string"]),
}  # fmt: skip


@pytest.mark.parametrize("name", MESH_FAULTS)
def test_mismatch_of_mesh_and_case_is_reported(name, mesh_case, substitute, faults_of):
    changes, parts = MESH_FAULTS[name]
    messages = "\n".join(map(str, faults_of(substitute(mesh_case, *changes))))
    assert not [part for part in parts if part not in messages], messages


def test_missing_mesh_hides_no_other_fault(mesh_case, substitute, faults_of):
    faults = faults_of(
        substitute(mesh_case, ("tayeb-1.msh", "none.msh"), ('lift = "6 mm"', "lift = 0"), ('law = "shm"', 'law = "x"'))
    )
    assert {f.where.split(" (")[0] for f in faults} == {"mesh", "cams.intake.lift", "cams.intake.law"}


@pytest.mark.parametrize(
    "change", [('"268 mm", "0 mm"', '"268 mm", 1.5e-17'), ("pushrod = { ", "pushrod = { orientation = [6.1e-17, 0.0, 1.0], "),
               ('direction = "uy"', "direction = [6.1e-17, 1.0, 0.0]")],
)  # fmt: skip
def test_rounding_noise_in_coordinates_is_zero(change, text, substitute, tmp_path):
    """A coordinate or a direction cosine that results from a computation is rarely exactly zero."""
    (tmp_path / "case.toml").write_text(substitute(text, change), encoding="utf-8")
    assert prepare(read_case(tmp_path / "case.toml")).problem.system.size == 21


@pytest.fixture
def case_path(text, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [("run.speed=4000rpm", "speed", 400.0 * math.pi / 3.0), ("run.speed=4000 rpm", "speed", 400.0 * math.pi / 3.0), ("run.speed = 100", "speed", 100.0),
     ('run.start="equilibrium"', "start", "equilibrium"), ("run.start=equilibrium", "start", "equilibrium"), ("run.revolutions=3", "revolutions", 3.0)],
)  # fmt: skip
def test_override_changes_value(override, key, value, case_path):
    found = getattr(read_case(case_path, [override]).record.run, key)
    assert found == (pytest.approx(value, rel=1e-15) if isinstance(value, float) else value)


def test_last_of_repeated_overrides_applies(case_path):
    case = read_case(
        case_path, ["cams.intake.lift=7mm", "cams.intake.lift=8mm", "run.damping.modal=0.02", "output.probes=['cam']"]
    )
    assert case.record.cams["intake"].lift == pytest.approx(0.008, rel=1e-15)
    assert case.record.run.damping.modal == 0.02
    assert case.record.output.probes == ["cam"]
    assert case.overrides[0] == "cams.intake.lift=7mm"


def test_override_creates_missing_table(case_path):
    """An override can create any table of a run, not only `damping` and `integrator`."""
    case = read_case(
        case_path, ["run.adaptive.tolerance=1e-5", "run.fluctuation.orders=[2]", "run.fluctuation.amplitudes=[0.02]"]
    )
    assert case.record.run.adaptive.tolerance == 1e-5
    assert case.record.run.fluctuation.orders == [2]


OVERRIDES = {
    "run.adaptiv.tolerance=1e-5": "Did you mean 'adaptive'", "run.adaptive.tolerence=1e-5": "Did you mean 'tolerance'",
    "run.speed": "key=value", "=3": "key=value", "run..speed=3": "key=value", ".=3": "key=value", "": "key=value",
    "run.sped=4000rpm": "Did you mean 'speed'", "rn.speed=4000rpm": "Did you mean 'run'", "cams.intak.lift=7mm": "Did you mean 'intake'",
    "run.speed=fast": "rpm", "run.speed=-3rpm": "above zero", "run.speed=": "speed", "title.x=3": "table",
    "cams.intake.law=shn": "Did you mean 'shm'", "run.speed=3 mm": "speed",
}  # fmt: skip


@pytest.mark.parametrize("override", OVERRIDES)
def test_fault_of_override_names_the_option(override, text, faults_of):
    faults = faults_of(text, [override])
    assert any(OVERRIDES[override] in str(fault) for fault in faults), [str(f) for f in faults]
    assert any("--set" in str(fault) for fault in faults), "the fault names the option, not a line of the file"


def test_faults_of_overrides_and_file_are_in_one_report(text, substitute, faults_of):
    wheres = [f.where for f in faults_of(substitute(text, ('lift = "6 mm"', "lift = 0")), ["nonsense", "rnu.speed=3"])]
    assert len(wheres) >= 3
