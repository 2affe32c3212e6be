"""Cached runs of cases for several tests."""

import functools
from pathlib import Path

import pytest

from flexcam import prepare, read_case, run

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def run_case():
    """Return a cached function that runs a case of the folder `cases` and returns response and model."""

    @functools.cache
    def make(name, *over, rigid=False):
        case = read_case(ROOT / f"cases/{name}.toml", list(over))
        return run(case, rigid=rigid), prepare(case).model

    return make
