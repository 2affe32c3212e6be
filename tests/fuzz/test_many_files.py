"""Thousands of changed inputs: meshes, lift tables, profiles, results and tables of sweeps."""

import pytest

from tests.fuzz.targets import GROUPS, check_all


@pytest.mark.slow
@pytest.mark.parametrize("name", GROUPS["files"])
def test_changed_inputs_are_accepted_or_refused(name, tried):
    check_all(name, tried)
