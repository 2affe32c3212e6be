"""Runs that are too large are refused, and runs beyond the time limit end with a partial result."""

import itertools
from pathlib import Path

import pytest

from flexcam import read_case, read_result
from flexcam.analysis import resources
from flexcam.analysis.model_choice import estimate_errors
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import estimate_case_resources
from flexcam.cli.app import parse_duration
from flexcam.dynamics import Cause

HUGE = ("--set", "run.revolutions=1e9")


def test_result_larger_than_disk_is_refused(flexcam, case):
    ended = flexcam("run", case, *HUGE)
    assert ended.code == 2
    assert "disk: got a result file of" in ended.err
    assert "output.field_every" in ended.err
    assert "--allow-large" in ended.err
    assert not Path("results").exists()


def test_disk_refusal_in_json(flexcam, case):
    ended = flexcam("run", case, *HUGE, "--json")
    assert ended.code == 2
    (error,) = ended.json["errors"]
    assert error["where"] == "disk"


def test_allow_large_permits_large_run(flexcam, case, monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    assert "memory: got a run of" in flexcam("run", case, "-o", "out").err
    assert flexcam("run", case, "-o", "out", "--allow-large").code == 0


MANY = [
    ("sweep", "--set", "run.speed=1000:3000:1000rpm", "--workers", "0"),
    ("sensitivity", "--of", "deviation.peak", "--to", "springs.valve.stiffness"),
]


@pytest.mark.parametrize("words", MANY, ids=lambda words: words[0])
def test_studies_check_memory_before_first_run(flexcam, case, monkeypatch, words):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    ended = flexcam(words[0], case, *words[1:])
    assert ended.code == 2
    assert "memory: got a run of" in ended.err
    assert flexcam(words[0], case, *words[1:], "--allow-large").code == 0


def test_frequency_study_needs_no_memory_of_run(flexcam, case, monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    ended = flexcam("sensitivity", case, "--of", "frequency.1", "--to", "springs.valve.stiffness")
    assert ended.code == 0


def test_check_prints_memory_and_disk_of_run(flexcam, case):
    assert "of disk space" in flexcam("check", case).out
    report = flexcam("check", case, "--json").json
    needs = estimate_case_resources(prepare(read_case(case)), "revolution")
    assert (report["memory_bytes"], report["result_bytes"]) == (needs.memory, needs.file)


@pytest.mark.parametrize(
    "path", ["direct", pytest.param("modal", marks=pytest.mark.slow), pytest.param("kernel", marks=pytest.mark.slow)]
)
def test_time_limit_ends_run(flexcam, case, path, monkeypatch):
    """The clock jumps after 20 calls, independent of the speed of the machine."""
    calls = itertools.count()
    monkeypatch.setattr("time.monotonic", lambda: 0.0 if next(calls) < 20 else 1e6)
    endless = ("--set", "run.revolutions=1e6", "--allow-large")
    ended = flexcam("run", case, *endless, "--set", f"run.engine={path}", "--time-limit", "1 h", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    response = read_result(ended.json["result"]).response
    assert response.status.cause is Cause.TIME_LIMIT
    assert response.stats.steps == ended.json["steps"] == len(response.time) - 1 > 0


def test_run_without_checkpoint_cannot_resume(flexcam, case):
    late = flexcam("run", case, "--time-limit", "1 ms")
    assert late.code == 3
    assert "the run ended before its first checkpoint" in late.err
    assert flexcam("run", case, "--resume").code == 2
    assert flexcam("run", case, "--overwrite").code == 0


def test_result_without_steps_is_refused(flexcam, case):
    flexcam("run", case, "--time-limit", "0.001 ms")
    [path] = Path().rglob("*.partial.vtkhdf")
    for command, *options in (
        ["report"], ["plot"], ["view", "--save", "train.png"], ["export", "--format", "csv"], ["export"],
        ["compare", "--against", path],
    ):  # fmt: skip
        refused = flexcam(command, path, *options)
        assert refused.code == 2
        assert "expected a result with at least one step. The run ended before its first step" in refused.err
    assert flexcam("info", path, "--json").json["saved_steps"] == 0


def test_time_limit_ends_periodic_search(flexcam, case):
    ended = flexcam("run", case, "--set", "run.start=periodic", "--time-limit", "1 ms", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    assert "periodic start" in ended.json["message"]
    assert not list(Path().rglob("*.vtkhdf"))


def test_short_run_completes_within_time_limit(flexcam, case):
    assert flexcam("run", case, "--time-limit", "10 min").code == 0


TIMES = ["5", "5 mm", "soon", "-1 s", "0 s", "1h30", "5min -3s", "", "1e400s", "9" * 400 + "h", "nan"]


@pytest.mark.parametrize("given", TIMES)
def test_invalid_time_limits_are_refused(flexcam, case, given):
    ended = flexcam("run", case, f"--time-limit={given}", "--json")
    assert ended.code == 2
    (error,) = ended.json["errors"]
    assert error["where"] == "--time-limit"
    assert error["given"] == (given or "nothing")
    assert error["allowed"]
    assert error["remedy"]


def test_value_starting_with_dash_gets_hint(flexcam, case):
    stderr = flexcam("run", case, "--time-limit", "-1s").err
    assert "begins with - as --time-limit=VALUE" in stderr


@pytest.mark.parametrize(("given", "seconds"), [("5min30s", 330.0), ("1 h 30 min", 5400.0), (".5h", 1800.0)])
def test_durations_with_several_units(given, seconds):
    assert parse_duration("--time-limit", given) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.slow
def test_time_limit_ends_choice_of_model(flexcam, case):
    ended = flexcam("run", case, "--set", "fidelity.tolerance=0.01", "--time-limit", "1 ms", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    assert "fidelity.tolerance" in ended.json["message"]
    assert not list(Path().rglob("*.vtkhdf"))


@pytest.mark.parametrize("fault", [None, KeyboardInterrupt])
def test_time_limit_ends_error_estimate(fault, flexcam, case, monkeypatch):
    """The preceding run remains complete."""
    original, started = estimate_errors, []

    def estimate_after_run(*words):
        started.append(True)
        if fault:
            raise fault
        return original(*words)

    monkeypatch.setattr("flexcam.cli.run.estimate_errors", estimate_after_run)
    monkeypatch.setattr("time.monotonic", lambda: 1e6 if started else 0.0)
    ended = flexcam("run", case, "--set", "fidelity.estimate=true", "--time-limit", "1 h", "--json")
    assert ended.code == 0
    assert ended.json["status"] == "done"
    assert [warning for warning in ended.json["warnings"] if "no errors are estimated" in warning]
    assert read_result(ended.json["result"]).response.status.ok
