"""Mutated case texts are accepted or refused with an error of flexcam."""

# ruff: noqa: E501 - tables, a row to a line

import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flexcam import FlexcamError, InputError, prepare, read_case
from tests.thinning import mostly_slow

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


MUTATIONS = st.sampled_from([delete, repeat, move, replace, replace, replace, exchange, cut, rename])
STEPS = st.lists(
    st.tuples(MUTATIONS, st.integers(0, 200), st.integers(0, 200), st.sampled_from(VALUES)), min_size=1, max_size=4
)


def mutate(steps):
    lines = LINES
    for mutation, i, j, value in steps:
        if lines:
            lines = mutation(lines, i % len(lines), j % len(lines), value)
    return "\n".join(lines)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "case.toml"


def read_and_prepare(path):
    """Read and prepare a case; sizes near the largest double may overflow, which is no fault by itself."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        prepare(read_case(path))


def check_outcome(path):
    """Assert that only errors of flexcam occur and that their messages are not empty."""
    try:
        read_and_prepare(path)
    except InputError as refusal:
        messages = [(fault.where, fault.given, fault.allowed) for fault in refusal.faults]
    except FlexcamError as failure:
        messages = [(str(failure),)]
    else:
        return
    assert messages
    assert all(all(parts) for parts in messages), messages


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=STEPS)
def test_mutated_case_is_accepted_or_refused(steps, path):
    path.write_text(mutate(steps), encoding="utf-8")
    check_outcome(path)


KEYS = [i for i, line in enumerate(LINES) if "=" in line and not line.startswith("#")]


@pytest.mark.parametrize(("first", "value"), mostly_slow(list(enumerate(VALUES)), 2))
def test_unusual_values_at_every_key_are_accepted_or_refused(first, value, path):
    """Each value is set at every tenth key, with a different first key for each value."""
    broken = {}
    for i in KEYS[first % 10 :: 10]:
        path.write_text("\n".join(replace(LINES, i, 0, value)), encoding="utf-8")
        try:
            check_outcome(path)
        except Exception as fault:  # noqa: BLE001 - the test looks for any other exception
            broken[LINES[i]] = repr(fault)
    assert not broken
