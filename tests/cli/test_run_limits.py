"""Runs that would be too large are refused, and those that take too long end with what they have."""

from __future__ import annotations

import itertools
import time
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


def test_a_result_beyond_the_disk_is_refused(flexcam, case):
    ended = flexcam("run", case, *HUGE)
    assert ended.code == 2
    assert "disk: got a result file of" in ended.err
    assert "output.field_every" in ended.err
    assert "--allow-large" in ended.err
    assert not Path("results").exists()


def test_in_json_it_has_five_facts(flexcam, case):
    ended = flexcam("run", case, *HUGE, "--json")
    assert ended.code == 2
    (error,) = ended.json["errors"]
    assert error["where"] == "disk"


def test_it_may_be_tried_all_the_same(flexcam, case, monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    assert "memory: got a run of" in flexcam("run", case, "-o", "out").err
    assert flexcam("run", case, "-o", "out", "--allow-large").code == 0


MANY = [
    ("sweep", "--set", "run.speed=1000:3000:1000rpm", "--workers", "0"),
    ("sensitivity", "--of", "deviation.peak", "--to", "springs.valve.stiffness"),
]


@pytest.mark.parametrize("words", MANY, ids=lambda words: words[0])
def test_many_runs_are_refused_before_the_first(flexcam, case, monkeypatch, words):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    ended = flexcam(words[0], case, *words[1:])
    assert ended.code == 2
    assert "memory: got a run of" in ended.err
    assert flexcam(words[0], case, *words[1:], "--allow-large").code == 0


def test_frequencies_need_no_room_for_a_run(flexcam, case, monkeypatch):
    monkeypatch.setattr(resources, "free_memory", lambda: 100_000)
    ended = flexcam("sensitivity", case, "--of", "frequency.1", "--to", "springs.valve.stiffness")
    assert ended.code == 0


def test_check_tells_what_a_run_takes(flexcam, case):
    assert "of disk space" in flexcam("check", case).out
    report = flexcam("check", case, "--json").json
    needs = estimate_case_resources(prepare(read_case(case)), "revolution")
    assert (report["memory_bytes"], report["result_bytes"]) == (needs.memory, needs.file)


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
def test_a_run_ends_when_its_time_is_over(flexcam, case, path, monkeypatch):
    """By a clock that jumps after it has been looked at some times, wherever the machine is by then."""
    looks = itertools.count()
    monkeypatch.setattr("time.monotonic", lambda: 0.0 if next(looks) < 20 else 1e6)
    endless = ("--set", "run.revolutions=1e6", "--allow-large")
    ended = flexcam("run", case, *endless, "--set", f"run.engine={path}", "--time-limit", "1 h", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    kept = read_result(ended.json["result"]).response
    assert kept.status.cause is Cause.TIME_LIMIT
    assert kept.stats.steps == ended.json["steps"] == len(kept.time) - 1 > 0


def test_time_passes(flexcam, case):
    begun = time.perf_counter()
    ended = flexcam("run", case, "--set", "run.revolutions=1e6", "--allow-large", "--time-limit", "0.3 s")
    assert ended.code == 3
    assert 0.3 < time.perf_counter() - begun < 20.0  # a busy machine


def test_a_run_without_a_checkpoint_is_not_offered_for_resuming(flexcam, case):
    late = flexcam("run", case, "--time-limit", "1 ms")
    assert late.code == 3
    assert "the run ended before its first checkpoint" in late.err
    assert flexcam("run", case, "--resume").code == 2
    assert flexcam("run", case, "--overwrite").code == 0


def test_the_search_for_a_start_ends_too(flexcam, case):
    ended = flexcam("run", case, "--set", "run.start=periodic", "--time-limit", "1 ms", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    assert "periodic start" in ended.json["message"]
    assert not list(Path().rglob("*.vtkhdf"))


def test_a_short_run_has_time(flexcam, case):
    assert flexcam("run", case, "--time-limit", "10 min").code == 0


TIMES = ["5", "5 mm", "soon", "-1 s", "0 s", "1h30", "5min -3s", "", "1e400s", "9" * 400 + "h", "nan"]


@pytest.mark.parametrize("given", TIMES)
def test_times_have_a_unit_and_are_not_over_yet(flexcam, case, given):
    ended = flexcam("run", case, f"--time-limit={given}", "--json")
    assert ended.code == 2
    (error,) = ended.json["errors"]
    assert error["where"] == "--time-limit"
    assert error["given"] == (given or "nothing")
    assert error["allowed"]
    assert error["remedy"]


def test_a_value_that_begins_with_a_dash(flexcam, case):
    stderr = flexcam("run", case, "--time-limit", "-1s").err
    assert "begins with - as --time-limit=VALUE" in stderr


@pytest.mark.parametrize(("given", "seconds"), [("5min30s", 330.0), ("1 h 30 min", 5400.0), (".5h", 1800.0)])
def test_times_may_have_several_units(given, seconds):
    assert parse_duration("--time-limit", given) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.slow
def test_the_choice_of_a_model_ends_too(flexcam, case):
    ended = flexcam("run", case, "--set", "fidelity.tolerance=0.01", "--time-limit", "1 ms", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    assert "fidelity.tolerance" in ended.json["message"]
    assert not list(Path().rglob("*.vtkhdf"))


@pytest.mark.parametrize("fault", [None, KeyboardInterrupt])
def test_the_estimate_of_errors_ends_too(fault, flexcam, case, monkeypatch):
    """The run before it is complete, and stays so."""
    known, late = estimate_errors, []

    def after_the_run(*words):
        late.append(True)
        if fault:
            raise fault
        return known(*words)

    monkeypatch.setattr("flexcam.cli.run.estimate_errors", after_the_run)
    monkeypatch.setattr("time.monotonic", lambda: 1e6 if late else 0.0)
    ended = flexcam("run", case, "--set", "fidelity.estimate=true", "--time-limit", "1 h", "--json")
    assert ended.code == 0
    assert ended.json["status"] == "done"
    assert [one for one in ended.json["warnings"] if "no errors are estimated" in one]
    assert read_result(ended.json["result"]).response.status.ok
