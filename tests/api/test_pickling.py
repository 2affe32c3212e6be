"""Cases, models and responses can be copied and sent to other processes."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import flexcam
from flexcam.case.builder import build_model
from tests.thinning import mostly_slow

CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.parametrize(
    "name", mostly_slow(["tayeb/model-3-shm", "pushrod-engine/intake", "direct-acting/finger", "li/valve-train"])
)
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])  # noqa: S301 - our own
def test_copied_case_model_and_response_are_equal(name, copied):
    case = flexcam.read_case(CASES / f"{name}.toml", ["run.revolutions=0.01", "run.engine=direct"])
    model, other = build_model(case), copied(build_model(case))
    assert copied(case).record == case.record
    assert np.array_equal(other.mesh.nodes, model.mesh.nodes)
    assert repr(other.springs) == repr(model.springs)
    run, copied_run = flexcam.run(case), copied(flexcam.run(copied(case)))
    assert np.array_equal(run.probes.displacement, copied_run.probes.displacement)


def test_number_of_modes_below_one_is_refused():
    with pytest.raises(flexcam.InputError, match="a whole number, at least 1"):
        flexcam.modes(flexcam.read_case(CASES / "tayeb/model-3-shm.toml"), -1)
