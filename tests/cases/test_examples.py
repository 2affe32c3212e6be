"""All examples run in their folder, pass their own assertions, draw a figure and leave no files."""

import runpy
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from tests.thinning import mostly_slow

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))


SLOW = ("loss_of_contact", "speed_against_accuracy", "sweep_over_speed")


@pytest.mark.parametrize(
    "path",
    mostly_slow([pytest.param(one, marks=[pytest.mark.slow] * (one.stem in SLOW), id=one.stem) for one in EXAMPLES], 2),
)
def test_example_runs_and_draws_figure(path, monkeypatch):
    monkeypatch.chdir(FOLDER)
    before = set(FOLDER.iterdir())
    made = runpy.run_path(str(path), run_name="__main__")
    figures = [value for value in made.values() if isinstance(value, Figure)]
    assert figures
    assert all(figure.axes for figure in figures)
    assert set(FOLDER.iterdir()) - before <= {FOLDER / "__pycache__"}


def test_number_of_examples():
    assert 6 <= len(EXAMPLES) <= 11
