"""Thousands of changed inputs: command lines."""

import pytest

from tests.fuzz.targets import GROUPS, check_all


@pytest.mark.slow
@pytest.mark.parametrize("name", GROUPS["commands"])
def test_changed_inputs_are_accepted_or_refused(name, tried):
    check_all(name, tried)
