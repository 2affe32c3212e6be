"""Overrides of a case: numbers in lists, and keys that replace exclusive ones."""

from pathlib import Path

import pytest

from flexcam import InputError, read_case
from flexcam.studies.executors import SerialWorkers
from flexcam.studies.sweep import make_sweep, run_sweep

CASES = Path(__file__).resolve().parents[2] / "cases"
PUBLISHED = CASES / "tayeb/model-1-shm.toml"  # gives speed and steps_per_revolution
ENGINE = CASES / "pushrod-engine/intake.toml"  # gives crank_speed


def test_override_of_number_in_list():
    assert read_case(PUBLISHED, ["rockers.rocker.arms.1=42mm"]).record.rockers["rocker"].arms == (0.025, 0.042)
    full = read_case(PUBLISHED, ['rockers.rocker.arms=["25 mm", "42 mm"]'])
    assert read_case(PUBLISHED, ["rockers.rocker.arms.1=0.042"]).record == full.record


COILS = 'springs.valve={ at = "valve", direction = "uy", coils = [{ turns = 2, diameter = 0.024, pitch = 0.006 }, '
COILS += "{ turns = 4, diameter = [0.024, 0.02], pitch = 0.009 }], wire = { diameter = 0.004, shear_modulus = 80e9 } }"
TABLE = 'springs.valve={ at = "valve", direction = "uy", force_table = [[0, 0], [0.02, 600.0]] }'


def test_override_of_number_in_list_of_tables():
    overrides = [
        "springs.valve.coils.0.turns=3",
        "springs.valve.coils.1.pitch=8mm",
        "springs.valve.coils.1.diameter.0=23mm",
    ]
    first, second = read_case(PUBLISHED, [COILS, *overrides]).record.springs["valve"].coils
    assert (first.turns, second.pitch, second.diameter) == (3.0, 0.008, (0.023, 0.02))
    table = read_case(PUBLISHED, [TABLE, "springs.valve.force_table.1.1=700N"]).record.springs["valve"].force_table
    assert table == [(0.0, 0.0), (0.02, 700.0)]


@pytest.mark.parametrize(("key", "given"), [("coils.2.turns", "'2'"), ("coils.0.turns.1", "key '1'"), ("coils.0", "3")])
def test_invalid_key_in_list_of_tables_is_refused(key, given):
    with pytest.raises(InputError) as refusal:
        read_case(PUBLISHED, [COILS, f"springs.valve.{key}=3"])
    assert given in [fault.given for fault in refusal.value.faults]


@pytest.mark.parametrize("position", ["2", "-1", "x", "²"])
def test_invalid_list_position_is_refused(position):
    with pytest.raises(InputError) as refusal:
        read_case(PUBLISHED, [f"rockers.rocker.arms.{position}=42mm"])
    (fault,) = refusal.value.faults
    assert fault.where == f"--set rockers.rocker.arms.{position}=42mm"
    assert fault.allowed == "a position in the list, 0 to 1"


@pytest.mark.parametrize(
    ("path", "laid", "same"),
    [
        (PUBLISHED, "run.crank_speed=6000rpm", "run.speed=3000rpm"),
        (ENGINE, "run.speed=3000rpm", "run.crank_speed=6000rpm"),
        (PUBLISHED, "run.step=10us", ""),
    ],
)
def test_override_replaces_exclusive_key(path, laid, same):
    case = read_case(path, [laid])
    assert case.speed == pytest.approx(read_case(path, [same] if same else []).speed, rel=1e-15)
    run = case.record.run
    assert (run.speed is None) != (run.crank_speed is None)
    assert (run.step is None) == ("step" not in laid.partition("=")[0].split(".")[1].split("_"))


def test_two_exclusive_overrides_are_refused():
    with pytest.raises(InputError, match="either speed or crank_speed"):
        read_case(PUBLISHED, ["run.speed=1000rpm", "run.crank_speed=2000rpm"])


def test_override_without_value_is_only_fault():
    """The crank_speed of the case is not removed."""
    with pytest.raises(InputError) as refusal:
        read_case(ENGINE, ["run.speed"])
    assert [fault.where for fault in refusal.value.faults] == ["--set run.speed"]


def test_speed_and_crank_speed_sweeps_agree():
    """The camshaft turns at half the crank speed."""
    quick = ["run.revolutions=0.1", "rockers.rocker.arms.1=40,42mm"]
    ours, theirs = (
        run_sweep(make_sweep(PUBLISHED, [one, *quick]), SerialWorkers())
        for one in ("run.crank_speed=4000,6000rpm", "run.speed=2000,3000rpm")
    )
    assert ours.shape == (2, 2)
    assert ours["deviation.peak"].tolist() == theirs["deviation.peak"].tolist()
    assert len(set(ours["deviation.peak"].tolist())) == 4


def test_replace_equals_overrides_from_file():
    """A table changes only its keys, and earlier changes from Python remain."""
    case = read_case(ENGINE, ["run.revolutions=2"])
    changed = case.replace({"springs": {"valve": {"stiffness": 60e3, "wire": {"diameter": 0.005}}}, "title": "Stiff"})
    same = ["run.revolutions=2", "springs.valve.stiffness=60 kN/m", "springs.valve.wire.diameter=5 mm", "title=Stiff"]
    assert changed.record == read_case(ENGINE, same).record
    assert case.replace({"springs.valve.stiffness": "60 kN/m"}).record.springs["valve"].stiffness == 60e3
    assert case.record.springs["valve"].stiffness == 50e3
    assert "extra" in case.replace({"masses": {"extra": {"at": "cam", "mass": "1 g"}}}).record.masses
    faster = case.at_speed(200.0).replace({"run.revolutions": 3})
    assert (faster.speed, faster.turns, faster.record.run.revolutions) == (200.0, 2.0, 3.0)
    given = case.at_speed(200.0, 5.0).replace({"run": {"speed": 150.0}})
    assert (given.speed, given.turns, given.record.run.revolutions) == (150.0, 1.0, 5.0)


def test_fault_of_python_override_names_key():
    for change in (read_case(ENGINE).replace, lambda values: read_case(ENGINE, values)):
        with pytest.raises(InputError) as refusal:
            change({"springs.valv": {"stiffness": 60e3}})
        assert "springs.valv.at" in str(refusal.value)
        assert "--set" not in str(refusal.value)
