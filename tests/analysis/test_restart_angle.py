"""A restart continues at the cam angle of the result, for any new speed."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, read_case, run
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import solve

INLINE = Path(__file__).parents[1] / "data/inline.toml"


@pytest.fixture
def restart_path(tmp_path):
    """Return the path of a case next to its result, which ends at 450 deg."""
    ready = prepare(read_case(INLINE, ["run.revolutions=1.25"]))
    sink = open_result_file(ready, tmp_path)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    shutil.copy(INLINE, tmp_path / "next.toml")
    return tmp_path / "next.toml"


RESTART = ['run.start={ result = "inline.vtkhdf" }', "run.revolutions=0.25"]


@pytest.mark.parametrize(("rpm", "rigid"), [(1234, False), (6000, True)])
def test_restart_continues_cam_angle(restart_path, rpm, rigid):
    response = run(read_case(restart_path, [*RESTART, f"run.speed={rpm}rpm"]), rigid=rigid)
    degrees = np.degrees(response.angle[[0, -1]])
    assert degrees == pytest.approx([450.0, 540.0], abs=1e-6)  # of the step count: a quarter turn in whole steps


def test_restart_with_other_supports_raises_error(restart_path):
    with pytest.raises(InputError, match="same supports"):
        run(read_case(restart_path, [*RESTART, 'supports.cam=["uy"]']))
