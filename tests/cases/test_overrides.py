"""Values laid over a case: numbers in lists, and keys that stand instead of others."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexcam import InputError, read_case
from flexcam.studies.executors import SerialWorkers
from flexcam.studies.sweep import make_sweep, run_sweep

CASES = Path(__file__).resolve().parents[2] / "cases"
PUBLISHED = CASES / "tayeb/model-1-shm.toml"  # gives speed and steps_per_revolution
ENGINE = CASES / "pushrod-engine/intake.toml"  # gives crank_speed


def test_a_number_in_a_list_is_laid_over_by_its_position():
    assert read_case(PUBLISHED, ["rockers.rocker.arms.1=42mm"]).record.rockers["rocker"].arms == (0.025, 0.042)
    whole = read_case(PUBLISHED, ['rockers.rocker.arms=["25 mm", "42 mm"]'])
    assert read_case(PUBLISHED, ["rockers.rocker.arms.1=0.042"]).record == whole.record


@pytest.mark.parametrize("position", ["2", "-1", "x", "²"])
def test_a_position_that_a_list_does_not_have(position):
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
def test_a_key_of_the_run_stands_instead_of_what_excludes_it(path, laid, same):
    case = read_case(path, [laid])
    assert case.speed == pytest.approx(read_case(path, [same] if same else []).speed, rel=1e-15)
    run = case.record.run
    assert (run.speed is None) != (run.crank_speed is None)
    assert (run.step is None) == ("step" not in laid.partition("=")[0].split(".")[1].split("_"))


def test_two_that_exclude_each_other_are_refused():
    with pytest.raises(InputError, match="either speed or crank_speed"):
        read_case(PUBLISHED, ["run.speed=1000rpm", "run.crank_speed=2000rpm"])


def test_both_can_be_swept():
    """Any key of any case: the rows of crank speeds are those of half as many turns of the camshaft."""
    quick = ["run.revolutions=0.1", "rockers.rocker.arms.1=40,42mm"]
    ours, theirs = (
        run_sweep(make_sweep(PUBLISHED, [one, *quick]), SerialWorkers())
        for one in ("run.crank_speed=4000,6000rpm", "run.speed=2000,3000rpm")
    )
    assert ours.shape == (2, 2)
    assert ours["deviation.peak"].tolist() == theirs["deviation.peak"].tolist()
    assert len(set(ours["deviation.peak"].tolist())) == 4
