"""Runs that would be too large are refused, and those that take too long end with what they have."""

from __future__ import annotations

import itertools
import json
import time
from pathlib import Path

import pytest

from flexcam import read_case, read_result
from flexcam.budget import within
from flexcam.response import Cause
from flexcam.runner import budget_of, prepare

HUGE = ("--set", "run.revolutions=1e9")


def test_a_result_beyond_the_disk_is_refused(flexcam, case):
    ended = flexcam("run", case, *HUGE)
    assert ended.code == 2
    assert "disk: given a result file of" in ended.err
    assert "output.field_every" in ended.err
    assert "--allow-large" in ended.err
    assert not Path("results").exists()


def test_in_json_it_has_five_facts(flexcam, case):
    ended = flexcam("run", case, *HUGE, "--json")
    assert ended.code == 2
    (error,) = ended.json["errors"]
    assert error["where"] == "disk"


def test_it_may_be_tried_all_the_same(flexcam, case, monkeypatch):
    monkeypatch.setattr(within, "free_memory", lambda: 100_000)
    assert "memory: given a run of" in flexcam("run", case, "-o", "out").err
    assert flexcam("run", case, "-o", "out", "--allow-large").code == 0


MANY = [
    ("sweep", "--set", "run.speed=1000:3000:1000rpm", "--workers", "0"),
    ("sensitivity", "--of", "deviation.peak", "--to", "springs.valve.stiffness"),
]


@pytest.mark.parametrize("words", MANY, ids=lambda words: words[0])
def test_many_runs_are_refused_before_the_first(flexcam, case, monkeypatch, words):
    monkeypatch.setattr(within, "free_memory", lambda: 100_000)
    ended = flexcam(words[0], case, *words[1:])
    assert ended.code == 2
    assert "memory: given a run of" in ended.err
    assert flexcam(words[0], case, *words[1:], "--allow-large").code == 0


def test_frequencies_need_no_room_for_a_run(flexcam, case, monkeypatch):
    monkeypatch.setattr(within, "free_memory", lambda: 100_000)
    ended = flexcam("sensitivity", case, "--of", "frequency.1", "--to", "springs.valve.stiffness")
    assert ended.code == 0


def test_check_tells_what_a_run_takes(flexcam, case):
    assert "of memory, a result of" in flexcam("check", case).out
    told = flexcam("check", case, "--json").json
    needs = budget_of(prepare(read_case(case)), "revolution")
    assert (told["memory_bytes"], told["result_bytes"]) == (needs.memory, needs.file)


@pytest.mark.parametrize("path", ["general", "modal", "compiled"])
def test_a_run_ends_when_its_time_is_over(flexcam, case, path, monkeypatch):
    """By a clock that jumps after it has been looked at some times, wherever the machine is by then."""
    looks = itertools.count()
    monkeypatch.setattr("time.monotonic", lambda: 0.0 if next(looks) < 20 else 1e6)
    endless = ("--set", "run.revolutions=1e6", "--allow-large")
    ended = flexcam("run", case, *endless, "--set", f"run.path={path}", "--time-limit", "1 h", "--json")
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


def test_the_search_for_a_start_ends_too(flexcam, case):
    ended = flexcam("run", case, "--set", "run.start=periodic", "--time-limit", "1 ms", "--json")
    assert ended.code == 3
    assert ended.json["status"] == "time-limit"
    assert "periodic start" in ended.json["message"]
    assert not list(Path().rglob("*.vtkhdf"))


def test_a_short_run_has_time(flexcam, case):
    assert flexcam("run", case, "--time-limit", "10 min").code == 0


@pytest.mark.parametrize("given", ["5", "5 mm", "soon", "-1 s", "0 s"])
def test_times_have_a_unit_and_are_not_over_yet(flexcam, case, given):
    ended = flexcam("run", case, "--time-limit", given)
    assert ended.code == 2
    assert "--time-limit" in ended.err
    assert json.dumps(given)[1:-1] in ended.err
