"""Mapping of an initial state from the nodes of one mesh to those of another."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case
from flexcam.analysis.model_choice import estimate_errors
from flexcam.case.variants import with_elements
from flexcam.valvetrain import build_structure

ROOT = Path(__file__).parents[2]
CANTILEVER = ROOT / "cases/checks/cantilever.toml"
CAMSHAFT = ROOT / "cases/camshaft-4cyl/camshaft.toml"
TIP = (
    'run.start={ displacement = { "tip.ux" = "2 mm", "tip.ry" = "1 deg", "tip.uz" = "1 um" }, '
    'velocity = { "tip.rz" = 3.0 } }'
)


def initial_motions(case):
    """Return displacements and velocities of the initial state of a case, and the z coordinates of its nodes."""
    dofs, start = build_structure(build_model(case)).dofs, prepare(case).problem.start
    return dofs.nodal(start.displacement), dofs.nodal(start.velocity), build_model(case).mesh.nodes[:, 2]


@pytest.mark.parametrize("own", [1, 2])
def test_inner_nodes_follow_cubic_of_initial_state(own):
    """A cubic with the deflection and the slope of the tip, clamped at one end; axial motion and twist are linear."""
    case = read_case(CANTILEVER, [f"members.beam.elements={own}", TIP])
    moved, moving, z = initial_motions(with_elements(case, factor=6 // own))
    middle = z / 0.5 if own == 1 else np.maximum(z / 0.25 - 1.0, 0.0)  # the initial state has the middle node at rest
    length, slope = 0.5 / own, np.radians(1.0)
    # v(x) = a x^2 + b x^3 with v(1) = 2 mm and v'(1) = slope L
    b = slope * length - 2.0 * 2e-3
    a = 2e-3 - b
    np.testing.assert_allclose(moved[:, 0], a * middle**2 + b * middle**3, atol=1e-15)
    np.testing.assert_allclose(moved[:, 4], (2.0 * a * middle + 3.0 * b * middle**2) / length, atol=1e-15)
    np.testing.assert_allclose(moved[:, 2], 1e-6 * middle, atol=1e-18)
    np.testing.assert_allclose(moving[:, 5], 3.0 * middle, atol=1e-15)
    assert not moved[:, [1, 3, 5]].any()


def test_mapping_to_fewer_or_equal_elements():
    """Nodes of fewer elements are a subset; inner nodes are named as in their own mesh."""
    finest = with_elements(read_case(CANTILEVER, ["members.beam.elements=1", TIP]), factor=8)
    *fine_motions, fine_heights = initial_motions(finest)
    for each in (1, 2, 4, 8):
        *motions, heights = initial_motions(with_elements(finest, each=each))
        at = [int(np.argmin(np.abs(fine_heights - height))) for height in heights]
        for own, fine in zip(motions, fine_motions, strict=True):
            np.testing.assert_allclose(own, fine[at], atol=1e-16)
    assert (
        read_case(CANTILEVER, [TIP]).record.run.start
        == with_elements(read_case(CANTILEVER, [TIP]), factor=1).record.run.start
    )


@pytest.mark.slow
def test_mapping_to_more_elements_is_smooth():
    """Moving buckets as initial state: nodes between their ends move with them, and the mesh error is small."""
    places = {"exhaust-2": -3.912, "intake-3": -3.914, "exhaust-4": -0.383, "intake-4": -0.382}
    speeds = {"exhaust-2": -2.544, "intake-3": 2.544, "exhaust-4": 0.661, "intake-4": -0.661}
    every = [f"{kind}-{n}" for kind in ("intake", "exhaust") for n in (1, 2, 3, 4)]
    ends = ("follower.uy", "retainer.uy")
    start = {
        "displacement": {f"{name}-{end}": f"{places.get(name, 0.009)} mm" for name in every for end in ends},
        "velocity": {f"{name}-{end}": f"{speed} m/s" for name, speed in speeds.items() for end in ends},
    }
    case = read_case(CAMSHAFT, {"run.steps_per_revolution": 360, "run.revolutions": 0.02, "run.start": start})
    for name in ("displacement", "velocity"):
        given, own = (getattr(one.record.run.start, name) for one in (with_elements(case, factor=3), case))
        assert {round(x, 12) for x in given.values()} == {round(x, 12) for x in own.values()}
        assert len(given) == 2 * len(own)  # two nodes between the ends of every bucket
    lift = next(one for one in estimate_errors(case, "intake-4-follower.uy") if one.quantity == "lift")
    assert lift.space < 1e-3 * lift.size


def test_initial_state_at_rest_is_unchanged():
    case = read_case(CAMSHAFT, ["run.start=rest"])
    assert with_elements(case, factor=2).record.run.start == "rest"
