"""The command limits: speeds of contact loss, bounce, coil clash and buckling."""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, solve
from flexcam.analysis.limits import (
    Search,
    _filtered_contacts,
    _lofted_valves,
    _open_contacts,
    evaluate_speed,
    find_limits,
)
from flexcam.core.units import RPM
from flexcam.dynamics import Cause, Status
from flexcam.valvetrain import separation_by_flank

CASE = Path(__file__).resolve().parents[2] / "cases/pushrod-engine/intake.toml"
QUICK = ("--set", "run.steps_per_revolution=360")
ONE_WORKER = ("--workers", "1")
"""Run all speeds in this process: starting a worker takes longer than the runs."""


def test_limits_report_every_limit_and_rigid_speed(flexcam, one_mass):
    """Without seat, coils and members only contact loss occurs, when the inertia exceeds the spring force."""
    case = one_mass()
    answer = flexcam("limits", case, "--lowest", "3000rpm", "--highest", "5000rpm", *ONE_WORKER, "--json").json
    assert answer["first"] == "loss_of_contact"
    assert [answer[f"{name}_rpm"] for name in ("bounce", "coil_clash", "buckling")] == [None] * 3
    z = np.linspace(0.0, 1.0, 20001)
    rise = np.radians(63.0)
    lift, bend = 6e-3 * (z - np.sin(2 * np.pi * z) / (2 * np.pi)), 6e-3 / rise**2 * 2 * np.pi * np.sin(2 * np.pi * z)
    falls = bend < 0.0
    rigid = np.sqrt(((300.0 + 40e3 * lift[falls]) / (0.1 * -bend[falls])).min()) * 30.0 / np.pi
    assert answer["rigid_loss_of_contact_rpm"] == pytest.approx(rigid, rel=1e-5)
    assert answer["loss_of_contact_rpm"] == pytest.approx(rigid, rel=0.06)  # the contact is slightly flexible


def test_periodic_start_is_not_searched_at_every_speed(one_mass, monkeypatch):
    """The first revolution does not count: the runs of a search begin with equilibrium."""
    case, search = read_case(one_mass()), Search(3000.0 * RPM, 5000.0 * RPM)
    expected = evaluate_speed(case, search, 4200.0 * RPM)
    monkeypatch.setattr("flexcam.analysis.preparation.solve_periodic", lambda *_, **__: pytest.fail("searched"))
    assert evaluate_speed(case.with_run({"start": "periodic"}), search, 4200.0 * RPM) == expected


@pytest.mark.slow
def test_limits_are_independent_of_speed_range(flexcam, one_mass):
    """The revolution of contact loss does not matter; contact is lost over the nose at every higher speed."""
    case = one_mass()
    first_range, second_range = (
        flexcam("limits", case, "--lowest", low, "--highest", high, *ONE_WORKER, "--json").json
        for low, high in (("3000rpm", "5000rpm"), ("3170rpm", "4400rpm"))
    )
    for name in ("loss_of_contact", "float"):
        assert first_range[f"{name}_rpm"] == second_range[f"{name}_rpm"]
        assert first_range[f"{name}_bands_rpm"] == [[first_range[f"{name}_rpm"], None]]
    assert first_range["loss_of_contact_rpm"] == first_range["float_rpm"]
    output = " ".join(flexcam("limits", case, "--lowest", "3170rpm", "--highest", "4400rpm", *ONE_WORKER).out.split())
    assert "the follower leaves its cam for over 0.5 deg above 0.3 mm of lift (k, nose)" in output


@pytest.mark.slow
def test_limit_below_range_is_reported_at_lowest_speed(flexcam, one_mass):
    range_ = ("--lowest", "4400rpm", "--highest", "4500rpm", *QUICK, *ONE_WORKER)
    row = next(line for line in flexcam("limits", one_mass(), *range_).out.splitlines() if line.startswith("float"))
    assert "4400 or below" in row
    assert "4400 to at least" in row
    answer = flexcam("limits", one_mass(), *range_, "--json").json
    assert answer["float_rpm"] == answer["float_bands_rpm"][0][0] == pytest.approx(4400.0)


@pytest.mark.parametrize(("lowest", "highest", "limit"), [(4100, 4200, 4100), (4080, 4110, 4090), (4160, 4200, None)])
def test_narrow_range_is_examined_at_its_ends(lowest, highest, limit, one_mass):
    """The event occurs from 4090 to 4150 rpm, between the powers of 1.05 in rad/s, 4050 and 4252 rpm."""

    def begin(speeds):
        return [lambda speed=speed: {"float": ["k"] * (4090.0 < speed / RPM < 4150.0)} for speed in speeds]

    search = Search(lowest * RPM, highest * RPM)
    found = find_limits(read_case(one_mass()), search, among=("float",), start=begin).limits["float"]
    assert found.rpm == (limit and pytest.approx(limit, abs=1.0))
    assert ("already at the lowest speed" in found.words) is (limit == lowest)


@pytest.mark.parametrize(
    ("part", "begin", "end"), [("opening flank", 50, 60), ("nose", 90, 100), ("closing flank", 145, 155)]
)
def test_contact_loss_is_assigned_to_flanks(one_mass, part, begin, end):
    """The cycloidal rise from 34 to 97 deg and the return to 172 deg have their maximum velocities at half."""
    ready = prepare(read_case(one_mass(), ["run.steps_per_revolution=3600", "run.revolutions=1"]))
    response = solve(ready.problem, ready.scheme)
    force = response.channels["contacts.k.force"]
    force[:] = 1.0
    force[(np.degrees(response.angle) > begin) & (np.degrees(response.angle) <= end)] = 0.0
    lost = separation_by_flank(ready.model, response, "k", np.ones(len(force), dtype=bool))
    assert {name for name, angle in lost.items() if angle} == {part}
    assert lost[part] == pytest.approx(np.radians(10.0), rel=0.02)  # a step at an end


def test_low_pass_filter_ignores_chatter(one_mass):
    """Zero force over 4 deg is a loss at any cutoff frequency; bursts of 20 kHz are none below 5 kHz."""
    ready = prepare(read_case(one_mass(), ["run.steps_per_revolution=7200", "run.revolutions=2", "run.speed=3000rpm"]))
    response = solve(ready.problem, ready.scheme)
    force, nose = response.channels["contacts.k.force"], np.abs(np.degrees(response.angle) - 455.0) < 5.0
    steady = np.full(len(force), 100.0)
    force[:] = np.where(nose & (np.sin(2.0 * np.pi * 20e3 * response.time) > 0.8), 0.0, steady)
    assert _open_contacts(response, ready) == ["k, nose"]
    assert _filtered_contacts(response, ready, 5e3) == []
    force[:] = np.where(np.abs(np.degrees(response.angle) - 455.0) < 2.0, 0.0, steady)
    assert _filtered_contacts(response, ready, 5e3) == ["k, nose"]
    with pytest.raises(InputError, match=r"below 180000 Hz"):
        _filtered_contacts(response, ready, 2e5)


@pytest.mark.parametrize(
    ("is_met", "limit", "scatter"),
    [
        (lambda rpm: rpm > 4000.0, 4000.0, None),
        (lambda rpm: rpm > 3990.0 and not 4003.0 < rpm < 4020.0, 3990.0, (1.0, 1.007)),
        (lambda rpm: rpm > 4000.0 or 3970.0 < rpm < 3974.0, 4000.0, (0.993, 1.0)),
    ],
)
def test_scatter_of_intermittent_limit(one_mass, is_met, limit, scatter):
    """The examined speeds are 0.3 and 0.7 % below and above the limit."""

    def begin(speeds):
        return [lambda speed=speed: {"float": ["k"] * is_met(speed / RPM)} for speed in speeds]

    search = Search(3500.0 * RPM, 4500.0 * RPM, tolerance=0.5 * RPM, nearby=True)
    found = find_limits(read_case(one_mass()), search, among=("float",), start=begin).limits["float"]
    assert found.rpm == pytest.approx(limit, abs=0.5)
    assert found.scatter_rpm == (scatter and pytest.approx((scatter[0] * found.rpm, scatter[1] * found.rpm), rel=1e-6))


@pytest.mark.parametrize(
    ("is_met", "bands"),
    [
        (lambda rpm: rpm > 4000.0, [(4000.0, None)]),
        (lambda rpm: 4000.0 < rpm < 4300.0, [(4000.0, 4252.4)]),
        (lambda rpm: 4000.0 < rpm < 4300.0 or rpm > 4600.0, [(4000.0, 4252.4), (4688.3, None)]),
    ],
)
def test_speed_bands_of_event(one_mass, is_met, bands):
    """The speeds of the search above 4000 rpm are 4050, 4252, 4465 and 4688 rpm, the powers of 1.05 in rad/s."""

    def begin(speeds):
        return [lambda speed=speed: {"float": ["k"] * is_met(speed / RPM)} for speed in speeds]

    search = Search(3500.0 * RPM, 4500.0 * RPM)
    found = find_limits(read_case(one_mass()), search, among=("float",), start=begin).limits["float"].bands_rpm
    assert [end for _, end in found] == [end and pytest.approx(end, abs=0.1) for _, end in bands]
    assert [begin for begin, _ in found] == pytest.approx([begin for begin, _ in bands], abs=1.0)


@pytest.mark.parametrize("ahead", [1, 3])
def test_limits_share_runs(one_mass, ahead):
    """Two limits share each run; the requested number of runs is active while the search awaits one result."""
    requested_speeds, running, active_counts = [], set(), []

    def begin(speeds):
        requested_speeds.extend(speeds)
        running.update(speeds)
        return [partial(result, speed) for speed in speeds]

    def result(speed):
        active_counts.append(len(running))
        running.remove(speed)
        return {"loss_of_contact": ["k"] * (speed > 200.0), "float": ["k"] * (speed > 260.0)}

    case, search, names = read_case(one_mass(), QUICK[1:2]), Search(50.0, 1000.0), ["loss_of_contact", "float"]
    found = find_limits(case, search, names, start=begin, ahead=ahead).limits
    assert found["loss_of_contact"].rpm == pytest.approx(200.0 / RPM, abs=1.0)
    assert found["float"].rpm == pytest.approx(260.0 / RPM, abs=1.0)
    assert len(requested_speeds) == len(set(requested_speeds))
    assert max(requested_speeds) < 260.0 * 1.05 ** (4 + ahead)
    assert set(active_counts) == ({1, 2} if ahead == 1 else {3})  # two limits need two runs at a time


@pytest.mark.slow
def test_valve_loft_is_compared_with_threshold():
    """A valve loft of 0.3 mm exceeds a threshold of 0.25 mm, but not one of 0.5 mm."""
    ready = prepare(read_case(CASE, ["run.steps_per_revolution=360", "run.crank_speed=1000rpm"]))
    response = solve(ready.problem, ready.scheme)
    assert _lofted_valves(response, ready, 0.25e-3) == []
    response.channels["contacts.seat.gap"][response.angle > 2.0 * np.pi] += 0.4e-3  # 0.1 mm less: the train is flexible
    assert _lofted_valves(response, ready, 0.25e-3) == ["seat"]
    assert _lofted_valves(response, ready, 0.5e-3) == []


@pytest.mark.slow
def test_optional_limits_and_limits_of_bilateral_contact(flexcam, one_mass):
    """Float and filtered loss are optional; a bilateral contact has no contact loss."""
    few = (
        "--lowest",
        "3000rpm",
        "--highest",
        "3010rpm",
        "--accuracy",
        "2500rpm",
        "--set",
        "run.revolutions=1",
        *QUICK,
        *ONE_WORKER,
    )
    report = flexcam("limits", CASE, *few, "--lift-deviation", "1 mm", "--low-pass", "2kHz", "--json").json
    assert {"lift_deviation_rpm", "filtered_loss_rpm"} <= set(report)
    assert {"loss_of_contact_rpm", "bounce_rpm", "buckling_rpm", "spring_margin"} <= set(report)
    assert (report["shaft"], report["first"]) == ("crank", None)
    assert report["buckling_margins"]["pushrod"] > 1.0
    bilateral = ("--set", 'contacts.intake={ model="bilateral", cam="intake", follower="tappet", stiffness="50 MN/m" }')
    output = flexcam("limits", CASE, *few, *bilateral).out
    assert "buckling" in output
    assert "contact loss, rigid" not in output  # it needs a contact that can open
    assert "float" not in output


def test_limits_refuse_unsuitable_case_or_options(flexcam, one_mass):
    case = one_mass(('model = "unilateral"', 'model = "bilateral"'))
    assert "no part that has a limit" in flexcam("limits", case, *QUICK, *ONE_WORKER).err
    assert "one of them" in flexcam("limits", CASE, "--low-pass", "2kHz", "--over", "a=1", "--and", "b=2").err
    assert flexcam("limits", CASE, "--low-pass", "5").code == 2


MIDDLE = 0.5 * (1.5**14 + 1.5**15)


@pytest.mark.parametrize(
    ("highest", "failed", "rpm", "words"),
    [
        (600.0, 1.5**15, None, "not known above this speed; the run at camshaft 4181.5"),
        (450.0, MIDDLE, 1.5**15 / RPM, "(k); the run at camshaft 3484.6"),
    ],
)
def test_failed_run_makes_limit_unknown(highest, failed, rpm, words, one_mass, monkeypatch):
    """Contact is lost at 385 rad/s, between 292 rad/s and 438 rad/s of the search."""

    def solve_or_fail(problem, *given, **options):
        response = solve(problem, *given, **options)
        failed_status = Status(Cause.NO_CONVERGENCE, "it broke")
        return replace(response, status=failed_status) if problem.drive.speed == pytest.approx(failed) else response

    monkeypatch.setattr(sys.modules["flexcam.analysis.limits"], "solve", solve_or_fail)
    search = Search(200.0, highest, tolerance=30.0, spacing=0.5)
    limit = find_limits(read_case(one_mass(), QUICK[1:2]), search, among=("float",)).limits["float"]
    assert words in limit.words
    assert limit.rpm == (rpm and pytest.approx(rpm))
    assert limit.known == ("not known" not in words)


@pytest.mark.parametrize(("lift", "threshold"), [("6 mm", "0.1 mm"), ("0.2 mm", "0.004 mm")])
def test_bounce_threshold_depends_on_lift(lift, threshold, one_mass):
    """The threshold is 0.1 mm, or 2 % of a small lift."""
    seat = 'seat = { at = "mass", direction = "-uz", model = "seat", stiffness = "50 MN/m" }\n[run]'
    case = one_mass(('lift = "6 mm"', f'lift = "{lift}"'), ("[run]", seat))
    search = Search(100.0, 101.0, tolerance=10.0, spacing=1.0)
    found = find_limits(read_case(case, QUICK[1:2]), search, among=("bounce",)).limits
    assert found["bounce"].words.endswith(f"criterion: the valve leaves its seat again by more than {threshold}")


@pytest.mark.parametrize(("highest", "rpm"), [(4500.0, 4030.0), (4000.0, None)])
def test_failed_run_above_limit_keeps_limit(one_mass, highest, rpm):
    """The limit is 4030 rpm, and runs above 4300 rpm fail: the limit is known, and a lower range has none."""

    def begin(speeds):
        return [
            lambda speed=speed: "ended" if speed > 4300.0 * RPM else {"float": ["k"] * (speed > 4030.0 * RPM)}
            for speed in speeds
        ]

    search = Search(3500.0 * RPM, highest * RPM, tolerance=0.5 * RPM)
    found = find_limits(read_case(one_mass()), search, among=("float",), start=begin).limits["float"]
    assert found.known
    assert found.rpm == (rpm and pytest.approx(rpm, abs=0.5))
    assert ("ended" in found.words) is (rpm is not None)
