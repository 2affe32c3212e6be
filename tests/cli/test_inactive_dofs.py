"""Inactive degrees of freedom: `check` lists them, `run` prints their number, and results contain them."""

import re

import numpy as np
import pytest

from flexcam import read_case, read_result
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.run import run

SIDEWAYS = 'loads.side={ at = "cam", direction = "uz", force = "100 N" }'


def check_dofs(flexcam, *more):
    report = flexcam("check", *more, "--json").json
    return report["dof"], report["integrated"], report["left_out"]


def test_check_lists_inactive_dofs_with_reasons(flexcam, tayeb):
    dof, integrated, inactive = check_dofs(flexcam, tayeb(3))
    assert (dof, integrated) == (47, 24)
    assert inactive[:2] == [
        "camshaft: axial motion (ux): not held and not loaded",
        "camshaft: bending in x-z (uz, ry): not loaded",
    ]
    table = re.sub(r"\s+", " ", flexcam("check", tayeb(3)).out)
    assert "inactive camshaft: axial motion (ux): not held and not loaded; camshaft: bending in x-z" in table


def test_load_activates_its_dofs(flexcam, tayeb):
    dof, integrated, inactive = check_dofs(flexcam, tayeb(3), "--set", SIDEWAYS)
    assert (dof, integrated) == (47, 37)
    assert not any("x-z" in group for group in inactive)


def test_constant_load_at_equilibrium_leaves_dofs_inactive(flexcam, tayeb):
    dof, integrated, inactive = check_dofs(flexcam, tayeb(3), "--set", SIDEWAYS, "--set", "run.start=equilibrium")
    assert (dof, integrated) == (47, 24)
    reason = "constant loads in static equilibrium, no motion"
    assert f"camshaft: bending in x-z (uz, ry): {reason}" in inactive


def test_prune_false_keeps_all_dofs_active(flexcam, tayeb):
    assert check_dofs(flexcam, tayeb(3), "--set", "fidelity.prune=false") == (47, 47, [])


def test_run_prints_total_and_active_unknowns(flexcam, tayeb, tmp_path):
    done = flexcam("run", tayeb(3), "--set", "run.revolutions=0.1")
    assert "of 47 unknowns, 24 of them integrated" in done.out
    result = read_result(tmp_path / "results/model-3-shm.vtkhdf").response
    assert result.stats.unknowns == 24


@pytest.mark.parametrize("start", ["rest", "equilibrium", pytest.param("periodic", marks=pytest.mark.slow)])
def test_pruned_result_equals_unpruned_result(start, tayeb):
    more = [
        SIDEWAYS,
        f"run.start={start}",
        "run.steps_per_revolution=720",
        "run.revolutions=0.5",
        "run.damping.beta=1e-6",
    ]
    pruned, unpruned = (run(read_case(tayeb(3), [*more, f"fidelity.prune={prune}"])) for prune in ("true", "false"))
    assert pruned.outline == unpruned.outline
    assert pruned.stats.unknowns == (37 if start == "rest" else 24)
    for kind in ("displacement", "velocity"):
        pruned_values, unpruned_values = (getattr(response.fields, kind) for response in (pruned, unpruned))
        assert pruned_values.shape == unpruned_values.shape == (len(unpruned.field_time), 47)
        np.testing.assert_allclose(pruned_values, unpruned_values, rtol=0.0, atol=1e-9 * np.abs(unpruned_values).max())
    side = [i for i, name in enumerate(unpruned.outline.unknowns) if name == "cam.uz"]
    assert pruned.fields.displacement[-1, side] != 0.0


@pytest.mark.slow
def test_run_continues_from_pruned_result(flexcam, case, tmp_path):
    """The continued run equals the uninterrupted run: the result also contains the inactive unknowns."""
    short = ("--set", "run.steps_per_revolution=720", "--set", SIDEWAYS, "--set", "run.start=equilibrium")
    for out, revolutions in (("half", 0.25), ("whole", 0.5)):
        report = flexcam("run", case, *short, "--set", f"run.revolutions={revolutions}", "-o", out, "--json").json
        assert report["integrated"] < report["dof"]
    start_option = 'run.start={ result = "half/case.vtkhdf" }'
    report = flexcam(
        "run", case, *short, "--set", start_option, "--set", "run.revolutions=0.25", "-o", "on", "--json"
    ).json
    assert report["integrated"] < report["dof"]
    continued, uninterrupted = (read_result(tmp_path / out / "case.vtkhdf").response.fields for out in ("on", "whole"))
    for kind in ("displacement", "velocity"):
        continued_values, expected = (getattr(fields, kind)[-1] for fields in (continued, uninterrupted))
        np.testing.assert_allclose(continued_values, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_modes_include_inactive_dofs(tayeb):
    pruned, unpruned = (modes(read_case(tayeb(3), [f"fidelity.prune={prune}"])) for prune in ("true", "false"))
    assert pruned.modes.rigid == 1
    np.testing.assert_array_equal(pruned.modes.frequencies, unpruned.modes.frequencies)
