"""Whatever is done to a case text, flexcam accepts it or refuses it in its own words."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flexcam import FlexcamError, InputError, prepare, read_case

LINES = (Path(__file__).parents[1] / "data/inline.toml").read_text(encoding="utf-8").splitlines()
VALUES = [
    '"6 mm"', '"-6 mm"', '"6 kg"', '"180 deg"', '"steel"', '"valve"', '"cam"', '"uy"', '"tube"', '""', "0", "-1", "1", "3.5", "1e308", "5e-324",
    "nan", "inf", "true", "[]", "{}", "[1, 2, 3]", "[true, 0, 0]", '["a", "b", "c"]', '["cam", "front"]', "[[1], [2, 3]]", "{ x = 1 }", "2024-05-01",
    "07:30:00", "999999999999999999999999999999", '"\\u0000"', '"ä & <b>"', '"1e400 m"', '{ at = "cam" }', '{ shape = "tube" }', "[[]]", "[{}]",
]  # fmt: skip


def delete(lines, i, j, value):
    return lines[:i] + lines[i + 1 :]


def repeat(lines, i, j, value):
    return lines[: i + 1] + lines[i:]


def move(lines, i, j, value):
    return [*lines[:i], lines[j], *lines[i:]]


def replace(lines, i, j, value):
    return [*lines[:i], f"{lines[i].split('=')[0]}= {value}", *lines[i + 1 :]]


def exchange(lines, i, j, value):
    return [*lines[:i], lines[i].split("=")[0] + "=" + lines[j].partition("=")[2], *lines[i + 1 :]]


def cut(lines, i, j, value):
    return [*lines[:i], lines[i][: j % (len(lines[i]) + 1)], *lines[i + 1 :]]


def rename(lines, i, j, value):
    return [*lines[:i], lines[i].replace(lines[i][j % (len(lines[i]) + 1) :][:1], "e"), *lines[i + 1 :]]


WAYS = st.sampled_from([delete, repeat, move, replace, replace, replace, exchange, cut, rename])
STEPS = st.lists(
    st.tuples(WAYS, st.integers(0, 200), st.integers(0, 200), st.sampled_from(VALUES)), min_size=1, max_size=4
)


def mutated(steps):
    lines = LINES
    for way, i, j, value in steps:
        if lines:
            lines = way(lines, i % len(lines), j % len(lines), value)
    return "\n".join(lines)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "case.toml"


def prepared(path):
    """Read and build; sizes near the end of the doubles may overflow, which is no fault by itself."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        prepare(read_case(path))


def outcome(path):
    """Let nothing but flexcam's own errors happen, and these say something."""
    try:
        prepared(path)
    except InputError as refusal:
        told = [(fault.where, fault.given, fault.allowed) for fault in refusal.faults]
    except FlexcamError as failure:
        told = [(str(failure),)]
    else:
        return
    assert told
    assert all(all(parts) for parts in told), told


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=STEPS)
def test_accepted_or_refused_never_broken(steps, path):
    path.write_text(mutated(steps), encoding="utf-8")
    outcome(path)


KEYS = [i for i, line in enumerate(LINES) if "=" in line and not line.startswith("#")]


@pytest.mark.parametrize(("first", "value"), list(enumerate(VALUES)))
def test_every_value_at_every_tenth_key(first, value, path):
    """Keys of the file hold the value in turn; those beside them hold the values beside it."""
    broken = {}
    for i in KEYS[first % 10 :: 10]:
        path.write_text("\n".join(replace(LINES, i, 0, value)), encoding="utf-8")
        try:
            outcome(path)
        except Exception as fault:  # noqa: BLE001 - that is what is looked for
            broken[LINES[i]] = repr(fault)
    assert not broken
