"""Runs of cases that several tests look at."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from flexcam import prepare, read_case, run

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def flown():
    """Return the response and the model of a case by its name below `cases` and overrides, each run once."""

    @functools.cache
    def make(name, *over, rigid=False):
        case = read_case(ROOT / f"cases/{name}.toml", list(over))
        return run(case, rigid=rigid), prepare(case).model

    return make
