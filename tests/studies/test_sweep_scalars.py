"""Scalars of a sweep row equal the results of the other commands for the same run."""

import math
import re

import numpy as np
import pytest

from flexcam import prepare, read_case, read_result, run, solve
from flexcam.analysis.comparison import deviation
from flexcam.analysis.preparation import scalar_probe
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.dynamics import SLOPES, Cause, peak
from flexcam.studies.evaluation import are_probe_scalars, evaluate, scalar_names
from tests.thinning import mostly_slow, slow_if

CASES = {
    "cases/tayeb/model-1-shm.toml": ["run.steps_per_revolution=720"],
    "cases/pushrod-engine/intake.toml": ["run.revolutions=0.3", "run.steps_per_revolution=720"],
    "cases/li/valve-train.toml": ["run.steps_per_revolution=720"],
    "tests/data/inline.toml": ["fidelity.model=sdof", "run.steps_per_revolution=720"],
}


CAMSHAFT = {"cams.intake.twist.largest", "cams.intake.deflection.largest", "supports.drive.torque.largest"}

DRIVE = {"supports.drive.torque.mean", "supports.drive.power.mean"}  # of any sign

PUSHROD = {"members.pushrod.compression.largest", "members.pushrod.buckling_margin"}


def test_single_mass_has_no_camshaft_scalars():
    """Its twist would be zero; models with few masses have a camshaft if they sense the cam through a contact.

    The force of a pushrod next to the single mass is that of the springs, and is not a scalar either.
    """
    quick = ["run.revolutions=1", "run.steps_per_revolution=720"]
    rows = {model: evaluate(read_case("cases/tayeb/model-1-shm.toml", [f"fidelity.model={model}", *quick])).scalars
            for model in ("sdof", "beams")}  # fmt: skip
    assert set(rows["beams"]) - set(rows["sdof"]) == CAMSHAFT | DRIVE | PUSHROD
    assert all(rows["beams"][name] > 0.0 for name in CAMSHAFT)
    with_contact = evaluate(read_case("cases/pushrod-engine/intake.toml", [*quick, "fidelity.model=sdof"]))
    assert set(with_contact.scalars) >= CAMSHAFT | DRIVE


@pytest.mark.slow
@pytest.mark.parametrize(("asked", "cause"), [(0.01, Cause.DONE), (1e-9, Cause.TOLERANCE)])
def test_row_states_chosen_model(asked, cause):
    row = evaluate(read_case("tests/data/inline.toml", ["run.steps_per_revolution=120", f"fidelity.tolerance={asked}"]))
    assert row.status.cause is cause
    assert row.scalars  # those of the closest model if no model is within the tolerance
    named = r"chosen within the tolerance: sdof, \d+ steps" if row.status.ok else r"that is [a-z0-9 ]+, \d+ steps"
    assert re.search(named + " per revolution", row.status.message)
    assert not evaluate(read_case("tests/data/inline.toml", ["run.steps_per_revolution=120"])).status.message


@pytest.mark.parametrize(
    "path",
    slow_if(lambda path: "/tayeb/" not in path and "/li/" not in path, CASES),
)
def test_row_matches_run_and_compare(path):
    case = read_case(path, CASES[path])
    row, ready = evaluate(case), prepare(case)
    assert row.status.ok
    assert set(row.units) == set(row.scalars)
    assert set(row.scalars) <= set(scalar_names(case))
    response = solve(ready.problem, ready.scheme, save=ready.save)
    assert {f.name: f.value for f in compute_metrics(ready, response)}.items() <= row.scalars.items()
    probe = scalar_probe(ready)
    found = deviation(case, probe)
    deviations = [row.scalars["deviation.peak"], row.scalars["deviation.rms"]]
    assert deviations == pytest.approx(
        [found.peak_deviation, found.rms_deviation], rel=1e-12
    )  # different blocks of instants
    turns = min(
        case.record.run.revolutions, 1.0
    )  # an instant per step of the last revolution; all instants of a shorter run
    steps = round(turns * ready.revolution / ready.problem.step) + (turns < 1.0)
    for series, unit in (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2")):
        name = f"probes.{probe}.{series}.largest"
        moved = getattr(response[probe], series)[-steps:]
        slopes = getattr(response[probe], SLOPES[series])[-steps:] if series in SLOPES else None
        assert row.scalars[name] == peak(response.time[-steps:], moved, slopes)[0] >= np.abs(moved).max()
        assert row.units[name] == unit
    assert row.scalars["energy.residual.largest"] == np.abs(response.channels["energy.residual"]).max()
    assert all(math.isfinite(value) for value in row.scalars.values())


@pytest.mark.parametrize(
    ("path", "runs"), mostly_slow([*((path, 100) for path in CASES), ("cases/tayeb/model-1-shm.toml", 1)], 2)
)
def test_row_without_channels_has_probe_scalars(path, runs):
    """Equal to rounding: 1e-9 is about a hundred roundings of an acceleration of stiff parts."""
    case = read_case(path, CASES[path])
    whole, row = evaluate(case, runs=runs), evaluate(case, runs=runs, channels=False)
    assert row.status.ok
    assert row.scalars.keys() == {name for name in whole.scalars if are_probe_scalars([name])}
    assert len(row.scalars) >= 5
    for name, value in row.scalars.items():
        series = name.removeprefix("probes.").split(".")[-2:]
        size = max(value for one, value in whole.scalars.items() if one.split(".")[-2:] == series)
        assert abs(value - whole.scalars[name]) <= 1e-9 * size, name


def test_result_file_is_complete(tmp_path):
    """Independent of the scalars of the row."""
    case = read_case("cases/li/valve-train.toml", ["run.steps_per_revolution=720"])
    assert evaluate(case, folder=tmp_path, channels=False).scalars == evaluate(case).scalars
    assert read_result(next(tmp_path.iterdir())).response.channels


def test_units_of_rotations():
    row = evaluate(read_case("cases/tayeb/model-1-shm.toml", ["run.revolutions=0.1"]))
    assert row.units["probes.cam.rx.velocity.largest"] == "rad/s"
    assert row.units["contacts.intake.force.largest"] == "N"


def test_rigid_case_has_no_energy_scalars():
    """A rigid case has no unknowns with energy, while the torque of the cam does work."""
    case = read_case("cases/tayeb/model-1-shm.toml", ["fidelity.model=rigid", "run.revolutions=0.1"])
    assert not any(name.startswith("energy.") for name in [*scalar_names(case), *run(case).channels])


def test_rigid_case_has_no_deviation_scalars():
    row = evaluate(read_case("cases/tayeb/model-1-shm.toml", ["fidelity.model=rigid", "run.revolutions=0.1"]))
    assert row.status.ok
    assert not any(name.startswith("deviation") for name in row.scalars)


def test_maxima_are_those_of_last_revolution():
    start = 'run.start={ velocity = { "tappet.uy" = "5 m/s" } }'
    words = [start, "run.damping.modal=0.3", "run.steps_per_revolution=720", "run.revolutions=2"]
    row = evaluate(read_case("tests/data/inline.toml", words))
    one = evaluate(read_case("tests/data/inline.toml", [*words, "run.revolutions=1"]))
    name = "probes.valve.acceleration.largest"
    assert row.scalars[name] < 0.5 * one.scalars[name]  # initial velocity, decayed a revolution later
