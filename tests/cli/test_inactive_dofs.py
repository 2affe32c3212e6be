"""Inactive degrees of freedom: `check` names them, `run` counts them, and results contain them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flexcam import read_case, read_result
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.run import run

SIDEWAYS = 'loads.side={ at = "cam", direction = "uz", force = "100 N" }'


def words(flexcam, *more):
    found = flexcam("check", *more, "--json").json
    return found["dof"], found["integrated"], found["left_out"]


def test_check_says_what_is_left_out_and_why(flexcam, tayeb):
    dof, integrated, said = words(flexcam, tayeb(3))
    assert (dof, integrated) == (47, 24)
    assert said[:2] == [
        "camshaft: axial motion (ux): nothing holds or loads it",
        "camshaft: bending in x-z (uz, ry): nothing loads it",
    ]
    table = re.sub(r"\s+", " ", flexcam("check", tayeb(3)).out)
    assert "inactive camshaft: axial motion (ux): nothing holds or loads it; camshaft: bending in x-z" in table


def test_a_load_brings_its_unknowns_back(flexcam, tayeb):
    dof, integrated, said = words(flexcam, tayeb(3), "--set", SIDEWAYS)
    assert (dof, integrated) == (47, 37)
    assert not any("x-z" in one for one in said)


def test_a_constant_load_in_balance_moves_nothing(flexcam, tayeb):
    dof, integrated, said = words(flexcam, tayeb(3), "--set", SIDEWAYS, "--set", "run.start=equilibrium")
    assert (dof, integrated) == (47, 24)
    still = "its loads are constant and in static equilibrium, so it does not move"
    assert f"camshaft: bending in x-z (uz, ry): {still}" in said


def test_nothing_is_left_out_where_that_is_not_wanted(flexcam, tayeb):
    assert words(flexcam, tayeb(3), "--set", "fidelity.prune=false") == (47, 47, [])


def test_run_counts_both(flexcam, tayeb, tmp_path):
    done = flexcam("run", tayeb(3), "--set", "run.revolutions=0.1")
    assert "of 47 unknowns, of which 24 are integrated" in done.out
    result = read_result(tmp_path / "results/model-3-shm.vtkhdf").response
    assert result.stats.unknowns == 24


@pytest.mark.parametrize("start", ["rest", "equilibrium", "periodic"])
def test_results_hold_every_unknown_as_if_all_were_integrated(start, tayeb):
    more = [
        SIDEWAYS,
        f"run.start={start}",
        "run.steps_per_revolution=720",
        "run.revolutions=0.5",
        "run.damping.beta=1e-6",
    ]
    pruned, whole = (run(read_case(tayeb(3), [*more, f"fidelity.prune={prune}"])) for prune in ("true", "false"))
    assert pruned.outline == whole.outline
    assert pruned.stats.unknowns == (37 if start == "rest" else 24)
    for kind in ("displacement", "velocity"):
        one, other = (getattr(found.fields, kind) for found in (pruned, whole))
        assert one.shape == other.shape == (len(whole.field_time), 47)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9 * np.abs(other).max())
    side = [i for i, name in enumerate(whole.outline.unknowns) if name == "cam.uz"]
    assert pruned.fields.displacement[-1, side] != 0.0


def test_a_run_goes_on_from_a_pruned_result(flexcam, case, tmp_path):
    """From a result a run goes on as if it had never stopped: the file holds also what was left out."""
    short = ("--set", "run.steps_per_revolution=720", "--set", SIDEWAYS, "--set", "run.start=equilibrium")
    for out, turned in (("half", 0.25), ("whole", 0.5)):
        told = flexcam("run", case, *short, "--set", f"run.revolutions={turned}", "-o", out, "--json").json
        assert told["integrated"] < told["dof"]
    onward = 'run.start={ result = "half/case.vtkhdf" }'
    told = flexcam("run", case, *short, "--set", onward, "--set", "run.revolutions=0.25", "-o", "on", "--json").json
    assert told["integrated"] < told["dof"]
    on, whole = (read_result(tmp_path / out / "case.vtkhdf").response.fields for out in ("on", "whole"))
    for kind in ("displacement", "velocity"):
        one, other = (getattr(found, kind)[-1] for found in (on, whole))
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9 * np.abs(other).max())


def test_modes_are_those_of_the_whole_structure(tayeb):
    pruned, whole = (modes(read_case(tayeb(3), [f"fidelity.prune={prune}"])) for prune in ("true", "false"))
    assert pruned.modes.rigid == 1
    np.testing.assert_array_equal(pruned.modes.frequencies, whole.modes.frequencies)
