"""Thousands of changed inputs: cases and files of cams."""

from __future__ import annotations

import pytest

from tests.fuzz.targets import GROUPS, check_all


@pytest.mark.slow
@pytest.mark.parametrize("name", GROUPS["cases"])
def test_no_input_breaks_flexcam(name, tried):
    check_all(name, tried)
