"""Files that cannot be read as a case, faults of a mesh file, and values laid over with --set."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

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
def test_no_toml(text, line, allowed, faults_of):
    (fault,) = faults_of(text)
    assert "case.toml" in fault.where
    assert f"line {line}" in str(fault)
    assert allowed in fault.allowed
    assert fault.remedy


@pytest.mark.parametrize("given", ["modle-1-shm.toml", "Model-1-shm.toml", "model-1-shm.tml"])
def test_a_missing_file_with_a_near_name(given, tmp_path):
    (tmp_path / "model-1-shm.toml").touch()
    with pytest.raises(InputError) as refusal:
        read_case(tmp_path / given)
    (fault,) = refusal.value.faults
    assert given in fault.given
    assert fault.remedy == "did you mean 'model-1-shm.toml'?"


@pytest.mark.parametrize("name", ["gone/case.toml", "."])
def test_a_missing_folder_and_a_folder(name, tmp_path):
    with pytest.raises(InputError):
        read_case(tmp_path / name)


def test_not_utf8(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "Größe"'.encode("latin-1"))
    with pytest.raises(InputError, match="UTF-8"):
        read_case(path)


def test_an_empty_file_lacks_everything(faults_of):
    wheres = {fault.where for fault in faults_of("")}
    assert {"format", "case file", "run"} <= wheres


def test_deeply_nested(faults_of):
    assert faults_of("a = " + "[" * 5000 + "]" * 5000)


# changes of the meshed case, and parts of the message
MESHED = {
    "missing mesh": ([("tayeb-1.msh", "tayeb-9.msh")], ["mesh (line", "tayeb-9.msh", "Did you mean 'tayeb-"]),
    "other format": ([("tayeb-1.msh", "tayeb-1.vtu")], ["mesh (line", ".msh"]),
    "member without lines": ([("pushrod = { material", "pushrode = { material")], ["members.pushrode (line", "Did you mean 'pushrod'", "mesh group 'pushrod'"]),
    "nodes beside a mesh": ([("pushrod = { ", 'pushrod = { nodes = ["a", "b"], ')], ["members.pushrod.nodes (line"]),
    "a group for one node": ([('lobe = { at = "cam"', 'lobe = { at = "bearings"')], ["masses.lobe.at (line", "'bearings'", "2 nodes"]),
    "cam at a group": ([('at = "cam"\nlaw', 'at = "bearings"\nlaw')], ["cams.intake.at (line", "2 nodes"]),
    "point that no group names": ([('bearings = ["uy", "uz"]', 'bearing = ["uy", "uz"]')], ["supports.bearing (line", "Did you mean 'bearings'"]),
    "mesh as a number": ([('mesh = "', 'mesh = 3 # "')], ["mesh (line", "3", "string"]),
}  # fmt: skip


@pytest.mark.parametrize("name", MESHED)
def test_mesh_and_case_do_not_fit(name, meshed, changed, faults_of):
    changes, parts = MESHED[name]
    told = "\n".join(map(str, faults_of(changed(meshed, *changes))))
    assert not [part for part in parts if part not in told], told


def test_a_missing_mesh_hides_no_other_fault(meshed, changed, faults_of):
    faults = faults_of(
        changed(meshed, ("tayeb-1.msh", "none.msh"), ('lift = "6 mm"', "lift = 0"), ('law = "shm"', 'law = "x"'))
    )
    assert {f.where.split(" (")[0] for f in faults} == {"mesh", "cams.intake.lift", "cams.intake.law"}


@pytest.mark.parametrize(
    "change", [('"268 mm", "0 mm"', '"268 mm", 1.5e-17'), ("pushrod = { ", "pushrod = { orientation = [6.1e-17, 0.0, 1.0], "),
               ('direction = "uy"', "direction = [6.1e-17, 1.0, 0.0]")],
)  # fmt: skip
def test_rounding_noise_is_a_zero(change, text, changed, tmp_path):
    """A coordinate or a cosine that came out of a computation is rarely an exact zero."""
    (tmp_path / "case.toml").write_text(changed(text, change), encoding="utf-8")
    assert prepare(read_case(tmp_path / "case.toml")).problem.system.size == 21


@pytest.fixture
def good(text, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [("run.speed=4000rpm", "speed", 400.0 * math.pi / 3.0), ("run.speed=4000 rpm", "speed", 400.0 * math.pi / 3.0), ("run.speed = 100", "speed", 100.0),
     ('run.start="equilibrium"', "start", "equilibrium"), ("run.start=equilibrium", "start", "equilibrium"), ("run.revolutions=3", "revolutions", 3.0)],
)  # fmt: skip
def test_a_value_is_laid_over(override, key, value, good):
    found = getattr(read_case(good, [override]).record.run, key)
    assert found == (pytest.approx(value, rel=1e-15) if isinstance(value, float) else value)


def test_several_values_the_last_counts(good):
    case = read_case(
        good, ["cams.intake.lift=7mm", "cams.intake.lift=8mm", "run.damping.modal=0.02", "output.probes=['cam']"]
    )
    assert case.record.cams["intake"].lift == pytest.approx(0.008, rel=1e-15)
    assert case.record.run.damping.modal == 0.02
    assert case.record.output.probes == ["cam"]
    assert case.overrides[0] == "cams.intake.lift=7mm"


def test_a_table_that_the_file_leaves_out_is_begun(good):
    """Every table of a run can be begun by one of its keys, not `damping` and `integrator` alone."""
    case = read_case(
        good, ["run.adaptive.tolerance=1e-5", "run.fluctuation.orders=[2]", "run.fluctuation.amplitudes=[0.02]"]
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
def test_a_wrong_override_is_refused_by_its_own_name(override, text, faults_of):
    faults = faults_of(text, [override])
    assert any(OVERRIDES[override] in str(fault) for fault in faults), [str(f) for f in faults]
    assert any("--set" in str(fault) for fault in faults), "the line of the file says something else"


def test_faults_of_overrides_and_file_come_together(text, changed, faults_of):
    wheres = [f.where for f in faults_of(changed(text, ('lift = "6 mm"', "lift = 0")), ["nonsense", "rnu.speed=3"])]
    assert len(wheres) >= 3
