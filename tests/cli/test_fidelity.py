"""What a cheaper model costs in error: trade, a tolerance that chooses the model, other models, estimated errors."""

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
FEW_SET = [word for one in FEW for word in ("--set", one)]
QUICKER = ("--set", "run.steps_per_revolution=120")


TOLD: dict[str, object] = {}
"""What `model_ladder` was told."""


@pytest.fixture
def trade(flexcam, tayeb):
    return lambda *words: flexcam("trade", tayeb(1), *FEW_SET, "--repeats", 1, *words)


@pytest.fixture
def ladder(trade):
    """Return what `trade` tells in JSON, asked once."""
    if not TOLD:
        TOLD.update(trade("--json").json)
    return TOLD


@pytest.fixture
def ran(flexcam, tayeb):
    """Run the published case of few steps with keys of its fidelity."""

    def run_it(*keys, words=(), json=True):
        laid = [word for key in keys for word in ("--set", f"fidelity.{key}")]
        return flexcam("run", tayeb(1), *FEW_SET, *laid, *words, "--overwrite", *(["--json"] if json else []))

    return run_it


@pytest.fixture(scope="module")
def fine(tayeb):
    """Return the valve of an independent run: eight elements per segment and eight times the steps of FEW."""
    finer = ["members.pushrod.elements=8", "members.camshaft.elements=8", "run.steps_per_revolution=2880"]
    return run(read_case(tayeb(1), [FEW[0], *finer]))["valve"]


def test_table_and_files(trade):
    done = trade(*QUICKER, "--csv", "trade.csv", "--plot", "trade.svg")
    assert done.code == 0
    assert "its own error" in done.out
    expected = "* Pareto-optimal: no model with less work has a smaller maximum error over the columns"
    assert expected in " ".join(done.out.split())
    with open("trade.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["model"] for row in rows} == {"rigid", "sdof", "modes 3", "modes 10", "beams", "beams x2"}
    assert {row["steps_per_revolution"] for row in rows} == {"60", "120"}
    assert all(int(row["work"]) == int(row["unknowns"]) * int(row["steps_per_revolution"]) for row in rows)
    with open("trade.svg", encoding="utf-8") as file:
        assert "</svg>" in file.read()


def test_numbers_of_many_contacts_are_whole(monkeypatch, capsys):
    """Eight cams have eleven columns of errors: on 160 columns heads and words are broken, but no number."""
    monkeypatch.setenv("COLUMNS", "160")
    names = [
        "lift",
        "velocity",
        "acceleration",
        *(f"force {kind}-{n}" for n in range(1, 5) for kind in ("in", "exhaust")),
    ]
    errors = {name: 0.012 * 10.0**i for i, name in enumerate(names)}
    found = ModelEvaluation("beams x2", "", 1440, 10444, 345_600_000, 0.0123, errors, Status())
    against = Reference(Histories(np.zeros(1), {}), errors, dict.fromkeys(errors, 1.0), 1440)
    result_console().print(trade_table(against, [found]))
    shown = capsys.readouterr().out
    row = next(line for line in shown.splitlines() if "beams x2" in line).split()
    percent = [f"{float(f'{100.0 * x:.2g}'):g}" for x in errors.values()]
    assert row == ["beams", "x2", "1440", "10444", "3.46e+08", "0.0123", *percent]


@pytest.mark.slow
def test_a_rough_reference_is_told(flexcam, ladder):
    """Sixty of Newmark's steps see nothing of how a contact of 4 MN/m rings; 120 of the published load see it all."""
    case, few = ROOT / "cases/li/valve-train.toml", ("--set", "run.steps_per_revolution=60", "--repeats", 1)
    done = flexcam("trade", case, *few, "--set", "run.integrator.method=newmark", "--json").json
    own = {name: error for name, error in done["reference"]["errors"].items() if error > 0.05}
    assert own
    assert "acceleration" in own
    (told,) = done["warnings"]
    assert all(f"{name} ({float(format(100.0 * error, '.2g')):g} %)" in told for name, error in own.items())
    assert "the reference itself has a large error in" in told
    assert ladder["warnings"] == []


def test_a_reference_that_fails_is_named(trade, monkeypatch):
    """Its elements and steps are other than those of the case, whose own run need not fail."""

    def failing(*asked):
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, "the forces do not settle"))

    monkeypatch.setattr(TRADE, "run_histories", failing)
    done = trade(*QUICKER)
    assert done.code == 3
    assert "the reference, of 3 times the elements and 4 times the steps: the forces do not settle" in done.err


@pytest.mark.slow
def test_steps_that_a_method_cannot_take_are_no_reason_to_refuse_the_others(trade):
    """The case's own steps are short enough; fewer, or those of twice the elements, are not."""
    explicit = ("--set", "run.integrator.method=central-difference", "--set", "run.steps_per_revolution=4000")
    done = trade(*explicit, "--json")
    assert done.code == 0
    rungs = {(one["model"], one["steps_per_revolution"]): one for one in done.json["rungs"]}
    refused = {key for key, one in rungs.items() if one["status"] == "refused"}
    assert {("beams", 2000), ("beams x2", 4000)} <= refused
    assert all(not rungs[key]["errors"] and not rungs[key]["best"] for key in refused)
    # Second order in the steps: 4000 of them leave some 1e-6 of the lift against the reference of finer elements.
    assert rungs["beams", 4000]["errors"]["lift"] < 1e-5
    (told,) = done.json["warnings"]
    assert "beams x2 at 500, 1000, 2000, 4000. The first: run.step" in told
    assert "with central-difference" in told
    # Where the method is bound by the step, the reference is that of average acceleration.
    plain = trade("--set", "run.steps_per_revolution=4000", "--json").json
    assert done.json["reference"] == plain["reference"]


@pytest.mark.slow
def test_another_refusal_of_a_model_ends_the_ladder(trade, monkeypatch):
    """Only what a method says of its steps is told in a row."""
    refusal = refuse("memory", "9 TB", "8 GB")

    def prepared(*asked, **more):
        raise refusal

    monkeypatch.setattr(TRADE, "prepare", prepared)
    monkeypatch.setattr(TRADE, "reference_run", lambda *asked, **more: None)
    done = trade()
    assert done.code == 2
    assert "memory: got 9 TB" in done.err


def test_json_holds_the_ladder(ladder):
    rungs = ladder["rungs"]
    work = [one["work"] for one in rungs]
    assert work == sorted(work)
    worst = [max(one["errors"].values()) for one in rungs]
    # A rung is marked exactly where it is closer than all before it.
    assert [one["best"] for one in rungs] == [all(error < w for w in worst[:i]) for i, error in enumerate(worst)]
    assert worst[work.index(0)] > 0.1  # this train deflects by some 17 % of its lift
    assert ladder["reference"]["steps_per_revolution"] == 1440
    # Twice the elements and the steps of the case: within twice what it says of itself and of the reference.
    own, finest = ladder["reference"]["errors"]["lift"], rungs[-1]["errors"]["lift"]
    assert 0.0 < own < finest < 1e-4


@pytest.mark.slow
def test_other_elements_have_other_numbers(trade, ladder):
    """Seven elements in the pushrod have six nodes inside, of which what is along it moves."""
    finer = trade("--set", "members.pushrod.elements=7", "--json").json
    one, other = ({r["model"]: r for r in told["rungs"]} for told in (ladder, finer))
    assert other["beams"]["unknowns"] == one["beams"]["unknowns"] + 6
    assert other["beams"]["errors"]["acceleration"] != one["beams"]["errors"]["acceleration"]
    assert other["rigid"]["unknowns"] == 0


def test_a_case_of_another_model_is_traded_against_beams(trade):
    """The reference has flexible members even where the case itself asks for rigid ones."""
    rungs = {one["model"]: one for one in trade("--set", 'fidelity.model="rigid"', *QUICKER, "--json").json["rungs"]}
    assert rungs["rigid"]["errors"]["lift"] > 0.1
    assert rungs["beams"]["errors"]["lift"] < 1e-3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--repeats", 0), "--repeats"), (("--probe", "nosuch"), "nosuch"), (("--probe", "cam"), "one scalar"),
        (("--csv", "there.csv"), "--overwrite"), (("--plot", "there.svg"), "--overwrite"),
    ],
)  # fmt: skip
def test_trade_refuses(flexcam, tayeb, tmp_path, words, said):
    for name in ("there.csv", "there.svg"):
        (tmp_path / name).write_text("mine", encoding="utf-8")
    quick = ("--set", "run.steps_per_revolution=90", "--set", "run.revolutions=0.2")
    done = flexcam("trade", tayeb(1), *quick, *words)
    assert done.code == 2
    assert said in done.err
    assert (tmp_path / "there.csv").read_text(encoding="utf-8") == "mine"
    if words[0] == "--csv":
        assert flexcam("trade", tayeb(1), *quick, *words, "--overwrite").code == 0
        assert (tmp_path / words[1]).read_text(encoding="utf-8") != "mine"


@pytest.mark.parametrize(("asked", "tolerance"), mostly_slow([("20 %", 0.2), ("1 %", 0.01)], 2))
def test_the_cheapest_within_a_tolerance(ran, ladder, fine, asked, tolerance):
    done = ran(f'tolerance="{asked}"')
    assert done.code == 0
    choice = done.json["choice"]
    assert choice["met"]
    valve = read_result(done.json["result"]).response["valve"].displacement
    every = (len(fine.displacement) - 1) // (len(valve) - 1)
    best = fine.displacement[::every]
    assert np.sqrt(np.mean((valve - best) ** 2)) <= tolerance * np.ptp(best)
    # No rung of less work is within it, by the table of `flexcam trade`.
    own = ladder["reference"]["errors"]["lift"]
    within = [one for one in ladder["rungs"] if one["errors"]["lift"] + own <= tolerance]
    assert choice["model"]["work"] == min(one["work"] for one in within)
    assert choice["tried"] < len(ladder["rungs"])
    assert (choice["cheaper"] is None) == (asked == "20 %")  # nothing is cheaper than the rigid train at fewest steps


@pytest.mark.slow
def test_a_tolerance_on_a_way_that_is_asked_for(ran):
    """The reference and the rigid train go their own way."""
    done = ran('tolerance="1 %"', words=("--set", "run.engine=modal"))
    assert done.code == 0
    assert done.json["choice"]["model"]["model"] == "sdof"


@pytest.mark.slow
@pytest.mark.parametrize("asked", ["0", "1e-14"])
def test_a_tolerance_that_nothing_meets(ran, asked):
    done = ran(f"tolerance={asked}")
    assert done.code == 3
    choice = done.json["choice"]
    assert not choice["met"]
    assert choice["model"]["model"] in ("beams", "beams x2", "modes 10", "modes 3")  # the same but for rounding
    assert re.search(r"closest of 18 models is off by lift 0\.00\d+ % \(the reference 0\.00\d+ %\)", choice["why"])
    assert "tolerance is not met" in done.err
    assert len(read_result(done.json["result"]).response.time) > 1  # the result is kept
    if asked == "0":
        few = ("--set", "run.steps_per_revolution=60")
        assert "The tolerance is not met" in ran(f"tolerance={asked}", words=few, json=False).out


def test_a_case_at_rest_errs_by_where_it_stands(flexcam):
    """The tip of a cantilever stands at F L^3/(3 E I) for ever; rigid, it stands where it was drawn."""
    case = ROOT / "cases/checks/cantilever.toml"
    done = flexcam("run", case, "--set", 'fidelity.tolerance="1 %"', "--json")
    assert done.code == 0
    assert done.json["choice"]["model"]["model"] != "rigid"
    assert done.json["choice"]["cheaper"]["errors"] == {"lift": pytest.approx(1.0, rel=1e-9)}
    tip = read_result(done.json["result"]).response["tip.ux"].displacement
    assert tip[-1] == pytest.approx(100.0 * 0.5**3 / (3.0 * 207e9 * 0.02 * 0.01**3 / 12.0), rel=1e-6)


def test_a_quantity_that_a_case_does_not_have(flexcam):
    done = flexcam(
        "run", ROOT / "cases/checks/cantilever.toml", "--set", 'fidelity.tolerance={ lift = 1, force = "1 %" }'
    )
    assert done.code == 2
    assert "fidelity.tolerance (" in done.err
    assert "got force, expected lift, velocity, acceleration" in done.err


@pytest.mark.parametrize(("case", "count"), [("checks/cantilever", 0), ("camshaft-4cyl/camshaft", 8)])
def test_few_masses_are_those_of_one_train(flexcam, case, count):
    done = flexcam("check", ROOT / f"cases/{case}.toml", "--set", "fidelity.model=sdof")
    assert done.code == 2
    assert f"got {count} contacts of a cam, expected one. The few masses represent the train" in done.err


@pytest.mark.slow
def test_a_table_of_tolerances(ran):
    """Only what is named counts, and the strictest of it; the rigid train misses the force by 12 %."""
    loose = ran('tolerance={ force = "20 %" }').json["choice"]
    strict = ran('tolerance={ force = "20 %", acceleration = "0.1 %" }').json["choice"]
    assert loose["model"]["model"] == "rigid"
    assert strict["model"]["work"] > loose["model"]["work"]
    assert strict["model"]["errors"]["acceleration"] < 1e-3


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("tolerance=-1", "zero or more"), ('tolerance="1 mm"', "mm"), ("tolerance={}", "tolerance"),
        ("tolerance={ speed = 1 }", "lift, velocity, acceleration, force"), ("tolerance=true", "number"),
        ("tolerance=[1]", "number"), ("estimate=1", "true or false"), ('model="none"', "beams"), ("masses=0", "1"),
        ("tolerance=nan", "finite"),
    ],
)  # fmt: skip
def test_wrong_forms_are_refused(ran, key, said):
    done = ran(key, json=False)
    assert done.code == 2
    assert f"fidelity.{key.partition('=')[0]}" in done.err
    assert said in done.err


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ('tolerance={ lift = "1 %", lfit = "2 %" }', "Did you mean 'lift'?"),
        ("tolerance={ lift = -1 }", "fidelity.tolerance.lift ("), ('model="SDOF"', "Did you mean 'sdof'?"),
    ],
)  # fmt: skip
def test_one_wrong_key_is_one_fault(ran, key, said):
    done = ran(key, json=False)
    assert done.code == 2
    assert len(done.err.strip().splitlines()) == 1
    assert said in done.err


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (["masses=2"], "it counts the masses of a chain, and the model is beams"),
        (["masses=2", 'model="sdof"'], "it counts the masses of a chain, and the model is sdof"),
        (["modes=3", 'tolerance="1 %"'], "fidelity.tolerance chooses the model"),
        (["tolerance=1"], "1 is unusual (usually up to 0.99): did you mean 1 %?"),
        (['tolerance={ force = 5, velocity = "5 %" }'], "5 is unusual (usually up to 0.99): did you mean 5 %?"),
        (["masses=2", "model=chain"], ""), (['tolerance="99 %"'], ""), (["modes=3"], ""),
    ],
)  # fmt: skip
def test_what_asks_for_nothing_is_told(flexcam, tayeb, keys, said):
    laid = [word for key in keys for word in ("--set", f"fidelity.{key}")]
    done = flexcam("check", tayeb(1), *laid)
    assert done.code == 0
    output = " ".join((done.out + done.err).split())
    assert said in output
    assert ("Warning: fidelity" in output) == bool(said)


def test_wrong_lines_are_named(flexcam, case):
    text = case.read_text(encoding="utf-8")
    line = len(text.splitlines()) + 2
    case.write_text(text + '[fidelity]\ntolerance = "1 mm"\n', encoding="utf-8")
    done = flexcam("run", case)
    assert done.code == 2
    assert f"line {line}" in done.err or f":{line}" in done.err
    case.write_text(text + '[fidelity]\nmodel = "rigid"\ntolerance = "1 %"\n', encoding="utf-8")
    assert "either model or tolerance" in flexcam("run", case).err
    case.write_text(text + '[fidelity]\nmodel = "chain"\nmasses = 3\n', encoding="utf-8")  # its train has two nodes
    stderr = flexcam("run", case).err
    assert "fidelity.masses" in stderr
    assert f"{line + 1}" in stderr


@pytest.mark.parametrize("model", mostly_slow(["rigid", "sdof", "chain", "modes", "beams"], 2))
def test_every_model_has_a_readable_result(ran, tayeb, model):
    keys = ("modes=3",) if model == "modes" else (f'model="{model}"', "masses=2")
    done = ran(*keys)
    assert done.code == 0
    assert done.json["integrated"] == {"rigid": 0, "sdof": 1, "chain": 2, "modes": 7, "beams": 10}[model]
    result = read_result(done.json["result"])
    direct = run(read_case(tayeb(1), [*FEW, *(f"fidelity.{key}" for key in keys)]))["valve"]
    # The file holds what the run had, in double precision.
    np.testing.assert_allclose(result.response["valve"].displacement, direct.displacement, rtol=0.0, atol=1e-15)
    moved = result.field("displacement")
    assert moved.shape[1:] == (6, 3)
    assert np.isfinite(moved).all()
    assert np.ptp(moved[:, result.mesh.node("tappet"), 1]) > 5e-3  # the lift is 6 mm


def test_the_rigid_train_moves_with_the_lift(ran, tayeb):
    done = ran('model="rigid"')
    result = read_result(done.json["result"])
    time = result.response.time[::20]  # field_every = 20
    lift = 3e-3 * (1.0 - np.cos(100.0 * np.pi * time))  # 6 mm, shm over 180 deg, 3000 rpm
    slope = 3e-3 * 100.0 * np.pi * np.sin(100.0 * np.pi * time)
    for point in ("tappet", "pushrod-top"):
        node = result.mesh.node(point)
        # What is left is the rounding of the cam angle.
        np.testing.assert_allclose(result.field("displacement")[:, node, 1], lift, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(result.field("velocity")[:, node, 1], slope, rtol=0.0, atol=1e-10)
    valve = result.response["valve"].displacement
    np.testing.assert_allclose(valve[::20], 1.6 * lift, rtol=0.0, atol=1e-12)  # arms of 25 and 40 mm
    assert not result.field("displacement")[:, result.mesh.node("cam")].any()
    assert "rigid model computes no member forces" in " ".join(done.json["warnings"])
    direct = run(read_case(tayeb(1), FEW), rigid=True)["valve"].displacement
    np.testing.assert_allclose(direct, valve, rtol=0.0, atol=1e-15)


def test_one_mass_shows_what_beams_show(ran):
    """The same nodes, vectors and probes, and close to them: the train moves nearly as one body (0.13 % rms)."""
    one, all_of_it = (read_result(ran(f'model="{model}"').json["result"]) for model in ("sdof", "beams"))
    assert one.field_names == all_of_it.field_names
    assert set(one.recovered) == set(all_of_it.recovered)
    for point in ("tappet", "pushrod-top"):
        near, true = (r.field("displacement")[:, r.mesh.node(point), 1] for r in (one, all_of_it))
        assert np.abs(near - true).max() < 0.01 * np.ptp(true)


@pytest.mark.slow
def test_estimates_are_printed(ran):
    said = ran("estimate=true", json=False)
    assert said.code == 0
    assert re.search(r"lift\s+24\.80\d+ ± 0\.00\d+ mm", said.out)
    errors = {one["quantity"]: one for one in ran("estimate=true").json["errors"]}
    assert set(errors) == {"lift", "velocity", "acceleration", "force intake"}
    assert errors["lift"]["holds"]
    assert ran().json["errors"] == []
    assert "±" not in ran(json=False).out


def test_the_estimate_of_a_coarser_model_counts_its_distance_to_beams(ran, fine):
    for model, rest in (("rigid", 0.01), ("sdof", 0.05)):
        done = ran(f'model="{model}"', "estimate=true").json
        error = next(one for one in done["errors"] if one["quantity"] == "lift")
        valve = read_result(done["result"]).response["valve"].displacement
        # The lift is a range, which errs at both ends.
        # What is left besides the model is the error of steps and elements, some 1e-6 m, of 4 mm and of 42 um.
        true = np.abs(valve - fine.displacement[::8]).max(), abs(np.ptp(valve) - np.ptp(fine.displacement))
        assert error["model"] == pytest.approx(max(true), rel=rest)


def test_a_run_whose_errors_cannot_be_estimated_is_told_all_the_same(flexcam, tayeb):
    """Twice the elements need shorter steps than the method was given; the run itself is complete and stays."""
    keys = ['run.integrator={ method = "central-difference" }', "run.steps_per_revolution=4000", "run.revolutions=0.05"]
    laid = [word for key in (*keys, "fidelity.estimate=true") for word in ("--set", key)]
    done = flexcam("run", tayeb(1), *laid, "--json")
    assert done.code == 0
    assert done.json["errors"] == []
    said = next(one for one in done.json["warnings"] if "no errors are estimated" in one)
    assert "is refused: run.step" in said
    assert "central-difference" in said
    assert len(read_result(done.json["result"]).response.time) == 201


@pytest.mark.slow
def test_a_tolerance_with_an_estimate(ran):
    done = ran('tolerance="10 %"', "estimate=true").json
    assert done["choice"]["met"]
    assert {one["quantity"] for one in done["errors"]} >= {"lift"}
