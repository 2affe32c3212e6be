"""Choice of a model: distances of runs, Pareto front, model ladder, error estimates and their format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, run, solve
from flexcam.analysis.histories import Histories, distance, extract_histories
from flexcam.analysis.model_choice import (
    Choice,
    Error,
    ModelEvaluation,
    ModelLevel,
    Reference,
    candidate_models,
    estimate_errors,
    evaluate_model,
    mark_pareto_front,
    model_ladder,
    reference_run,
    run_count,
    run_histories,
    steps_per_revolution_of,
    total_work,
)
from flexcam.analysis.preparation import scalar_probe
from flexcam.analysis.run_checks import describe_model_limits
from flexcam.case.variants import with_elements, with_steps
from flexcam.dynamics import Cause, Status, integrated_size, outline
from flexcam.report.fidelity_tables import describe_choice, format_with_error

ROOT = Path(__file__).parents[2]
INLINE = ROOT / "tests/data/inline.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"


def history(steps, *values, **more):
    """Return the histories of a run over one second; values are functions of time."""
    time = np.linspace(0.0, 1.0, steps + 1)
    one = {name: value(time) for name, value in more.items()}
    return Histories(time, one | {f"force {i}": value(time) for i, value in enumerate(values)}, {}, "uy")


class TestDistance:
    def test_maximum_and_rms_norm(self):
        one, other = (history(4, velocity=f) for f in (lambda t: 0.0 * t, lambda t: np.where(t == 0.5, -3.0, 1.0)))
        assert distance(one, other) == {"velocity": 3.0}
        assert distance(one, other, norm="rms")["velocity"] == pytest.approx(np.sqrt((9.0 + 4.0) / 5.0), rel=1e-15)

    def test_distance_at_common_instants(self):
        """The finer run deviates only between the instants of the coarser one."""
        fine = history(8, lift=lambda t: t + np.where(np.arange(len(t)) % 2 == 1, 7.0, 0.0))
        coarse = history(4, lift=lambda t: t)
        assert distance(fine, coarse, norm="rms")["lift"] == distance(coarse, fine, norm="rms")["lift"] == 0.0
        assert distance(coarse, history(8, lift=lambda t: t + 7.0))["lift"] == 7.0

    def test_distance_includes_maxima_between_instants(self):
        """The error of a force between the instants of the coarser run is the difference of the maxima."""
        fine, coarse = history(8, lambda t: np.where(t == 0.375, 9.0, 1.0)), history(4, lambda t: 1.0 + 0.0 * t)
        assert distance(fine, coarse) == distance(coarse, fine) == {"force 0": 8.0}

    def test_distance_of_motions_between_instants(self):
        """Both runs agree at common instants; the cubic in between misses the wave of the finer run."""
        fine, coarse = history(8, lift=lambda t: t + 1e-3 * np.sin(4.0 * np.pi * t) ** 2), history(4, lift=lambda t: t)
        coarse = replace(coarse, slopes={"lift": np.ones(5)})
        assert distance(fine, coarse)["lift"] == pytest.approx(1e-3, rel=1e-12)
        assert distance(fine, coarse, norm="rms")["lift"] == pytest.approx(0.0, abs=1e-15)

    def test_default_norm_depends_on_quantity(self):
        """By default forces use the maximum difference and motions the rms; a given norm applies to both."""
        one, other = history(4, lambda t: t, lift=lambda t: t), history(4, lambda t: t**2, lift=lambda t: t**2)
        largest, mean = 0.25, float(np.sqrt(np.mean((one.time - one.time**2) ** 2)))
        for norm, (force, lift) in {None: (largest, mean), "max": (largest, largest), "rms": (mean, mean)}.items():
            assert distance(one, other, norm=norm) == pytest.approx({"lift": lift, "force 0": force}, rel=1e-15)

    @pytest.mark.parametrize("steps", [5, 7, 11])
    def test_runs_without_common_instants_raise_error(self, steps):
        with pytest.raises(InputError, match="instants that differ"):
            distance(history(4, lift=lambda t: t), history(steps, lift=lambda t: t))

    def test_quantities_of_single_run_are_ignored(self):
        one, other = history(4, lift=lambda t: t), history(4, lambda t: t, lift=lambda t: t + 1.0)
        assert distance(one, other) == distance(other, one) == {"lift": 1.0}

    def test_size_of_quantity(self):
        """The size of a lift is its range, that of other quantities the maximum."""
        one = history(4, lift=lambda t: 5.0 + 2.0 * t, velocity=lambda t: -3.0 - t)
        assert (one.size("lift"), one.size("velocity")) == (2.0, 4.0)
        assert (
            history(4, lift=lambda t: -5.0 + 0.0 * t).size("lift") == 5.0
        )  # a constant lift has its own value as size
        assert (one.unit("lift"), one.unit("velocity"), one.unit("force intake")) == ("m", "m/s", "N")

    def test_size_between_instants(self):
        """The maximum of a parabola between two instants is 1/4 above their chord."""
        one = history(3, lift=lambda t: t * (1.0 - t))
        assert one.size("lift") == pytest.approx(2.0 / 9.0, rel=1e-15)
        assert replace(one, slopes={"lift": 1.0 - 2.0 * one.time}).size("lift") == pytest.approx(0.25, rel=1e-15)

    def test_probe_with_several_scalars_raises_error(self):
        with pytest.raises(InputError, match="several components"):
            run_histories(read_case(INLINE, ["run.revolutions=0.01"]), "cam")


def evaluation(work, worst, steps=100):
    errors = {} if worst is None else {"lift": worst, "velocity": worst / 2.0}
    return ModelEvaluation("any", "", steps, work // steps, work, 0.0, errors, Status(Cause.DONE))


class TestFront:
    def test_marks_non_dominated_models(self):
        given = [
            evaluation(400, 0.02),
            evaluation(100, 0.5),
            evaluation(200, 0.6),
            evaluation(300, 0.1),
            evaluation(500, 0.02),
            evaluation(600, 0.01),
        ]
        found = mark_pareto_front(given)
        assert [one.work for one in found] == [100, 200, 300, 400, 500, 600]
        assert [one.best for one in found] == [True, False, True, True, False, True]
        assert not any(one.best for one in given)

    def test_equal_work_is_sorted_by_steps(self):
        assert [one.best for one in mark_pareto_front([evaluation(400, 0.2, 200), evaluation(400, 0.2, 100)])] == [
            True,
            False,
        ]

    def test_failed_runs_are_never_best(self):
        assert [one.best for one in mark_pareto_front([evaluation(100, None), evaluation(200, 0.3)])] == [False, True]

    def test_model_with_fewer_quantities_does_not_dominate(self):
        """A rigid train has no seat force: its small errors do not exclude models that have one."""
        whole = [
            replace(one, errors=one.errors | {"force seat": 0.9})
            for one in (evaluation(100, 0.5), evaluation(200, 0.1))
        ]
        found = mark_pareto_front([evaluation(0, 0.05), evaluation(50, 0.06), *whole, evaluation(300, 0.01)])
        assert [one.best for one in found] == [True, False, True, False, False]


class TestLadder:
    def test_models_of_ladder(self):
        names = [one.name for one in model_ladder(read_case(INLINE))]
        assert names == ["rigid", "sdof", "modes 3", "modes 10", "beams", "beams x2"]
        finer = model_ladder(read_case(INLINE, ["members.pushrod.elements=4", "members.camshaft.elements=4"]))
        assert [one.name for one in finer] == [
            "rigid", "sdof", "chain 3", "modes 3", "modes 10", "modes 30", "beams 1", "beams 2", "beams", "beams x2",
        ]  # fmt: skip

    def test_equal_bases_are_listed_once(self):
        """Three modes of the pushrod engine with their static corrections span the same basis as ten."""
        names = [one.name for one in model_ladder(read_case("cases/pushrod-engine/intake.toml"))]
        assert [name for name in names if name.startswith("modes")] == ["modes 3", "modes 30"]

    @pytest.mark.slow
    def test_levels_are_derived_from_case(self):
        by_name = {one.name: one for one in model_ladder(read_case(INLINE, ["members.pushrod.elements=3"]))}
        unknowns = {name: integrated_size(prepare(one.case).problem) for name, one in by_name.items()}
        assert (unknowns["rigid"], unknowns["sdof"]) == (0, 1)
        assert by_name["beams x2"].case.record.members["pushrod"].elements == 6
        assert by_name["beams x2"].case.record.members["camshaft"].elements == 2
        assert by_name["beams"].case.record.fidelity.model == "beams"
        assert unknowns["modes 3"] < unknowns["beams"] < unknowns["beams x2"]

    def test_fidelity_options_of_case_are_removed(self):
        asked = read_case(INLINE, ['fidelity={ tolerance = "1 %", modes = 3, estimate = true }'])
        rungs = model_ladder(asked)
        for one in rungs:
            assert one.case.record.fidelity.tolerance is None
            assert not one.case.record.fidelity.estimate
        assert rungs[-2].case.record.fidelity.modes is None

    def test_engine_applies_to_models_with_unknowns(self):
        """A rigid train has no unknowns, so that it does not support the engine of the other models."""
        rungs = model_ladder(read_case(INLINE, ["run.engine=modal"]))
        assert [one.case.record.run.engine for one in rungs] == ["auto", *["modal"] * 5]
        assert prepare(rungs[0].case).problem.engine == "auto"

    def test_candidates_are_sorted_by_work(self):
        """Work counts integrated unknowns: one mass with many steps costs less than beams with few."""
        found = candidate_models(read_case(INLINE, ["run.steps_per_revolution=240"]))
        work = [integrated_size(ready.problem) * ready.problem.steps for ready in (prepare(one.case) for one in found)]
        assert work == sorted(work)
        assert {steps_per_revolution_of(one.case) for one in found} == {60, 120, 240}

    @pytest.mark.parametrize(("steps", "counts"), [(100, {100}), (120, {60, 120})])
    def test_candidates_use_divided_steps(self, steps, counts):
        """Steps are halved down to 60 per revolution, in whole numbers only."""
        found = candidate_models(read_case(INLINE, [f"run.steps_per_revolution={steps}"]))
        assert {steps_per_revolution_of(one.case) for one in found} == counts


def test_ladder_with_start_from_result_raises_error():
    """A result fits one mesh only: the error suggests another start."""
    case = read_case(INLINE, ['run.start={ result = "first.vtkhdf" }'])
    with pytest.raises(InputError, match=r"got a start from a result, expected another start\. The result fits"):
        reference_run(case, "valve")


def test_derived_cases_do_not_change_original():
    case = read_case(ENGINE)
    before = case.record.model_dump_json()
    members, springs = (with_elements(case, factor=3).record.members, with_elements(case, factor=3).record.springs)
    assert (members["pushrod"].elements, members["camshaft"].elements) == (12, 6)
    assert (springs["valve"].elements, springs["tappet"].elements) == (24, 1)  # a spring without surge has one element
    each = with_elements(case, each=5).record
    assert {one.elements for one in each.members.values()} == {5}
    assert each.springs["valve"].elements == 8
    assert case.with_run({"revolutions": 7.0}).record.run.revolutions == 7.0
    assert case.with_fidelity({"model": "rigid"}).record.fidelity.model == "rigid"
    assert with_steps(case, 90).record.run.steps_per_revolution == 90
    assert case.record.model_dump_json() == before


def test_steps_per_revolution_of_case():
    assert steps_per_revolution_of(read_case(INLINE)) == 720
    given = read_case(INLINE)
    # A revolution at 3000 rpm takes 20 ms; a step of 30 us divides it 666.7 times.
    assert steps_per_revolution_of(given.with_run({"steps_per_revolution": None, "step": 30e-6})) == 667
    assert steps_per_revolution_of(given.with_run({"steps_per_revolution": None})) == 3600


def error_estimate(size, total, unit="m"):
    return Error("lift", unit, size, total, 0.0, 0.0, True)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (error_estimate(0.010431, 2e-5), "10.431 ± 0.020 mm"),
        (error_estimate(0.010431, 2.04e-3), "10.4 ± 2.0 mm"),
        (error_estimate(0.010431, 0.15), "10 ± 150 mm"),
        (error_estimate(1234.4, 12345.6, "N"), "1234 ± 12346 N"),
        (error_estimate(1038.096023574891, 3.8e-11, "N"), "1038.096024 N"),  # rounding is no error
        (error_estimate(0.006, 0.0), "6 mm"),
        (error_estimate(0.0, 0.0), "0 mm"),
        (error_estimate(0.0, 1e-20), "0 ± 1e-17 mm"),
        (error_estimate(1e-16, 2e-20), "1e-13 ± 2e-17 mm"),
    ],
)
def test_format_with_error(error, text):
    assert format_with_error(error) == text


def test_total_error_is_sum():
    assert Error("lift", "m", 1.0, 1e-3, 2e-3, 4e-3, True).total == pytest.approx(7e-3, rel=1e-15)


def test_total_work_and_run_count():
    """Reference of 4 and 2 times the steps, levels with half of them, twice: the work equals 4 runs of 240 steps."""
    case = read_case(INLINE, ["run.steps_per_revolution=120"])
    work = total_work(case, [ModelLevel("own", "", with_steps(case, 60))] * 2, repeats=2)
    assert work == 960
    assert run_count(with_steps(case, 240), work) == 4
    assert run_count(with_steps(case, 480), 0) == run_count(with_steps(case, 480), 1) == 1


@pytest.mark.slow
def test_norms_of_errors():
    """The runs are the same; only the norm of the reference differs."""
    asked = [["run.steps_per_revolution=120"], ['fidelity.norm="max"'], ['fidelity.norm="rms"']]
    found = {}
    for one in asked:
        case = read_case("tests/data/every-contact.toml", [*asked[0], "run.revolutions=0.3", *one])
        probe = scalar_probe(prepare(case))
        against = reference_run(case, probe)
        assert against.norm == case.record.fidelity.norm
        found[against.norm] = evaluate_model(ModelLevel("own", "", with_steps(case, 60)), probe, against).errors
    for name in found["max"]:
        assert found["rms"][name] < found["max"][name]
        assert found[None][name] == found["max" if name.startswith("force") else "rms"][name]


def test_why_names_quantities_of_tolerance():
    """The reason names quantities of the tolerance, not the worst of all; a quantity of size zero has no share."""
    found = replace(evaluation(100, 0.4), errors={"lift": 0.02, "velocity": 0.4})
    own, size = {"lift": 1e-5, "velocity": 1e-3, "force c": 0.0}, {"lift": 1e-2, "velocity": 1.0, "force c": 0.0}
    against = Reference(history(4), own, size, 400)
    choice = Choice(ModelLevel("any", "", SimpleNamespace()), found, None, against, False, 5, {"lift": 0.01})
    assert choice.why == "the closest of 5 models is off by lift 2 % (the reference 0.1 %)"
    assert "40" not in choice.why
    assert "The tolerance is not met" in describe_choice(choice)[0]
    assert replace(choice, is_met=True).why == ""
    assert "has all of force" in replace(choice, tolerance={"force": 0.1}).why


def lift_histories(case, steps):
    return run_histories(with_steps(case, steps), "valve")


class TestEstimate:
    @pytest.mark.parametrize("steps", [60, pytest.param(125, marks=pytest.mark.slow)])
    def test_time_error_of_smooth_case(self, steps):
        """Of second order: 3/4 of the error vanishes with half the step, and this is doubled: 1.5 times the truth.

        The tolerance of 10 % is for the next order of the step at 60 steps per revolution.
        """
        case = read_case(INLINE, [f"run.steps_per_revolution={steps}"])
        found = {one.quantity: one for one in estimate_errors(case, "valve")}
        true = distance(lift_histories(case, steps), lift_histories(case, 32 * steps))
        for quantity in ("lift", "velocity"):
            assert found[quantity].time == pytest.approx(1.5 * true[quantity], rel=0.1)
            assert found[quantity].holds
        assert found["lift"].model == 0.0
        assert found["lift"].size == lift_histories(case, steps).size("lift")

    def test_space_error(self):
        """Against eight times the elements: the estimate is an upper bound, by a factor of at most two."""
        case = read_case(INLINE, ["run.steps_per_revolution=180", "run.speed=9000rpm"])
        found = {one.quantity: one for one in estimate_errors(case, "valve")}
        true = distance(lift_histories(case, 180), lift_histories(with_elements(case, factor=8), 180))
        assert true["lift"] <= found["lift"].space <= 2.0 * true["lift"]

    @pytest.mark.parametrize(("law", "speed"), [("shm", 3000), ("parabolic", 600), ("cycloidal", 3000)])
    def test_error_covers_maxima_between_steps(self, law, speed):
        """The maxima with 64 times the steps are within the estimated error, also that of a published load."""
        few = ["run.steps_per_revolution=45", f'run.speed="{speed}rpm"']
        case = read_case(f"cases/tayeb/model-1-{law}.toml", few)
        true = lift_histories(case, 64 * 45)
        for one in estimate_errors(case, "valve"):
            assert abs(one.size - true.size(one.quantity)) <= one.total

    @pytest.mark.usefixtures("shipped_selection")
    @pytest.mark.parametrize(("revolutions", "engine"), [(1, "kernel"), (0.05, "direct")])
    def test_engine_depends_on_all_runs_of_estimate(self, revolutions, engine, monkeypatch):
        """4.5 times 1440 steps are worth compiling; the longest single run, 2880 steps, is not."""
        taken: list[str] = []

        def record_engine(response, probe):
            taken.append(response.stats.engine)
            return extract_histories(response, probe)

        monkeypatch.setattr("flexcam.analysis.model_choice.extract_histories", record_engine)
        fewer = [f"run.revolutions={revolutions}", "run.steps_per_revolution=1440", "springs.valve.elements=1"]
        plain = ["members.pushrod.geometric_stiffness=false", "members.pushrod.bow=0"]
        estimate_errors(read_case(ENGINE, [*fewer, *plain, "run.integrator.method=newmark"]), "valve")
        assert taken == [engine] * 4

    def test_chatter_has_no_error_estimate(self):
        """At 9000 crank rpm the tappet bounces on its cam repeatedly, at other instants with shorter steps."""
        fast = [
            "run.integrator.method=newmark",
            "run.crank_speed=9000rpm",
            "run.revolutions=0.6",
            "run.steps_per_revolution=180",
        ]
        case = read_case(ENGINE, [*fast, "springs.valve.elements=2", "members.pushrod.geometric_stiffness=false",
                                  "members.pushrod.bow=0"])  # fmt: skip
        assert not {one.quantity: one for one in estimate_errors(case, "valve")}["force intake"].holds

    @pytest.mark.slow
    def test_error_of_seating_velocity(self):
        """A ringing valve meets its ramp at 3000 crank rpm: the result of eight times the steps is within the error."""
        slow = ["run.crank_speed=3000rpm", "run.revolutions=1", "run.steps_per_revolution=720"]
        plain = ["members.pushrod.geometric_stiffness=false", "members.pushrod.bow=0", "springs.valve.elements=2"]
        case = read_case(ENGINE, [*slow, *plain])
        (found,) = (one for one in estimate_errors(case, "valve") if one.quantity == "seating velocity seat")
        true = run(with_steps(case, 8 * 720)).metrics["contacts.seat.seating_velocity"]
        assert found.unit == "m/s"
        assert 0.0 < abs(found.size - true) <= found.total < 0.3 * true

    def test_model_error_of_rigid_model_is_distance_to_beams(self):
        case = read_case(INLINE, ['fidelity.model="rigid"', "run.steps_per_revolution=180"])
        found = estimate_errors(case, "valve")[0]
        beams = case.with_fidelity({"model": "beams"})
        assert found.time < 1e-8 * found.size  # the cubics between instants
        assert found.space < 1e-15  # rounding of the motion
        assert found.model == pytest.approx(
            distance(lift_histories(case, 180), lift_histories(beams, 180))["lift"], rel=1e-12
        )
        assert found.model > 1e-3


@pytest.mark.slow
def test_ladder_does_not_depend_on_reduction_of_case():
    """The modal levels use their own reduction, also for a case with Craig-Bampton reduction."""
    case = read_case(INLINE)
    asked = case.with_fidelity({"modes": 5, "reduction": "craig-bampton"})
    rungs = {evaluation.name: evaluation.case.record.fidelity for evaluation in model_ladder(asked)}
    assert rungs == {evaluation.name: evaluation.case.record.fidelity for evaluation in model_ladder(case)}


def solve_case(path, *overrides):
    ready = prepare(read_case(path, ["run.steps_per_revolution=720", *overrides]))
    return ready, solve(ready.problem, ready.scheme, save=ready.save)


@pytest.mark.parametrize(("masses", "has_channel"), [(1, False), (2, True)])
def test_compression_channel_needs_mass_behind_member(masses, has_channel):
    """With a mass at either end the pushrod carries the same force as beams, except for axial waves: half a percent.

    Next to a single mass it would carry the spring force only, with an error of a quarter.
    """
    few = ['fidelity.model="chain"', f"fidelity.masses={masses}"]
    ready, response = solve_case("cases/tayeb/model-1-shm.toml", *few)
    name = "members.pushrod.compression"
    assert (name in response.channels) == has_channel
    assert any("no compression and buckling of pushrod" in one for one in describe_model_limits(ready)) != has_channel
    if has_channel:
        whole = solve_case("cases/tayeb/model-1-shm.toml")[1].channels[name]
        np.testing.assert_allclose(response.channels[name], whole, rtol=0.0, atol=5e-3 * whole.max())


@pytest.mark.parametrize(("left", "has_channel"), [("seat", True), ("lash", True), ("", False)])
def test_compression_channel_with_lash_or_seat(left, has_channel, tmp_path):
    """The single-mass model then includes the motion behind the pushrod that the contact senses."""
    lines = Path("cases/pushrod-engine/intake.toml").read_text(encoding="utf-8").splitlines()
    gone = tuple(one for one in ("seat = ", "lash = ", "clash_travel = ") if not left or not one.startswith(left))
    path = tmp_path / "engine.toml"
    path.write_text("\n".join(one for one in lines if not one.startswith(gone)), encoding="utf-8")
    ready = prepare(read_case(path, ['fidelity.model="sdof"']))
    assert ("members.pushrod.compression" in dict(outline(ready.problem.system).channels)) == has_channel
