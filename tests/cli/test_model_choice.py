"""Model cost and error: trade, models chosen by a tolerance, reduced models and estimated errors."""

from __future__ import annotations

import csv
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, read_result, run
from flexcam.analysis.histories import Histories
from flexcam.analysis.model_choice import ModelEvaluation, Reference
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.report.fidelity_tables import trade_table
from flexcam.report.terminal import result_console
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
FEW = ("run.revolutions=1", "run.steps_per_revolution=360")
TRADE = import_module("flexcam.analysis.model_choice")  # its function has the same name
FEW_SET = [word for override in FEW for word in ("--set", override)]
QUICKER = ("--set", "run.steps_per_revolution=120")


TRADE_REPORT: dict[str, object] = {}
"""JSON output of `trade`, computed once."""


@pytest.fixture
def run_trade(flexcam, tayeb):
    return lambda *words: flexcam("trade", tayeb(1), *FEW_SET, "--repeats", 1, *words)


@pytest.fixture
def ladder(run_trade):
    """Return the JSON output of `trade`, which is computed once."""
    if not TRADE_REPORT:
        TRADE_REPORT.update(run_trade("--json").json)
    return TRADE_REPORT


@pytest.fixture
def run_case(flexcam, tayeb):
    """Return a function that runs the published case in few steps with the given fidelity keys."""

    def run(*keys, words=(), json=True):
        overrides = [word for key in keys for word in ("--set", f"fidelity.{key}")]
        return flexcam("run", tayeb(1), *FEW_SET, *overrides, *words, "--overwrite", *(["--json"] if json else []))

    return run


@pytest.fixture(scope="module")
def fine_valve(tayeb):
    """Return the valve of a separate run: eight elements per segment and eight times the steps of FEW."""
    finer = ["members.pushrod.elements=8", "members.camshaft.elements=8", "run.steps_per_revolution=2880"]
    return run(read_case(tayeb(1), [FEW[0], *finer]))["valve"]


@pytest.mark.slow
def test_trade_table_and_files(run_trade):
    done = run_trade(*QUICKER, "--csv", "trade.csv", "--plot", "trade.svg")
    assert done.code == 0
    assert "own error" in done.out
    expected = "* Pareto-optimal: no model with less work has a smaller error (the largest of its error columns)"
    assert expected in " ".join(done.out.split())
    with open("trade.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["model"] for row in rows} == {"rigid", "sdof", "modes 3", "modes 10", "beams", "beams x2"}
    assert {row["steps_per_revolution"] for row in rows} == {"60", "120"}
    assert all(int(row["work"]) == int(row["unknowns"]) * int(row["steps_per_revolution"]) for row in rows)
    with open("trade.svg", encoding="utf-8") as file:
        assert "</svg>" in file.read()


def test_wide_trade_table_truncates_no_number(monkeypatch, capsys):
    """Eight cams have eleven columns of errors: 160 columns wrap headers and words, but no number."""
    monkeypatch.setenv("COLUMNS", "160")
    names = [
        "lift",
        "velocity",
        "acceleration",
        *(f"force {kind}-{n}" for n in range(1, 5) for kind in ("in", "exhaust")),
    ]
    errors = {name: 0.012 * 10.0**i for i, name in enumerate(names)}
    evaluation = ModelEvaluation("beams x2", "", 1440, 10444, 345_600_000, 0.0123, errors, Status())
    reference = Reference(Histories(np.zeros(1), {}, {}, "uy"), errors, dict.fromkeys(errors, 1.0), 1440)
    result_console().print(trade_table(reference, [evaluation]))
    shown = capsys.readouterr().out
    row = next(line for line in shown.splitlines() if "beams x2" in line).split()
    percent = [f"{float(f'{100.0 * x:.2g}'):g}" for x in errors.values()]
    assert row == ["beams", "x2", "1440", "10444", "3.46e+08", "0.0123", *percent]


@pytest.mark.slow
def test_inaccurate_reference_causes_warning(flexcam, ladder):
    """60 Newmark steps do not resolve a contact of 4 MN/m; 120 steps resolve the published load."""
    case, few = ROOT / "cases/li/valve-train.toml", ("--set", "run.steps_per_revolution=60", "--repeats", 1)
    done = flexcam("trade", case, *few, "--set", "run.integrator.method=newmark", "--json").json
    large_errors = {name: error for name, error in done["reference"]["errors"].items() if error > 0.05}
    assert large_errors
    assert "acceleration" in large_errors
    (warning,) = done["warnings"]
    assert all(f"{name} ({float(format(100.0 * error, '.2g')):g} %)" in warning for name, error in large_errors.items())
    assert "the reference itself has a large error in" in warning
    assert ladder["warnings"] == []


@pytest.mark.slow
def test_failed_reference_is_reported(run_trade, monkeypatch):
    """Its elements and steps differ from those of the case, whose own run need not fail."""

    def fail_to_converge(*asked):
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, "the forces do not settle"))

    monkeypatch.setattr(TRADE, "run_histories", fail_to_converge)
    done = run_trade(*QUICKER)
    assert done.code == 3
    assert "the reference, of 3 times the elements and 4 times the steps: the forces do not settle" in done.err


@pytest.mark.slow
def test_trade_skips_models_above_stability_limit(run_trade):
    """The steps of the case are short enough; longer steps, or twice the elements, exceed the limit."""
    explicit = ("--set", "run.integrator.method=central-difference", "--set", "run.steps_per_revolution=4000")
    done = run_trade(*explicit, "--json")
    assert done.code == 0
    rungs = {(rung["model"], rung["steps_per_revolution"]): rung for rung in done.json["rungs"]}
    refused = {key for key, rung in rungs.items() if rung["status"] == "refused"}
    assert {("beams", 2000), ("beams x2", 4000)} <= refused
    assert all(not rungs[key]["errors"] and not rungs[key]["best"] for key in refused)
    # Second order: 4000 steps have an error of about 1e-6 of the lift against the reference with finer elements.
    assert rungs["beams", 4000]["errors"]["lift"] < 1e-5
    (warning,) = done.json["warnings"]
    assert "beams x2 at 500, 1000, 2000, 4000. The first: run.step" in warning
    assert "with central-difference" in warning
    # For a conditionally stable method, the reference uses average acceleration.
    reference = run_trade("--set", "run.steps_per_revolution=4000", "--json").json
    assert done.json["reference"] == reference["reference"]


@pytest.mark.slow
def test_other_refusal_ends_trade(run_trade, monkeypatch):
    """Only the refusal of a time step is a row of the table."""
    refusal = refuse("memory", "9 TB", "8 GB")

    def refuse_preparation(*asked, **more):
        raise refusal

    monkeypatch.setattr(TRADE, "prepare", refuse_preparation)
    monkeypatch.setattr(TRADE, "reference_run", lambda *asked, **more: None)
    done = run_trade()
    assert done.code == 2
    assert "memory: got 9 TB" in done.err


def test_trade_json_contains_model_ladder(ladder):
    rungs = ladder["rungs"]
    work = [rung["work"] for rung in rungs]
    assert work == sorted(work)
    worst = [max(rung["errors"].values()) for rung in rungs]
    # A rung is marked exactly if its error is smaller than those of all rungs before it.
    assert [rung["best"] for rung in rungs] == [
        all(error < earlier for earlier in worst[:i]) for i, error in enumerate(worst)
    ]
    assert worst[work.index(0)] > 0.1  # this train deflects by about 17 % of its lift
    assert ladder["reference"]["steps_per_revolution"] == 1440
    # Twice the elements and the steps of the case: between the error of the reference and 1e-4.
    reference_error, finest = ladder["reference"]["errors"]["lift"], rungs[-1]["errors"]["lift"]
    assert 0.0 < reference_error < finest < 1e-4


@pytest.mark.slow
def test_trade_with_other_number_of_elements(run_trade, ladder):
    """Seven elements of the pushrod have six internal nodes, each with one active axial unknown."""
    finer = run_trade("--set", "members.pushrod.elements=7", "--json").json
    default, refined = ({rung["model"]: rung for rung in report["rungs"]} for report in (ladder, finer))
    assert refined["beams"]["unknowns"] == default["beams"]["unknowns"] + 6
    assert refined["beams"]["errors"]["acceleration"] != default["beams"]["errors"]["acceleration"]
    assert refined["rigid"]["unknowns"] == 0


def test_reference_has_beams_for_case_with_rigid_model(run_trade):
    """The reference has flexible members even if the case specifies rigid members."""
    rungs = {
        rung["model"]: rung for rung in run_trade("--set", 'fidelity.model="rigid"', *QUICKER, "--json").json["rungs"]
    }
    assert rungs["rigid"]["errors"]["lift"] > 0.1
    assert rungs["beams"]["errors"]["lift"] < 1e-3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--repeats", 0), "--repeats"), (("--probe", "nosuch"), "nosuch"), (("--probe", "cam"), "several components"),
        (("--csv", "there.csv"), "--overwrite"), (("--plot", "there.svg"), "--overwrite"),
    ],
)  # fmt: skip
def test_trade_refuses_invalid_options(flexcam, tayeb, tmp_path, words, message):
    for name in ("there.csv", "there.svg"):
        (tmp_path / name).write_text("mine", encoding="utf-8")
    quick = ("--set", "run.steps_per_revolution=90", "--set", "run.revolutions=0.2")
    done = flexcam("trade", tayeb(1), *quick, *words)
    assert done.code == 2
    assert message in done.err
    assert (tmp_path / "there.csv").read_text(encoding="utf-8") == "mine"
    if words[0] == "--csv":
        assert flexcam("trade", tayeb(1), *quick, *words, "--overwrite").code == 0
        assert (tmp_path / words[1]).read_text(encoding="utf-8") != "mine"


@pytest.mark.parametrize(("asked", "tolerance"), mostly_slow([("20 %", 0.2), ("1 %", 0.01)], 2))
def test_tolerance_selects_cheapest_model(run_case, ladder, fine_valve, asked, tolerance):
    done = run_case(f'tolerance="{asked}"')
    assert done.code == 0
    choice = done.json["choice"]
    assert choice["met"]
    valve = read_result(done.json["result"]).response["valve"].displacement
    stride = (len(fine_valve.displacement) - 1) // (len(valve) - 1)
    reference = fine_valve.displacement[::stride]
    assert np.sqrt(np.mean((valve - reference) ** 2)) <= tolerance * np.ptp(reference)
    # By the table of `flexcam trade`, no rung of less work is within the tolerance.
    reference_error = ladder["reference"]["errors"]["lift"]
    within = [rung for rung in ladder["rungs"] if rung["errors"]["lift"] + reference_error <= tolerance]
    assert choice["model"]["work"] == min(rung["work"] for rung in within)
    assert choice["tried"] < len(ladder["rungs"])
    assert (choice["cheaper"] is None) == (
        asked == "20 %"
    )  # the rigid train with the fewest steps is the cheapest model


@pytest.mark.slow
def test_tolerance_with_requested_engine(run_case):
    """The reference and the rigid train use their own engine."""
    done = run_case('tolerance="1 %"', words=("--set", "run.engine=modal"))
    assert done.code == 0
    assert done.json["choice"]["model"]["model"] == "sdof"


@pytest.mark.slow
@pytest.mark.parametrize("asked", ["0", "1e-14"])
def test_unreachable_tolerance_has_exit_code_3(run_case, asked):
    done = run_case(f"tolerance={asked}")
    assert done.code == 3
    choice = done.json["choice"]
    assert not choice["met"]
    assert choice["model"]["model"] in ("beams", "beams x2", "modes 10", "modes 3")  # equal up to rounding
    assert re.search(r"closest of 18 models is off by lift 0\.00\d+ % \(the reference 0\.00\d+ %\)", choice["why"])
    assert "tolerance is not met" in done.err
    assert len(read_result(done.json["result"]).response.time) > 1  # the result is saved
    if asked == "0":
        few = ("--set", "run.steps_per_revolution=60")
        assert "The tolerance is not met" in run_case(f"tolerance={asked}", words=few, json=False).out


def test_static_case_has_error_of_deflection(flexcam):
    """The tip of the cantilever is at F L^3/(3 E I) at all times; the rigid tip is at its initial position."""
    case = ROOT / "cases/checks/cantilever.toml"
    done = flexcam("run", case, "--set", 'fidelity.tolerance="1 %"', "--json")
    assert done.code == 0
    assert done.json["choice"]["model"]["model"] != "rigid"
    assert done.json["choice"]["cheaper"]["errors"] == {"lift": pytest.approx(1.0, rel=1e-9)}
    tip = read_result(done.json["result"]).response["tip.ux"].displacement
    assert tip[-1] == pytest.approx(100.0 * 0.5**3 / (3.0 * 207e9 * 0.02 * 0.01**3 / 12.0), rel=1e-6)


def test_tolerance_of_missing_quantity_is_refused(flexcam):
    done = flexcam(
        "run", ROOT / "cases/checks/cantilever.toml", "--set", 'fidelity.tolerance={ lift = 1, force = "1 %" }'
    )
    assert done.code == 2
    assert "fidelity.tolerance (" in done.err
    assert "got force, expected lift, velocity, acceleration" in done.err


@pytest.mark.parametrize(
    ("case", "count"),
    [("checks/cantilever", 0), pytest.param("camshaft-4cyl/camshaft", 8, marks=pytest.mark.slow)],
)
def test_lumped_model_requires_one_cam_contact(flexcam, case, count):
    done = flexcam("check", ROOT / f"cases/{case}.toml", "--set", "fidelity.model=sdof")
    assert done.code == 2
    assert f"got {count} contacts of a cam, expected one. The few masses represent the train" in done.err


@pytest.mark.slow
def test_tolerances_of_several_quantities(run_case):
    """Only the listed quantities are checked, all of them; the force of the rigid train has an error of 12 %."""
    loose = run_case('tolerance={ force = "20 %" }').json["choice"]
    strict = run_case('tolerance={ force = "20 %", acceleration = "0.1 %" }').json["choice"]
    assert loose["model"]["model"] == "rigid"
    assert strict["model"]["work"] > loose["model"]["work"]
    assert strict["model"]["errors"]["acceleration"] < 1e-3


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("tolerance=-1", "zero or more"), ('tolerance="1 mm"', "mm"), ("tolerance={}", "tolerance"),
        ("tolerance={ speed = 1 }", "lift, velocity, acceleration, force"), ("tolerance=true", "number"),
        ("tolerance=[1]", "number"), ("estimate=1", "true or false"), ('model="none"', "beams"), ("masses=0", "1"),
        ("tolerance=nan", "finite"),
    ],
)  # fmt: skip
def test_invalid_fidelity_values_are_refused(run_case, key, message):
    done = run_case(key, json=False)
    assert done.code == 2
    assert f"fidelity.{key.partition('=')[0]}" in done.err
    assert message in done.err


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ('tolerance={ lift = "1 %", lfit = "2 %" }', "Remove it."),
        ("tolerance={ lift = -1 }", "fidelity.tolerance.lift ("), ('model="SDOF"', "Did you mean 'sdof'?"),
    ],
)  # fmt: skip
def test_wrong_fidelity_key_gives_single_error(run_case, key, message):
    done = run_case(key, json=False)
    assert done.code == 2
    assert len(done.err.strip().splitlines()) == 1
    assert message in done.err


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (["masses=2"], "it counts the masses of a chain, and the model is beams"),
        (["masses=2", 'model="sdof"'], "it counts the masses of a chain, and the model is sdof"),
        (["modes=3", 'tolerance="1 %"'], "fidelity.tolerance chooses the model"),
        (["tolerance=1"], "1 is unusual (usually up to 0.99): did you mean 1 %?"),
        (['tolerance={ force = 5, velocity = "5 %" }'], "5 is unusual (usually up to 0.99): did you mean 5 %?"),
        (["masses=2", "model=chain"], ""), (['tolerance="99 %"'], ""), (["modes=3"], ""),
    ],
)  # fmt: skip
def test_check_warns_of_ineffective_fidelity_keys(flexcam, tayeb, keys, message):
    overrides = [word for key in keys for word in ("--set", f"fidelity.{key}")]
    done = flexcam("check", tayeb(1), *overrides)
    assert done.code == 0
    output = " ".join((done.out + done.err).split())
    assert message in output
    assert ("Warning: fidelity" in output) == bool(message)


def test_fidelity_errors_name_line_of_case(flexcam, case):
    text = case.read_text(encoding="utf-8")
    line = len(text.splitlines()) + 2
    case.write_text(text + '[fidelity]\ntolerance = "1 mm"\n', encoding="utf-8")
    done = flexcam("run", case)
    assert done.code == 2
    assert f"line {line}" in done.err or f":{line}" in done.err
    case.write_text(text + '[fidelity]\nmodel = "rigid"\ntolerance = "1 %"\n', encoding="utf-8")
    assert "either model or tolerance" in flexcam("run", case).err
    case.write_text(text + '[fidelity]\nmodel = "chain"\nmasses = 3\n', encoding="utf-8")  # the train has two nodes
    stderr = flexcam("run", case).err
    assert "fidelity.masses" in stderr
    assert f"{line + 1}" in stderr


@pytest.mark.parametrize("model", mostly_slow(["beams", "rigid", "sdof", "chain", "modes"], 5))
def test_result_of_every_model(run_case, tayeb, model):
    keys = ("modes=3",) if model == "modes" else (f'model="{model}"', "masses=2")
    done = run_case(*keys)
    assert done.code == 0
    assert done.json["integrated"] == {"rigid": 0, "sdof": 1, "chain": 2, "modes": 7, "beams": 10}[model]
    result = read_result(done.json["result"])
    direct = run(read_case(tayeb(1), [*FEW, *(f"fidelity.{key}" for key in keys)]))["valve"]
    # The file contains the values of the run in double precision.
    np.testing.assert_allclose(result.response["valve"].displacement, direct.displacement, rtol=0.0, atol=1e-15)
    displacement = result.field("displacement")
    assert displacement.shape[1:] == (6, 3)
    assert np.isfinite(displacement).all()
    assert np.ptp(displacement[:, result.mesh.node("tappet"), 1]) > 5e-3  # the lift is 6 mm


def test_rigid_train_follows_lift(run_case, tayeb):
    done = run_case('model="rigid"')
    result = read_result(done.json["result"])
    time = result.response.time[::20]  # field_every = 20
    lift = 3e-3 * (1.0 - np.cos(100.0 * np.pi * time))  # 6 mm, shm over 180 deg, 3000 rpm
    slope = 3e-3 * 100.0 * np.pi * np.sin(100.0 * np.pi * time)
    for point in ("tappet", "pushrod-top"):
        node = result.mesh.node(point)
        # The remaining error is the rounding of the cam angle.
        np.testing.assert_allclose(result.field("displacement")[:, node, 1], lift, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(result.field("velocity")[:, node, 1], slope, rtol=0.0, atol=1e-10)
    valve = result.response["valve"].displacement
    np.testing.assert_allclose(valve[::20], 1.6 * lift, rtol=0.0, atol=1e-12)  # arms of 25 and 40 mm
    assert not result.field("displacement")[:, result.mesh.node("cam")].any()
    assert "rigid model has no member forces" in " ".join(done.json["warnings"])
    direct = run(read_case(tayeb(1), FEW), rigid=True)["valve"].displacement
    np.testing.assert_allclose(direct, valve, rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_sdof_result_has_fields_of_beam_result(run_case):
    """The same nodes, fields and probes, with close values: the train moves nearly as a rigid body (0.13 % rms)."""
    sdof, beams = (read_result(run_case(f'model="{model}"').json["result"]) for model in ("sdof", "beams"))
    assert sdof.field_names == beams.field_names
    assert set(sdof.recovered) == set(beams.recovered)
    for point in ("tappet", "pushrod-top"):
        approximate, exact = (result.field("displacement")[:, result.mesh.node(point), 1] for result in (sdof, beams))
        assert np.abs(approximate - exact).max() < 0.01 * np.ptp(exact)


@pytest.mark.slow
def test_error_estimates_are_printed(run_case):
    done = run_case("estimate=true", json=False)
    assert done.code == 0
    assert re.search(r"lift\s+24\.80\d+ ± 0\.00\d+ mm", done.out)
    errors = {error["quantity"]: error for error in run_case("estimate=true").json["errors"]}
    assert set(errors) == {"lift", "velocity", "acceleration", "force intake"}
    assert errors["lift"]["holds"]
    assert run_case().json["errors"] == []
    assert "±" not in run_case(json=False).out


@pytest.mark.slow
def test_error_estimate_includes_model_error(run_case, fine_valve):
    for model, tolerance in (("rigid", 0.01), ("sdof", 0.05)):
        done = run_case(f'model="{model}"', "estimate=true").json
        error = next(estimate for estimate in done["errors"] if estimate["quantity"] == "lift")
        valve = read_result(done["result"]).response["valve"].displacement
        # The lift is a range with errors at both ends.
        # The error of steps and elements adds about 1e-6 m to the model errors of 4 mm and 42 um.
        true_errors = (
            np.abs(valve - fine_valve.displacement[::8]).max(),
            abs(np.ptp(valve) - np.ptp(fine_valve.displacement)),
        )
        assert error["model"] == pytest.approx(max(true_errors), rel=tolerance)


def test_run_without_error_estimate_is_complete(flexcam, tayeb):
    """Twice the elements need shorter steps than the given ones; the run itself is complete and valid."""
    keys = ['run.integrator={ method = "central-difference" }', "run.steps_per_revolution=4000", "run.revolutions=0.05"]
    overrides = [word for key in (*keys, "fidelity.estimate=true") for word in ("--set", key)]
    done = flexcam("run", tayeb(1), *overrides, "--json")
    assert done.code == 0
    assert done.json["errors"] == []
    warning = next(message for message in done.json["warnings"] if "no errors are estimated" in message)
    assert "is refused: run.step" in warning
    assert "central-difference" in warning
    assert len(read_result(done.json["result"]).response.time) == 201


@pytest.mark.slow
def test_tolerance_with_error_estimate(run_case):
    done = run_case('tolerance="10 %"', "estimate=true").json
    assert done["choice"]["met"]
    assert {error["quantity"] for error in done["errors"]} >= {"lift"}
