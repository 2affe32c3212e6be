"""Faults of sweeps: all in one report, before any run, with the option that caused them."""

import pytest

from flexcam import InputError
from flexcam.case.reader import CaseFile
from flexcam.studies.plan import make_plan, parse_axes, parse_sample
from flexcam.studies.sweep import make_sweep


@pytest.fixture
def case(tmp_path, text):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def faults(make):
    with pytest.raises(InputError) as refusal:
        make()
    return refusal.value.faults


SPECS = {
    "": "the range is empty",
    "1:2:0": "the range has no end",
    "1:2:-1": "the range is empty",
    "2:1:1": "the range is empty",
    "1:1#5": "the range is empty",
    "1:2#1": "the range is empty",
    "2:1 m": "",
    "1:2:3:4": "",
    "1,,2": "a value between the commas is missing",
    "1mm:2m:1": "a range has one unit",
    "1:1e9:1": "each is a run",
    "1:2#100000000000000": "each is a run",
    "1:1e400:1": "its exponent is too large",
    "1 mm,2": "some numbers have a unit and the last one has none",
}


@pytest.mark.parametrize("spec", SPECS)
def test_invalid_range_is_refused(spec):
    fault = faults(lambda: parse_axes([f"run.speed={spec}"]))[0]
    assert fault.where == f"--set run.speed={spec}"
    assert fault.why == SPECS[spec]
    assert fault.allowed


def test_faults_of_all_axes_are_in_one_report():
    found = faults(lambda: parse_axes(["run.speed=2:1:1", "nothing", "a=1,2", "a=3", "b=1:2:0"]))
    assert [fault.where for fault in found] == ["--set run.speed=2:1:1", "--set nothing", "--set a=3", "--set b=1:2:0"]


@pytest.mark.parametrize("how", ["sobl:4", "sobol:5", "lhs:0", "lhs", "lhs:-3", "sobol:4.0"])
def test_invalid_sample_is_refused(how):
    assert faults(lambda: parse_sample(how))[0].where == "--sample"


def test_invalid_plans_are_refused():
    found = faults(lambda: make_plan(parse_axes(["a=1:2", "b=3:4"])))
    assert [(f.given, f.remedy.partition(",")[0]) for f in found] == [("an interval", "give a number of values")] * 2
    assert faults(lambda: make_plan(parse_axes(["a=1"])))[0].why == "nothing varies"
    assert "--set run.speed=1000:" in faults(lambda: make_plan(parse_axes(["run.speed=3000rpm"])))[0].remedy
    assert "--limit 10201" in faults(lambda: make_plan(parse_axes(["a=0:100:1", "b=0:100:1"])))[0].remedy
    assert len(make_plan(parse_axes(["a=0:100:1", "b=0:100:1"]), limit=10201)) == 10201


def test_interval_without_unit_and_step_has_both_faults(case):
    given = [fault.given for fault in faults(lambda: make_sweep(case, ["run.speed=1000:3000"]))]
    assert given == ["an interval", "numbers without a unit"]


def test_faults_of_keys_units_and_values_are_in_one_report(case):
    wrong = ["run.speed=1000:3000:1000kN", "springs.valve.stifness=1,2kN/m", "cams.intake.lift=-1:5:3mm"]
    found = {fault.where: fault for fault in faults(lambda: make_sweep(case, wrong))}
    assert set(found) == {f"--set {one}" for one in wrong}
    assert found[f"--set {wrong[0]}"].given == "'1000kN', '2000kN', '3000kN'"
    assert "is not a unit of speed" in found[f"--set {wrong[0]}"].why
    assert found[f"--set {wrong[1]}"].remedy == "did you mean 'stiffness'?"
    assert found[f"--set {wrong[2]}"].why == "in variants 1, 4, 7 and 3 more"  # 2 mm and 5 mm are lifts


def test_unknown_table_suggests_similar_name(case):
    assert faults(lambda: make_sweep(case, ["sprigs.valve.stiffness=1,2kN/m"]))[0].remedy == "did you mean 'springs'?"


def test_only_ends_of_invalid_axis_are_read(case, monkeypatch):
    read, variants = CaseFile.read, []
    monkeypatch.setattr(CaseFile, "read", lambda file, *words: variants.append(words) or read(file, *words))
    assert len(faults(lambda: make_sweep(case, ["run.speed=1:9000:1kN"]))) == 1
    assert 0 < len(variants) < 10


def test_faults_of_sweep_table_name_line(case, text):
    table = '\n[sweep]\nset = { "run.speed" = "1000:2000:-500rpm", "springs.valve.stiffness" = "30:60kN/m" }\n'
    case.write_text(text + table, encoding="utf-8")
    line = len(text.splitlines()) + 3
    found = faults(lambda: make_sweep(case))
    assert found[0].where == f"sweep.set.run.speed (line {line})"
    assert faults(lambda: make_sweep(case, ["run.speed=1000,2000rpm"]))[0].where.startswith(
        "sweep.set.springs.valve.stiffness"
    )
    case.write_text(text + '\n[sweep]\nseed = -1\nsampel = "lhs:3"\n', encoding="utf-8")
    assert {fault.where.partition(" ")[0] for fault in faults(lambda: make_sweep(case))} == {
        "sweep.seed",
        "sweep.sampel",
    }


def test_sweep_of_sweep_keys_or_estimates_is_refused(case):
    assert faults(lambda: make_sweep(case, ["sweep.seed=1,2"]))[0].why == "it defines the sweep"
    found = faults(lambda: make_sweep(case, ["run.speed=1000,2000rpm", "fidelity.estimate=true"]))
    assert found[0].remedy == "--set fidelity.estimate=false"


def test_range_without_unit_is_refused(case):
    setting = "run.speed=100:300:100"
    (fault,) = faults(lambda: make_sweep(case, [setting]))
    assert fault.where == f"--set {setting}"
    assert "3000 rpm" in fault.allowed
    assert len(make_sweep(case, ["run.revolutions=1,2"]).plan) == 2
