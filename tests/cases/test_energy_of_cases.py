"""Energy balance of all shipped cases, also with steps that are too long for their contacts."""

from pathlib import Path

import numpy as np
import pytest

import flexcam

ROOT = Path(__file__).parents[2]
CASES = [
    path
    for path in sorted((ROOT / "cases").glob("*/*.toml"))
    if path.parent.name != "cams" and not path.stem.endswith(("-cycloidal", "-parabolic"))
]


STEPS = {"pump-up": 1000}
"""Steps per revolution of cases that need more than 100: the impact of this plunger on its ring lasts 0.05 ms."""

SLOW = ("bucket", "finger", "intake", "lever", "pump-up", "rocker", "valve-mass")
"""Cases whose run with the direct engine takes seconds."""


def marks(number, path, engine):
    """Return the marks that keep each case with one of the two engines in the normal suite."""
    slow = path.stem == "pump-up" or (engine == "direct") == bool(number % 2 or path.stem in SLOW)
    return [pytest.mark.slow] * slow


@pytest.mark.parametrize(
    ("path", "engine"),
    [
        pytest.param(path, engine, id=f"{path.stem}-{engine}", marks=marks(number, path, engine))
        for number, path in enumerate(CASES)
        for engine in ("direct", "auto")
    ],
)
def test_dissipated_energy_never_decreases(path, engine):
    """A contact may close and open again within one step; it must not return energy."""
    steps = STEPS.get(path.stem, 100)
    case = flexcam.read_case(path, ["run.revolutions=1", f"run.steps_per_revolution={steps}", f"run.engine={engine}"])
    response = flexcam.run(case)
    energy = {name: response.channels[f"energy.{name}"] for name in ("work", "kinetic", "strain", "dissipated")}
    assert (np.diff(energy.pop("dissipated")) >= 0.0).all()
    energy_range = max(np.ptp(part) for part in energy.values())
    assert np.abs(response.channels["energy.residual"]).max() <= 1e-3 * energy_range
