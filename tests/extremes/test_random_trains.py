"""Random but feasible trains: each run is complete or its status names the cause, without exceptions or NaN."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, run
from flexcam.dynamics import RunFailedError
from tests.thinning import mostly_slow

CASE = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"


def overrides(seed):
    """Return masses, stiffnesses and speed over three decades around those of the engine."""
    random = np.random.default_rng(seed)

    def about(value):
        return value * 10.0 ** random.uniform(-1.5, 1.5)

    unilateral = random.random() < 0.7
    contact = (
        f'{{ cam = "intake", follower = "tappet", model = "unilateral", stiffness = {about(5e7)}, dissipation = 0.1 }}'
    )
    if not unilateral:
        contact = f'{{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = {about(5e7)} }}'
    return [
        f"run.crank_speed={about(4000.0)}rpm", "run.revolutions=1", "run.steps_per_revolution=720",
        f"masses.valve.mass={about(0.09)}", f"masses.follower.mass={about(0.06)}",
        f"springs.valve.stiffness={about(50e3)}", f"springs.valve.installed_force={about(400.0)}",
        f"springs.valve.mass={about(0.06)}", f"springs.valve.elements={random.integers(1, 13)}",
        f"contacts.intake={contact}", f"contacts.seat.stiffness={about(6e7)}", f"contacts.seat.damping={about(300.0)}",
        f"contacts.lash.gap={random.uniform(0.0, 1e-3)}", f"contacts.lash.stiffness={about(2e7)}",
        f"cams.intake.lift={6e-3 * random.uniform(0.4, 1.5)}",
    ]  # fmt: skip


def run_status(seed):
    try:
        response = run(read_case(CASE, overrides(seed)))
    except RunFailedError as failure:
        return failure.status
    for values in (*response.channels.values(), response.probes.displacement, response.fields.displacement):
        assert np.isfinite(values).all()
    return response.status


def check_status(seed):
    status = run_status(seed)
    assert status.ok or (len(status.text) > 20 and status.remedy), str(status)


QUICK = (0, 1, 2, 3, 6, 7)
"""Trains whose run takes a few seconds at most."""


@pytest.mark.parametrize("seed", mostly_slow(QUICK))
def test_selected_random_trains_complete_or_name_cause(seed):
    check_status(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", sorted({*range(500)} - {*QUICK}))
def test_500_random_trains_complete_or_name_cause(seed):
    check_status(seed)
