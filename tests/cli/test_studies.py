"""Commands of design studies: sensitivity, optimize, maps of limits; closed forms on the published model."""

from __future__ import annotations

import csv
import math
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from flexcam.analysis.limits import Limits
from flexcam.analysis.natural_modes import modes
from flexcam.case.reader import CaseFile, read_case
from flexcam.case.variants import get_number
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.studies import gradients
from flexcam.studies.plan import Row
from flexcam.studies.quantities import create_evaluator, quantity_row
from flexcam.studies.variables import Variable
from tests.thinning import mostly_slow

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "cases/tayeb/model-3-shm.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
MATHIEU = ROOT / "cases/checks/mathieu.toml"
FOLLOWER = ROOT / "tests/verification/cam-follower.toml"
QUICK = ("--set", "run.steps_per_revolution=180")

OSCILLATOR = """\
format = 1
title = "mass on a spring"
[nodes]
shaft = [0.0, 0.0, 0.0]
point = [0.0, 0.1, 0.0]
[supports]
shaft = ["ux", "uy", "uz", "rx", "ry", "rz"]
point = ["ux", "uz", "rx", "ry", "rz"]
[masses]
one = { at = "point", mass = "0.1 kg" }
[springs]
one = { at = "point", direction = "uy", stiffness = "40 kN/m" }
[run]
speed = "1000 rpm"
revolutions = 1
"""
OMEGA = math.sqrt(40e3 / 0.1)


@pytest.fixture
def oscillator(tmp_path):
    path = tmp_path / "oscillator.toml"
    path.write_text(OSCILLATOR, encoding="utf-8")
    return path


@pytest.fixture
def stop_after(monkeypatch):
    """Return a function that has a study interrupted after so many variants."""

    def stop(count):
        evaluated = []

        def stopping(*words, **named):
            if len(evaluated) == count:
                raise KeyboardInterrupt
            evaluated.append(words)
            return quantity_row(*words, **named)

        monkeypatch.setattr("flexcam.studies.quantities.quantity_row", stopping)

    return stop


def test_frequency_of_a_mass_on_a_spring(flexcam, oscillator):
    """Closed form: df/dk = f/(2 k), df/dm = -f/(2 m): half a percent per percent."""
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--to", "masses.one.mass")
    by_k, by_m = flexcam("sensitivity", oscillator, *args, "--json").json["derivatives"]
    f = OMEGA / (2.0 * math.pi)
    assert by_k["value"] == pytest.approx(f, rel=1e-12)
    assert by_k["derivative"] == pytest.approx(f / (2.0 * 40e3), rel=1e-9)
    assert by_m["derivative"] == pytest.approx(-f / (2.0 * 0.1), rel=1e-9)
    assert (by_k["logarithmic"], by_m["logarithmic"]) == pytest.approx((0.5, -0.5), rel=1e-9)
    assert by_k["analytic"]


def test_the_mode_of_a_frequency_is_named_and_values_without_effect(flexcam, oscillator):
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--to", "run.speed")
    output = " ".join(flexcam("sensitivity", oscillator, *args).out.split())
    assert "frequency.1 does not depend on run.speed Frequencies are" in output
    assert "with all contacts open. frequency.1: mass one 100 %" in output
    still = ("--of", "frequency.1", "--to", "run.speed=1000:2000rpm", "--sobol", "4")
    assert "frequency.1 depends on none of these values" in flexcam("sensitivity", oscillator, *still).out


@pytest.mark.parametrize(
    ("path", "key", "unit"),
    [
        ("oscillator.toml", "springs.one.stiffness", "N/m"),
        (ROOT / "tests/data/every-key.toml", "springs.coupling.stiffness", "N m/rad"),
        (ROOT / "tests/data/every-key.toml", "springs.coupling.damping", "N m s/rad"),
        (ROOT / "tests/data/every-key.toml", "loads.belt.force", "N"),
        (ROOT / "tests/data/every-key.toml", "cams.intake.lift", "m"),
        (ROOT / "tests/data/every-key.toml", "cams.intake.return_law.c", ""),
    ],
)
def test_numbers_have_the_unit_of_their_own_table(oscillator, monkeypatch, path, key, unit):
    """A stiffness is one along a line or about an axis: what stands beside it tells."""
    monkeypatch.chdir(oscillator.parent)
    assert get_number(read_case(path), key, "--to").unit == unit


def test_derivatives_are_told_with_their_unit(flexcam, oscillator):
    done = flexcam("sensitivity", oscillator, "--of", "frequency.1", "--to", "springs.one.stiffness")
    assert "Hz per N/m" in done.out
    assert "SI" not in done.out


@pytest.mark.parametrize("key", ["rockers.rocker.arms.1", "materials.steel.E", "sections.tube.outer_diameter"])
def test_frequencies_of_a_train_against_differences(flexcam, key):
    """Modes of the case with the key changed by 1e-4, central; 1e-6: their own error of third order and rounding."""
    found = flexcam("sensitivity", PUBLISHED, "--of", "frequency.2", "--to", key, "--json").json["derivatives"][0]
    case = read_case(PUBLISHED)
    at = found["key_value"]
    arms = [0.025, 0.040]

    def frequency(value):
        laid = f"rockers.rocker.arms={[arms[0], value]}" if key.endswith("arms.1") else f"{key}={value!r}"
        one = modes(read_case(PUBLISHED, [laid])).modes
        return float(one.frequencies[one.rigid :][1])

    assert case.overrides == ()
    step = 1e-4 * at
    differences = (frequency(at + step) - frequency(at - step)) / (2.0 * step)
    assert found["derivative"] == pytest.approx(differences, rel=1e-6)


def test_response_follows_what_it_is_proportional_to(flexcam, tmp_path):
    """The published load is linear in the lift: every motion grows by a percent per percent; analytic beside it."""
    table = tmp_path / "s.csv"
    args = ("--of", "probes.valve.acceleration.largest", "--of", "frequency.1", "--to", "cams.intake.lift")
    found = flexcam("sensitivity", PUBLISHED, *args, *QUICK, "--csv", table, "--json").json
    response, frequency = found["derivatives"]
    assert response["smooth"]
    assert response["analytic"]
    assert response["logarithmic"] == pytest.approx(1.0, rel=1e-6)
    assert frequency["derivative"] == 0.0
    other = flexcam("sensitivity", PUBLISHED, *args, *QUICK, "--method", "differences", "--json").json["derivatives"][0]
    assert other["logarithmic"] == pytest.approx(1.0, rel=1e-6)
    assert other["error"] < 1e-6 * other["derivative"]
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["scalar"] for row in rows] == ["probes.valve.acceleration.largest", "frequency.1"]


@pytest.mark.parametrize(
    ("names", "fixed", "said"),
    [
        (("limits.loss_of_contact",), (), "A limit is the result of a search"),
        (("contacts.intake.open_on_the_lift",), (), "It counts events or instants"),
        (("contacts.intake.force.largest",), ("--set", "fidelity.modes=5"), "The model is reduced"),
        (("contacts.intake.force.largest",), ("--set", "run.integrator={ method = 'bathe' }"), "newmark"),
    ],
    ids=["limit", "count", "modes", "integrator"],
)
def test_what_exact_derivatives_do_not_cover_is_refused(flexcam, names, fixed, said):
    asked = [word for name in names for word in ("--of", name)]
    done = flexcam("sensitivity", ENGINE, *asked, "--to", "springs.valve.stiffness", "--method", "exact", *fixed)
    assert done.code == 2
    assert said in done.err
    assert "Use --method differences" in done.err


@pytest.mark.slow
def test_a_chaotic_run_has_no_derivative(flexcam):
    few = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=360")
    args = ("--of", "contacts.seat.seating_velocity", "--to", "springs.valve.stiffness")
    done = flexcam("sensitivity", ENGINE, *args, *few, "--json")
    (found,) = done.json["derivatives"]
    assert found["derivative"] is None
    assert not found["smooth"]
    assert "the motion is chaotic" in found["note"]


@pytest.mark.slow
def test_a_search_by_gradients_through_chaos_is_refused(flexcam):
    few = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=360")
    search = ("--vary", "springs.valve.stiffness=40:60kN/m", "--least", "contacts.seat.seating_velocity",
              "--method", "gradient")  # fmt: skip
    refused = flexcam("optimize", ENGINE, *search, *few)
    assert refused.code == 2
    assert "The motion is chaotic" in " ".join(refused.err.split())


def test_static_results_and_multipliers(flexcam):
    """The force of an installed spring; multipliers that meet at the edge of a tongue have no slope there."""
    asked = ("--of", "static.springs.valve.force", "--to", "springs.valve.installed_force")
    (found,) = flexcam("sensitivity", ENGINE, *asked, "--json").json["derivatives"]
    assert found["derivative"] == pytest.approx(found["value"] / found["key_value"], rel=1e-9)
    meets = ("--of", "multiplier.1", "--to", "springs.mean.stiffness", "--set", "springs.mean.pulsation.amplitude=1e-4")
    (found,) = flexcam("sensitivity", MATHIEU, *meets, "--json").json["derivatives"]
    assert not found["smooth"]
    fast = ("--set", "run.speed=12000rpm", "--set", "run.steps_per_revolution=360")  # it hops
    refused = flexcam("sensitivity", FOLLOWER, "--of", "multiplier.1", "--to", "springs.one.stiffness", *fast)
    assert refused.code == 3
    assert "no periodic motion was found" in refused.err
    done = flexcam("sensitivity", MATHIEU, "--of", "multiplier.3", "--to", "springs.mean.stiffness")
    assert "expected multiplier.1 to multiplier.2" in done.err


@pytest.mark.slow
def test_a_search_by_gradients_keeps_a_motion_stable(flexcam):
    """The largest pulsation within a bound on the largest multiplier."""
    args = ("--vary", "springs.mean.pulsation.amplitude=0.05:0.4", "--most", "springs.mean.pulsation.amplitude",
            "--subject", "multiplier.1 <= 1.2", "--method", "gradient", "--evaluations", "8")  # fmt: skip
    found = flexcam("optimize", MATHIEU, *args, "--json").json["best"]["values"]
    assert found["multiplier.1"] == pytest.approx(1.2, rel=1e-4)


@pytest.mark.slow
def test_a_goal_over_a_band_of_speeds(flexcam):
    """The rms acceleration at the worst of several speeds, which a range names; workers give the same."""
    quiet = ("--least", "probes.valve.acceleration.rms", "--vary", "springs.valve.damping=1:40N s/m", *QUICK)
    band = ("--at", "run.speed=1000:3000:2000rpm", "--method", "gradient", "--evaluations", "4")
    alone, shared = (
        flexcam("optimize", PUBLISHED, *quiet, *band, *more, "--json").json for more in ((), ("--workers", "2"))
    )
    assert alone == shared
    best = alone["best"]
    each = []
    for rpm in (1000, 3000):
        fixed = [word for one in (*best["overrides"], f"run.speed={rpm}rpm") for word in ("--set", one)]
        asked = ("--of", "probes.valve.acceleration.rms", "--to", "springs.valve.damping", *fixed, *QUICK)
        each.append(flexcam("sensitivity", PUBLISHED, *asked, "--json").json["derivatives"][0]["value"])
    assert best["values"]["probes.valve.acceleration.rms"] == pytest.approx(max(each), rel=1e-9)


def test_goal_without_slope(flexcam):
    """A speed that does not vary has a slope of zero; a contact is not the reason."""
    args = ("--most", "run.speed", "--vary", "springs.valve.damping=1:40N s/m", *QUICK)
    found = flexcam("optimize", PUBLISHED, *args, "--method", "gradient", "--evaluations", "2").out
    assert "no varied value changes run.speed. Vary a value" in " ".join(found.split())


def test_table_and_picture_of_derivatives(flexcam, tmp_path):
    args = ("--of", "frequency.1", "--to", "masses.valve.mass", "--plot", tmp_path / "s.svg")
    done = flexcam("sensitivity", PUBLISHED, *args)
    assert done.code == 0
    assert re.search(r"masses.valve.mass .* exact ", done.out)
    assert (tmp_path / "s.svg").read_text(encoding="utf-8").count("<path") > 5


@pytest.mark.slow
def test_sobol_of_a_frequency(flexcam, oscillator, tmp_path):
    """Over small even intervals f is linear: shares by (1/2 df/f)^2, here 4 : 1. 0.06: the estimator at 64 points."""
    args = ("--to", "springs.one.stiffness=39.2:40.8kN/m", "--to", "masses.one.mass=99:101g", "--sobol", "64")
    found = flexcam(
        "sensitivity", oscillator, "--of", "frequency.1", *args, "--plot", tmp_path / "s.svg", "--json"
    ).json
    one = found["sobol"]["frequency.1"]
    f = OMEGA / (2.0 * math.pi)
    variance = (0.5 * f) ** 2 * (0.02**2 + 0.01**2) / 3.0
    assert one["variance"] == pytest.approx(variance, rel=0.05)
    totals = [row["total"] for row in one["indices"]]
    assert totals == pytest.approx([0.8, 0.2], abs=0.06)
    for row in one["indices"]:
        assert row["total_low"] <= row["total"] <= row["total_high"]
    args = (*args[:-1], "8")
    assert "first order" in flexcam("sensitivity", oscillator, "--of", "frequency.1", *args).out


def test_scatter_of_a_frequency(flexcam, oscillator, tmp_path):
    """Linear: std(f) = f/2 hypot(0.05/sqrt 3, 0.06/3); five percent of it, what a hypercube of 64 leaves."""
    table = tmp_path / "parts.csv"
    args = ("--tolerance", "springs.one.stiffness=±5%", "--tolerance", "masses.one.mass=normal:±6g", "--count", "64")
    files = ("--csv", table, "--plot", tmp_path / "s.png")
    done = flexcam("sensitivity", oscillator, "--of", "frequency.1", *args, *files, "--json").json
    one, f = done["scatter"]["frequency.1"], OMEGA / (2.0 * math.pi)
    assert one["std"] == pytest.approx(0.5 * f * math.hypot(0.05 / math.sqrt(3.0), 0.06 / 3.0), rel=0.05)
    assert one["mean"] == pytest.approx(f, rel=2e-3)
    assert one["rank_correlation"]["springs.one.stiffness"] > 0.5
    assert one["rank_correlation"]["masses.one.mass"] < -0.3
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 64
    for row in rows:  # every set of parts is evaluated with its own numbers
        own = math.sqrt(float(row["springs.one.stiffness"]) / float(row["masses.one.mass"])) / (2.0 * math.pi)
        assert float(row["frequency.1"]) == pytest.approx(own, rel=1e-9)
    args = (*args[:-1], "8")
    assert "Rank correlation" in flexcam("sensitivity", oscillator, "--of", "frequency.1", *args).out


def test_lightest_spring_for_a_frequency(flexcam, oscillator, tmp_path):
    """Least k with f >= 110 Hz: k = m (2 pi f)^2, at the bound; the file of the best is a case that has it."""
    best, table = tmp_path / "best.toml", tmp_path / "all.csv"
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "80")  # fmt: skip
    done = flexcam("optimize", oscillator, *args, "-o", best, "--csv", table, "--plot", tmp_path / "p.svg", "--json")
    assert done.code == 0
    assert done.json["files"] == [str(one) for one in (table, tmp_path / "p.svg", best)]
    wanted = 0.1 * (2.0 * math.pi * 110.0) ** 2
    assert done.json["best"]["values"]["springs.one.stiffness"] == pytest.approx(wanted, rel=2e-4)
    assert done.json["best"]["bounds"][0]["active"]
    assert done.json["best"]["bounds"][0]["slack"] >= -1e-9
    one = modes(read_case(best)).modes
    assert one.frequencies[0] == pytest.approx(110.0, rel=1e-4)
    (override,) = done.json["best"]["overrides"]
    assert modes(read_case(oscillator, [override])).modes.frequencies[0] == one.frequencies[0]
    assert len(table.read_text(encoding="utf-8").splitlines()) == done.json["evaluations"] + 1
    again = flexcam("optimize", oscillator, *args, "--json").json
    assert again["best"] == done.json["best"]
    assert flexcam("optimize", oscillator, *args, "-o", best).code == 2  # it is there


def test_a_search_by_gradients_takes_few_runs(flexcam, oscillator, tmp_path):
    """The same least spring in a twentieth of the runs; the goal is a number of the case, the bound a frequency."""
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--method", "gradient")  # fmt: skip
    found = flexcam("optimize", oscillator, *args, "--starts", "2", "-o", tmp_path / "best.toml", "--json").json
    wanted = 0.1 * (2.0 * math.pi * 110.0) ** 2
    assert found["best"]["bounds"][0]["outside"] == 0.0, "any softer spring violates it"
    assert found["best"]["values"]["springs.one.stiffness"] == pytest.approx(wanted, rel=1e-5)
    assert found["evaluations"] < 40
    assert flexcam("optimize", oscillator, *args, "--starts", "0").code == 2
    assert flexcam("optimize", oscillator, *args[:-2], "--starts", "2").code == 2
    bare = flexcam("optimize", oscillator, "--vary", "springs.one.stiffness=20e3:80e3", *args[2:])
    assert "got numbers without a unit, expected numbers with a unit, as in '40 kN/m'" in bare.err


def test_bounds_at_zero_have_no_relative_margin(flexcam, oscillator):
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--evaluations", "24")
    lines = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 >= 0").out.splitlines()
    (row,) = (line for line in lines if line.startswith("frequency.1"))
    assert row.split()[-3:] == ["met", "none", "found"]
    bare = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 >= 110")
    assert bare.code == 2
    assert "Add the unit, such as Hz" in bare.err


@pytest.mark.slow
def test_events_of_the_best_variant_are_warned_of(flexcam, one_mass):
    """The softest spring has the smallest force, and the follower leaves its cam at the higher speed."""
    asked = ("--vary", "springs.held.stiffness=20:42kN/m", "--least", "springs.held.force.largest")
    quick = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=180", "--evaluations", "24")
    found = flexcam("optimize", one_mass(), *asked, *quick, "--at", "run.speed=1000,4500rpm", "--json").json
    (said,) = found["warnings"]
    assert "the best variant at run.speed=4500rpm: the follower of 'k' loses contact" in said


@pytest.mark.parametrize("method", [pytest.param("evolution", marks=pytest.mark.slow), "gradient"])
def test_a_result_over_several_conditions_is_the_worst(flexcam, oscillator, method):
    """Least stiffness with f >= 110 Hz for three masses: the heaviest rules."""
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "60",
            "--at", "masses.one.mass=80:120:20g")  # fmt: skip
    found = flexcam("optimize", oscillator, *args, "--method", method, "--json").json["best"]["values"]
    assert found["springs.one.stiffness"] == pytest.approx(0.12 * (2.0 * math.pi * 110.0) ** 2, rel=1e-3)
    assert found["frequency.1"] == pytest.approx(110.0, rel=1e-3)
    twice = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 <= 120 Hz", "--method", method)
    assert twice.code == 2
    assert "an upper and a lower goal" in twice.err
    for wrong, said in (
        ("springs.one.stiffness=30:40:10kN/m", "does not name"), ("masses.one.mass=80g", "several values"),
        ("masses.one.mas=80:120:20g", "Did you mean 'mass'"), ("masses.one.mass=0.08,0.12", "numbers without a unit"),
    ):  # fmt: skip
        refused = flexcam("optimize", oscillator, *args[:-1], wrong, "--method", method)
        assert refused.code == 2
        assert said in refused.err


@pytest.mark.parametrize(("method", "said"), [
    ("evolution", "infeasible: no variant meets all constraints; widen"), ("gradient", "from this start; start at"),
])  # fmt: skip
def test_a_search_without_a_valid_variant_says_what_it_knows(flexcam, oscillator, method, said):
    """A gradient search follows one path: its end does not show that no variant exists."""
    asked = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--evaluations", "24")
    done = flexcam("optimize", oscillator, *asked, "--subject", "frequency.1 >= 1000 Hz", "--method", method)
    assert done.code == 3
    assert said in " ".join(done.err.split())


def test_a_variant_without_derivatives_keeps_its_values(monkeypatch):
    """A search refuses a start without derivatives with this reason, and may end at such a variant."""

    def broken(*_given):
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, "the forces do not converge"))

    monkeypatch.setattr(gradients, "compute_gradient", broken)
    file, mass = CaseFile.open(Path(PUBLISHED)), Variable("masses.valve.mass", 0.05, 0.15, "kg")
    with gradients.gradient_evaluator(file, QUICK[1::2], ["frequency.1"], [mass]) as runs:
        (row,) = runs([()])
    assert row.status.ok
    assert "the forces do not converge" in row.status.text
    assert (set(row.scalars), row.derivatives) == ({"frequency.1"}, {})


@pytest.mark.slow
def test_a_search_by_gradients_ends_at_the_end_of_the_permitted_values(flexcam):
    """Damping has no negative values: at its bound a derivative takes one side."""
    args = ("--set", "springs.valve.damping=0", "--vary", "springs.valve.damping=0:4N s/m", "--method", "gradient",
            "--least", "probes.valve.displacement.largest", "--evaluations", "4", *QUICK)  # fmt: skip
    done = flexcam("optimize", PUBLISHED, *args, "--json")
    assert done.code == 0
    assert done.json["evaluations"] > 1


def test_a_varied_speed_is_shown_in_rpm(flexcam, oscillator):
    asked = ("--vary", "run.speed=900:1100rpm", "--most", "run.speed", "--subject", "run.speed <= 1050 rpm")
    shown = flexcam("optimize", oscillator, *asked, "--set", "run.steps_per_revolution=90", "--evaluations", "24").out
    assert "rad/s" not in shown
    (best,) = [line.split()[2:] for line in shown.splitlines() if line.startswith("max run.speed")]
    assert float(best[0]) == pytest.approx(1050.0, rel=0.05)
    assert best[1] == "rpm"


@pytest.mark.slow
def test_a_search_by_gradients_through_contact(flexcam):
    """Most speed at which the contact on the nose keeps a force: every variant is better or corrects the last one."""
    args = ("--vary", "run.crank_speed=4500:6500rpm", "--vary", "springs.valve.installed_force=300:500N",
            "--most", "run.crank_speed", "--subject", "contacts.intake.nose_force.least >= 150 N",
            "--subject", "springs.valve.stress.largest <= 0.86 GPa", "--method", "gradient")  # fmt: skip
    fixed = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=720", "--evaluations", "5")
    found = flexcam("optimize", ENGINE, *args, *fixed, "--json").json
    values = found["best"]["values"]
    assert found["evaluations"] <= 5
    assert values["run.crank_speed"] > 5080.0 * 2.0 * math.pi / 60.0
    assert values["contacts.intake.nose_force.least"] >= 150.0
    assert values["springs.valve.stress.largest"] == pytest.approx(0.86e9, rel=1e-3)


def test_the_table_has_no_digits_that_say_nothing(flexcam, oscillator, tmp_path):
    """Six, as in other tables, as an override that can be copied; JSON has every digit."""
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "24")  # fmt: skip
    (whole,) = flexcam("optimize", oscillator, *args, "--json").json["best"]["overrides"]
    key, _, value = whole.partition("=")
    digits = value.removesuffix("kN/m")
    assert len(digits) > 10
    shown = flexcam("optimize", oscillator, *args).out
    row = next(line for line in shown.splitlines() if f"--set {key}" in line)
    (told_value,) = re.findall(r"[\d.]+(?=kN/m)", row)
    assert told_value == f"{float(digits):.6g}"


def test_the_best_of_a_case_with_a_mesh_can_be_run(flexcam, tmp_path):
    """The mesh is named from the other folder, and no nodes stand beside it."""
    args = ("--vary", "cams.intake.rise=60:90deg", "--least", "cams.intake.deceleration", "--evaluations", "24")
    best = tmp_path / "deep" / "best.toml"
    assert flexcam("optimize", PUBLISHED, *args, "-o", best).code == 0
    assert flexcam("check", best).code == 0


@pytest.mark.slow
def test_fullest_lift_with_a_given_acceleration(flexcam):
    """Least deceleration of a lift is that of the widest cam; numbers in lists are varied too."""
    law = 'cams.intake.law={id="bspline",coefficients=[0.0,0.0,0.0,0.1,0.5,0.9,1.0,1.0,1.0]}'
    args = ("--set", law, "--vary", "cams.intake.law.coefficients.3=0.0:0.3", "--least", "cams.intake.deceleration",
            "--subject", "cams.intake.area >= 0.0091", "--evaluations", "40")  # fmt: skip
    found = flexcam("optimize", ENGINE, *args, "--json").json
    (override,) = found["best"]["overrides"]
    assert override.startswith("cams.intake.law.coefficients=[0.0, 0.0, 0.0, ")
    assert found["best"]["values"]["cams.intake.deceleration"] < 0.0188  # that of 0.1
    assert found["best"]["values"]["cams.intake.area"] >= 0.0091


def test_nothing_within_the_bounds(flexcam, oscillator, tmp_path):
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 1 kHz", "--evaluations", "24", "-o", tmp_path / "best.toml")  # fmt: skip
    done = flexcam("optimize", oscillator, *args)
    assert done.code == 3
    assert "no variant" in done.err
    assert "violated by" in done.out
    assert not (tmp_path / "best.toml").exists()


@pytest.mark.parametrize("last", [5, 17, 33])  # in the first generation, in the second, in the trust region
def test_what_a_stopped_search_has_evaluated_is_kept(last, flexcam, oscillator, tmp_path, stop_after):
    """Each may have taken minutes; the best of them and the table are told as after a whole search."""
    stop_after(last)
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--evaluations", "40", "--subject", "frequency.1 >= 30 Hz",
            "-o", tmp_path / "best.toml", "--csv", tmp_path / "all.csv")  # fmt: skip
    done = flexcam("optimize", oscillator, *args, "--json")
    assert done.code == 130
    assert f"stopped after {last} of about 40 variants" in done.err
    assert done.json["status"] == "interrupted"
    assert done.json["evaluations"] == last
    assert len((tmp_path / "all.csv").read_text().splitlines()) == 1 + last
    assert (tmp_path / "best.toml").exists()


def test_a_study_reads_a_case_that_changed(oscillator):
    def frequency():
        with create_evaluator(CaseFile.open(oscillator), (), ["frequency.1"]) as run:
            return next(iter(run([()]))).scalars["frequency.1"]

    before = frequency()
    oscillator.write_text(OSCILLATOR.replace('"0.1 kg"', '"0.4 kg"'), encoding="utf-8")
    assert frequency() == pytest.approx(0.5 * before)


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_a_study_nothing(oscillator):
    """The variants that it had begun are evaluated again."""
    killed = []

    def kill(count):
        if not killed:
            process = next(p for p in multiprocessing.active_children() if p.name.startswith("SpawnProcess"))
            killed.append(process.pid)
            os.kill(process.pid, signal.SIGKILL)

    variants = [(f"springs.one.stiffness={k} kN/m",) for k in range(20, 60)]
    file = CaseFile.open(oscillator)
    with create_evaluator(file, (), ["frequency.1"], workers=2, advance=kill) as run:
        found = [*run(variants), *run(variants[:2])]  # workers remain between calls, or new ones take their place
    with create_evaluator(file, (), ["frequency.1"]) as run:
        alone = list(run(variants))
    assert killed
    assert [row.scalars for row in found] == [row.scalars for row in [*alone, *alone[:2]]]


STUDIES = {
    "derivatives": (
        "sensitivity",
        "--of",
        "probes.valve.acceleration.largest",
        "--to",
        "cams.intake.lift",
        *QUICK,
        "--method",
        "differences",
    ),
    "shares": ("sensitivity", "--of", "frequency.1", "--to", "springs.one.stiffness=20:80kN/m", "--sobol", "8"),
    "scatter": ("sensitivity", "--of", "frequency.1", "--tolerance", "springs.one.stiffness=±5%", "--count", "20"),
}


@pytest.mark.parametrize("kind", STUDIES)
@pytest.mark.parametrize("last", mostly_slow([0, 3, 7]))
def test_what_a_stopped_study_has_evaluated_is_kept(kind, last, flexcam, oscillator, tmp_path, stop_after):
    """Of derivatives the case as it stands, of shares whole base points, two at least, of scatter every set."""
    stop_after(last)
    command, *told = STUDIES[kind]
    case = PUBLISHED if kind == "derivatives" else oscillator
    done = flexcam(command, case, *told, "--csv", tmp_path / "all.csv", "--json")
    if kind == "derivatives" and last == 7:  # all five are finished
        assert (done.code, done.json["status"]) == (0, "ok")
        return
    assert done.code == 130
    kept = last > 0 and (kind, last) != ("shares", 3)
    assert (tmp_path / "all.csv").exists() == kept
    assert ("nothing is kept" in done.err) != kept
    if kept:
        assert done.json["status"] == "interrupted"
        assert f"stopped after {last} of" in done.err
    if kept and kind == "scatter":
        assert done.json["scatter"]["frequency.1"]["count"] == last


def test_a_stopped_map_has_gaps(flexcam, tmp_path, monkeypatch):
    rows = [Row(Status(), {"limits.buckling": 600.0}, {"limits.buckling": "rpm"})]

    def stopping(*_, **named):
        if not rows:
            raise KeyboardInterrupt
        return rows.pop()

    monkeypatch.setattr("flexcam.studies.quantities.quantity_row", stopping)
    args = ("--over", "springs.valve.stiffness=45,65kN/m", "--and", "springs.valve.installed_force=300,500N")
    done = flexcam("limits", ENGINE, *args, "--limit", "buckling", "--csv", tmp_path / "map.csv", "--json")
    assert (done.code, done.json["status"]) == (130, "interrupted")
    assert done.json["statuses"] == ["done", *["interrupted"] * 3]
    assert done.json["limits_rpm"]["buckling"] == [[600.0, None], [None, None]]
    assert len((tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()) == 5


def test_a_search_stopped_before_its_first_variant(flexcam, oscillator, tmp_path, monkeypatch):
    def stopping(*_, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr("flexcam.studies.quantities.quantity_row", stopping)
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness")
    done = flexcam("optimize", oscillator, *args, "--csv", tmp_path / "all.csv")
    assert done.code == 130
    assert "nothing is kept" in done.err
    assert not (tmp_path / "all.csv").exists()


@pytest.mark.slow
def test_front_of_two_goals(flexcam, oscillator, tmp_path):
    """Soft against fast: every stiffness is on the front, and along it one grows with the other."""
    pytest.importorskip("pymoo")
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--most", "frequency.1")
    files = ("--plot", tmp_path / "f.svg", "--csv", tmp_path / "f.csv")
    found = flexcam("optimize", oscillator, *args, "--evaluations", "96", *files, "--json").json["front"]
    k, f = ([one["values"][name] for one in found] for name in ("springs.one.stiffness", "frequency.1"))
    assert len(k) > 30
    assert k == sorted(k)
    assert f == sorted(f)


def test_scatter_of_a_stiffness_in_its_own_unit(flexcam, oscillator):
    args = ("--of", "frequency.1", "--tolerance", "springs.one.stiffness=±2kN/m", "--count", "8", "--json")
    relative = (*args[:3], "springs.one.stiffness=±5%", *args[4:])
    assert flexcam("sensitivity", oscillator, *args).json == flexcam("sensitivity", oscillator, *relative).json


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (ENGINE, ("sensitivity", "--of", "limits.bounce", "--of", "contacts.intake.force.larges", "--to", "a.b")),
        (PUBLISHED, ("sensitivity", "--of", "deviation.peek", "--to", "masses.valve.mass")),
        (ENGINE, ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "limits.bounc")),
        (ENGINE, ("optimize", "--vary", "masses.valve.mass=80:90g", "--most", "cams.intake.are")),
    ],
)  # fmt: skip
def test_names_are_refused_before_anything_runs(flexcam, path, words, monkeypatch):
    def never(*_):
        pytest.fail("something was run")

    for what in ("evaluate", "find_limits"):
        monkeypatch.setattr(sys.modules["flexcam.studies.quantities"], what, never)
    refused = flexcam(words[0], path, *words[1:])
    assert refused.code == 2
    assert refused.err.startswith(("--of: ", "--least, --most or --subject: "))
    assert "Did you mean" in refused.err


@pytest.mark.slow
def test_runs_on_several_processes_are_the_same(flexcam, oscillator):
    args = (
        "--of",
        "frequency.1",
        "--of",
        "energy.residual.largest",
        "--tolerance",
        "masses.one.mass=±5%",
        "--count",
        "8",
    )
    one, two = (
        flexcam("sensitivity", oscillator, *args, *QUICK, "--workers", n, "--json").json["scatter"] for n in ("1", "2")
    )
    assert one == two


REFUSED = {
    "no such key": ("sensitivity", "--of", "frequency.1", "--to", "springs.valve.stifness"),
    "a word": ("sensitivity", "--of", "frequency.1", "--to", "run.start"),
    "a whole number": ("sensitivity", "--of", "frequency.1", "--to", "members.camshaft.elements"),
    "zero": ("sensitivity", "--of", "frequency.1", "--to", "run.damping.beta"),
    "no such scalar": ("sensitivity", "--of", "nosuch", "--to", "springs.valve.stiffness"),
    "no such frequency": ("sensitivity", "--of", "frequency.900", "--to", "springs.valve.stiffness"),
    "no such limit": ("sensitivity", "--of", "limits.nosuch", "--to", "springs.valve.stiffness"),
    "limits of another contact": ("sensitivity", "--of", "limits.bounce", "--to", "springs.valve.stiffness"),
    "nothing to vary": ("sensitivity", "--of", "frequency.1"),
    "a step too long": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass", "--relative-step", "2"),
    "an interval missing": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass", "--sobol", "8"),
    "no power of two": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass=80:90g", "--sobol", "9"),
    "a falling interval": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass=90:80g", "--sobol", "8"),
    "no width": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±0%"),
    "no scatter": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=5"),
    "other unit": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±5mm"),
    "more than all of it": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±150%"),
    "too wide a normal": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=normal:±70%"),
    "a part that cannot be": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±5kg"),
    "too few": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±5%", "--count", "3"),
    "ignored": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass", "--count", "20"),
    "speeds of no limit": ("sensitivity", "--of", "frequency.1", "--to", "masses.valve.mass", "--lowest", "100rpm"),
    "no goal": ("optimize", "--vary", "masses.valve.mass=80:90g"),
    "three goals": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "a", "--least", "b", "--most", "c"),
    "no bound": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--subject", "x"),
    "twice": ("optimize", "--vary", "masses.valve.mass=80:90g", "--vary", "masses.valve.mass=80:90g", "--least", "x"),
    "few runs": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--evaluations", "3"),
    "unit of a bound": (
        "optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--subject", "frequency.1 <= 3 mm"
    ),
    "no case file": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "-o", "best.csv"),
    "no workers": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--workers", "0"),
    "an interval of lengths": ("optimize", "--vary", "masses.valve.mass=0.1:0.3m", "--least", "deviation.peak"),
    "half a map": ("limits", "--over", "masses.valve.mass=80,90g"),
    "one value": ("limits", "--over", "masses.valve.mass=80,90g", "--and", "springs.valve.stiffness=40kN/m"),
    "the same": ("limits", "--over", "masses.valve.mass=80,90g", "--and", "masses.valve.mass=80,90g"),
    "a map of no contact": (
        "limits", "--over", "masses.valve.mass=80,90g", "--and", "springs.valve.stiffness=40,50kN/m"
    ),
    "a map of nothing": ("limits", "--over", "masses.nosuch.mass=80,90g", "--and", "springs.valve.stiffness=4,5kN/m"),
}  # fmt: skip


@pytest.mark.slow
def test_the_best_is_no_worse_than_the_case_as_it_stands(flexcam):
    """The case stands at an end of the interval, where the deviation is least; a generation alone misses it."""
    args = ("--vary", "masses.valve.mass=0.1:0.3kg", "--least", "deviation.peak", "--evaluations", "24", "--json")
    found = flexcam("optimize", PUBLISHED, *QUICK, *args).json
    assert found["best"]["overrides"] == ["masses.valve.mass=0.1kg"]


@pytest.mark.parametrize("what", mostly_slow(REFUSED, 2))
def test_refusals(flexcam, what):
    command, *told = REFUSED[what]
    done = flexcam(command, PUBLISHED, *QUICK, *told)
    assert done.code == 2, done.out + done.err
    assert "expected" in done.err or "Leave it out" in done.err


def test_an_interval_without_sobol(flexcam):
    done = flexcam("sensitivity", PUBLISHED, "--of", "frequency.1", "--to", "masses.valve.mass=80:90g")
    assert done.code == 2
    assert "Only --sobol has intervals" in done.err


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_study_on_processes_ends_when_it_is_told(number, code, tmp_path):
    """With thousands of variants still to do, and no process left behind."""
    args = ("--of", "contacts.intake.force.largest", "--tolerance", "springs.valve.stiffness=±5%", "--count", "4000")
    words = [sys.executable, "-m", "flexcam", "sensitivity", str(ENGINE), *args, "--workers", "2"]
    restored = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=restored
    )
    time.sleep(8.0)
    process.send_signal(number)
    try:
        _, err = process.communicate(timeout=20)  # pipes close when the last process that holds them ends
    finally:
        process.kill()
    assert process.returncode == code
    assert "interrupted" in err
    assert "Traceback" not in err


@pytest.mark.slow
def test_map_of_limits(flexcam, tmp_path):
    """A stiffer spring holds the cam longer; each cell is what the command finds for that case alone."""
    table, picture = tmp_path / "map.csv", tmp_path / "map.svg"
    where = (
        "--lowest",
        "5000rpm",
        "--highest",
        "8000rpm",
        "--accuracy",
        "200rpm",
        "--set",
        "run.steps_per_revolution=1440",
    )
    args = ("--over", "springs.valve.stiffness=45,65kN/m", "--and", "springs.valve.installed_force=300,500N")
    found = flexcam("limits", ENGINE, *where, *args, "--csv", table, "--plot", picture, "--workers", "2", "--json").json
    rpm = found["limits_rpm"]["loss_of_contact"]
    assert rpm[0][0] < rpm[1][1]
    alone = flexcam("limits", ENGINE, *where, "--set", "springs.valve.stiffness=65kN/m",
                    "--set", "springs.valve.installed_force=500N", "--json").json  # fmt: skip
    assert rpm[1][1] == pytest.approx(alone["loss_of_contact_rpm"])
    assert len(table.read_text(encoding="utf-8").splitlines()) == 5
    assert picture.read_text(encoding="utf-8").count("<path") > 5


def test_a_variant_is_run_as_one_of_as_many_as_are_asked_for(flexcam, monkeypatch):
    """Machine code pays for ninety runs of 2 880 steps, though not for one: a search took fifteen times as long."""
    quantities = sys.modules["flexcam.studies.quantities"]
    asked, whole = [], quantities.evaluate
    monkeypatch.setattr(quantities, "evaluate", lambda case, runs, **o: asked.append(runs) or whole(case, **o))
    args = ("--tolerance", "springs.valve.stiffness=±5%", "--of", "deviation.peak", "--count", "9")
    assert flexcam("sensitivity", PUBLISHED, *args, *QUICK).code == 0
    assert asked == [9] * 10


def test_limits_are_looked_for_as_one_of_many_variants(flexcam, monkeypatch):
    asked = []
    limits = sys.modules["flexcam.studies.quantities"]
    monkeypatch.setattr(limits, "find_limits", lambda *_, runs: asked.append(runs) or Limits({}, 0.0, 0.0))
    args = ("--over", "springs.valve.stiffness=45,65kN/m", "--and", "springs.valve.installed_force=300,500N")
    flexcam("limits", ENGINE, *args)
    assert asked == [4, 4, 4, 4]


@pytest.mark.parametrize(
    "words",
    [
        ("sensitivity", "--of", "frequency.1", "--tolerance", "springs.one.stiffness=±5%"),
        ("sensitivity", "--of", "frequency.1", "--to", "springs.one.stiffness=20:80kN/m", "--sobol", "8"),
        ("optimize", "--vary", "springs.one.stiffness=20:80kN/m", "--least", "frequency.1"),
        ("optimize", "--vary", "springs.one.stiffness=2:8kN/m", "--least", "frequency.1", "--most", "masses.one.mass"),
    ],
)  # fmt: skip
def test_a_seed_below_zero_is_refused(words, flexcam, oscillator):
    """Generators of random numbers raise an error of their own."""
    done = flexcam(words[0], oscillator, *words[1:], "--seed", "-3")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("--seed: got -3, expected a whole number, at least 0")


def test_a_seed_of_derivatives_is_refused(flexcam, oscillator):
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--seed", "1")
    done = flexcam("sensitivity", oscillator, *args)
    assert (done.code, done.err.partition(":")[0]) == (2, "--seed")


def test_a_part_that_scatters_twice_is_refused(flexcam, oscillator):
    """The second one alone would count, and a rank correlation would be told of the first."""
    args = ("--tolerance", "springs.one.stiffness=±5%", "--tolerance", "springs.one.stiffness=normal:±1%")
    done = flexcam("sensitivity", oscillator, "--of", "frequency.1", *args)
    assert done.code == 2
    assert done.err.startswith("--tolerance: got 'springs.one.stiffness', expected every key once")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--lowest", "9000rpm", "--highest", "8000rpm"), "--highest: got 8000rpm, expected a speed above the lowest"),
        (("--lowest", "12000rpm"), "--highest: got 10000 rpm, 2 times that of the case, expected"),
        (("--lowest", "0rpm"), "--lowest: got 0rpm, expected a speed above zero"),
        (("--accuracy", "0rpm"), "--accuracy: got 0rpm, expected a speed above zero"),
    ],
)  # fmt: skip
def test_speeds_of_limits_are_told_as_they_were_given(words, told, flexcam):
    """In turns of the crankshaft, as the case has them, and by the option that gives them."""
    done = flexcam("sensitivity", ENGINE, "--of", "limits.bounce", "--to", "masses.valve.mass", *words)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(told)


def test_a_bracket_of_no_width_is_refused_by_its_option(flexcam):
    done = flexcam("limits", ENGINE, "--accuracy", "0rpm")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("--accuracy: got 0rpm, expected a speed above zero")


def test_a_limit_that_no_case_has_is_no_lacking_part(flexcam):
    done = flexcam("sensitivity", ENGINE, "--of", "limits.bounc", "--to", "masses.valve.mass")
    assert done.code == 2
    assert "There is no such limit. Did you mean 'limits.bounce'?" in done.err


def test_a_study_evaluates_the_case_that_it_read(tmp_path):
    """An edit of the file during the study does not reach its variants."""
    path = tmp_path / "case.toml"
    text = (ROOT / "cases/checks/mathieu.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    file = CaseFile.open(path)
    before = list(create_once(file))
    path.write_text("format = 2", encoding="utf-8")
    assert list(create_once(file)) == before


def create_once(file):
    with create_evaluator(file, (), ["frequency.1"]) as runs:
        yield from (row.scalars for row in runs([("run.speed=900rpm",)]))
