"""Overrides of a case as Python values."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case
from flexcam.cams import centreline, valve_event

FINGER = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
INLINE = Path(__file__).parents[1] / "data/inline.toml"
MASS = ["masses.new.at=cam", "masses.new.mass=1kg"]


def test_python_overrides_equal_text_overrides():
    values = {
        "springs.valve.stiffness": "45 kN/m", "run.revolutions": 2, "run.start": "rest", "fidelity.estimate": True,
        "rockers.finger.arms": (np.float64(0.02), 0.035), "run.gravity": np.array([0.0, -9.81, 0.0]),
        "cams.intake.law": {"id": "fb2", "split": np.float32(0.25)},
    }  # fmt: skip
    texts = [
        "springs.valve.stiffness=45 kN/m", "run.revolutions=2", "run.start=rest", "fidelity.estimate=true",
        "rockers.finger.arms=[0.02, 0.035]", "run.gravity=[0, -9.81, 0]",
        'cams.intake.law={ id = "fb2", split = 0.25 }',
    ]  # fmt: skip
    case = read_case(FINGER, values)
    assert case.record == read_case(FINGER, texts).record
    assert read_case(FINGER, case.overrides).record == case.record


def test_misspelt_override_of_given_key_gives_one_fault():
    with pytest.raises(InputError) as caught:
        read_case(FINGER, ["springs.valve.stifness=45 kN/m"])
    assert [fault.remedy for fault in caught.value.faults] == ["did you mean 'stiffness'?"]


def test_fault_of_python_value_names_key():
    with pytest.raises(InputError, match=r"springs\.valve\.stiffness.*45 kg"):
        read_case(FINGER, {"springs.valve.stiffness": "45 kg"})
    for value in (float("nan"), None, {1, 2}, b"45"):
        with pytest.raises(InputError, match=r"springs\.valve\.stiffness.*a finite number"):
            read_case(FINGER, {"springs.valve.stiffness": value})
    with pytest.raises(InputError, match=r"none\.csv"):
        read_case(FINGER, {"cams.intake.lift_table": Path("none.csv")})


def test_centreline_override_replaces_phase():
    """The case of the finger defines a phase."""
    case = read_case(FINGER, ["cams.intake.centreline=230deg"])
    assert centreline(build_model(case).cams["intake"].event) == pytest.approx(np.radians(230.0))
    with pytest.raises(InputError, match="centreline"):
        read_case(FINGER, ["cams.intake.centreline=230deg", "cams.intake.phase=10deg"])


@pytest.mark.parametrize("key", ["opening", "closing", "centre"])
def test_timing_sets_phase_by_follower_lift(key):
    """The built cam has the given timing at a lift of 0.050 in."""
    case = read_case(FINGER, [f'cams.intake.timing={{ lift = "0.050 in", {key} = "-30 deg" }}'])
    event = valve_event(build_model(case).cams["intake"].event, 0.00127)
    found = {"opening": 0.5 * event.opens, "closing": 0.5 * event.closes, "centre": 0.5 * event.centre}[key]
    assert math.remainder(found - np.radians(-30.0), 2.0 * np.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("timing", "more", "message"), [
    ('{ lift = "1 mm" }', [], "one of opening, closing, centre"),
    ('{ lift = "1 mm", opening = "1 deg", centre = "1 deg" }', [], "opening and centre"),
    ('{ lift = "1 m", opening = "1 deg" }', [], r"timing\.lift .*got '1 m', expected a lift below the maximum"),
    ('{ lift = "1 mm", opening = "1 deg" }', ["cams.intake.phase=1"], "one of phase, centreline, timing"),
])  # fmt: skip
def test_invalid_timing_is_refused(timing, more, message):
    with pytest.raises(InputError, match=message):
        read_case(FINGER, [f"cams.intake.timing={timing}", *more])


def test_override_adds_part():
    case = read_case(INLINE, MASS)
    assert case.record.masses["new"].mass == 1.0
    heavy, plain = (prepare(one).problem.system for one in (case, read_case(INLINE)))
    at = plain.names.index("cam.uy")
    assert (heavy.mass.diagonal() - plain.mass.diagonal())[at] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("given", [["springs.exhaust.stiffness=40kN/m"], ["springs.exhaust.at=cam"]])
def test_fault_of_unknown_part_names_existing_parts(given):
    with pytest.raises(InputError) as refusal:
        read_case(INLINE, given)
    (fault,) = refusal.value.faults
    assert (fault.given, fault.why) == ("'exhaust'", "the case has no springs.exhaust")
    assert fault.allowed == ", ".join(read_case(INLINE).record.springs)
    assert "springs.exhaust.direction as well" in fault.remedy


@pytest.mark.parametrize(("override", "meant"), [
    ("mases.new.mass=1kg", "masses"), ("runn.speed=3000rpm", "run"), ("masses.new.mas=1kg", "mass"),
    ("outptu.field_every=3", "output"),
])  # fmt: skip
def test_misspelt_override_suggests_key(override, meant):
    with pytest.raises(InputError) as refusal:
        read_case(INLINE, [*MASS, override])
    assert any(f"Did you mean {meant!r}" in str(fault) for fault in refusal.value.faults)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (FINGER, "a table that the case has: cams.intake.law, cams.intake.ramps, cams.intake.follower."),
        (INLINE, "a table that the case has. cams.intake contains no table."),
    ],
)
def test_fault_of_unknown_table_names_existing_tables(path, message):
    with pytest.raises(InputError) as refusal:
        read_case(path, ["cams.intake.spiral.height=0.1 mm"])
    assert str(refusal.value).endswith(f"got cams.intake.spiral, expected {message}")
