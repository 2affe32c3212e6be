"""Commands of design studies: sensitivity, optimize and maps of limits; closed forms on the published model."""

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
    """Return a function that interrupts a study after the given number of variants."""

    def stop(count):
        evaluated = []

        def interrupt_after_count(*words, **named):
            if len(evaluated) == count:
                raise KeyboardInterrupt
            evaluated.append(words)
            return quantity_row(*words, **named)

        monkeypatch.setattr("flexcam.studies.quantities.quantity_row", interrupt_after_count)

    return stop


def test_frequency_derivatives_of_oscillator(flexcam, oscillator):
    """Closed form: df/dk = f/(2 k), df/dm = -f/(2 m), thus 0.5 % per 1 %."""
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--to", "masses.one.mass")
    by_k, by_m = flexcam("sensitivity", oscillator, *args, "--json").json["derivatives"]
    f = OMEGA / (2.0 * math.pi)
    assert by_k["value"] == pytest.approx(f, rel=1e-12)
    assert by_k["derivative"] == pytest.approx(f / (2.0 * 40e3), rel=1e-9)
    assert by_m["derivative"] == pytest.approx(-f / (2.0 * 0.1), rel=1e-9)
    assert (by_k["logarithmic"], by_m["logarithmic"]) == pytest.approx((0.5, -0.5), rel=1e-9)
    assert by_k["analytic"]


def test_sensitivity_names_mode_and_values_without_effect(flexcam, oscillator):
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--to", "run.speed")
    output = " ".join(flexcam("sensitivity", oscillator, *args).out.split())
    assert "frequency.1 does not depend on run.speed Frequencies are" in output
    assert "with all contacts open. frequency.1: mass one 100 %" in output
    sobol_args = ("--of", "frequency.1", "--to", "run.speed=1000:2000rpm", "--sobol", "4")
    assert "frequency.1 depends on none of these values" in flexcam("sensitivity", oscillator, *sobol_args).out


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
def test_unit_of_number_depends_on_its_table(oscillator, monkeypatch, path, key, unit):
    """Other keys of the table determine whether a stiffness is linear or angular."""
    monkeypatch.chdir(oscillator.parent)
    assert get_number(read_case(path), key, "--to").unit == unit


@pytest.mark.parametrize("key", ["rockers.rocker.arms.1", "materials.steel.E", "sections.tube.outer_diameter"])
def test_frequency_derivatives_match_finite_differences(flexcam, key):
    """Central differences with a step of 1e-4; tolerance 1e-6 for their error of third order and rounding."""
    found = flexcam("sensitivity", PUBLISHED, "--of", "frequency.2", "--to", key, "--json").json["derivatives"][0]
    case = read_case(PUBLISHED)
    at = found["key_value"]
    arms = [0.025, 0.040]

    def frequency(value):
        override = f"rockers.rocker.arms={[arms[0], value]}" if key.endswith("arms.1") else f"{key}={value!r}"
        result = modes(read_case(PUBLISHED, [override])).modes
        return float(result.frequencies[result.rigid :][1])

    assert case.overrides == ()
    step = 1e-4 * at
    differences = (frequency(at + step) - frequency(at - step)) / (2.0 * step)
    assert found["derivative"] == pytest.approx(differences, rel=1e-6)


@pytest.mark.slow
def test_linear_response_has_logarithmic_derivative_of_one(flexcam, tmp_path):
    """The published load is linear in the lift: 1 % per 1 %, analytic and by differences."""
    table = tmp_path / "s.csv"
    args = ("--of", "probes.valve.acceleration.largest", "--of", "frequency.1", "--to", "cams.intake.lift")
    report = flexcam("sensitivity", PUBLISHED, *args, *QUICK, "--csv", table, "--json").json
    response, frequency = report["derivatives"]
    assert response["smooth"]
    assert response["analytic"]
    assert response["logarithmic"] == pytest.approx(1.0, rel=1e-6)
    assert frequency["derivative"] == 0.0
    differences = flexcam("sensitivity", PUBLISHED, *args, *QUICK, "--method", "differences", "--json").json[
        "derivatives"
    ][0]
    assert differences["logarithmic"] == pytest.approx(1.0, rel=1e-6)
    assert differences["error"] < 1e-6 * differences["derivative"]
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["scalar"] for row in rows] == ["probes.valve.acceleration.largest", "frequency.1"]


@pytest.mark.parametrize(
    ("names", "fixed", "message"),
    [
        (("limits.loss_of_contact",), (), "A limit is the result of a search"),
        (("contacts.intake.open_on_the_lift",), (), "It counts events or instants"),
        (("contacts.intake.force.largest",), ("--set", "fidelity.modes=5"), "The model is reduced"),
        (("contacts.intake.force.largest",), ("--set", "run.integrator={ method = 'bathe' }"), "newmark"),
    ],
    ids=["limit", "count", "modes", "integrator"],
)
def test_exact_derivatives_refuse_unsupported_quantities(flexcam, names, fixed, message):
    options = [word for name in names for word in ("--of", name)]
    done = flexcam("sensitivity", ENGINE, *options, "--to", "springs.valve.stiffness", "--method", "exact", *fixed)
    assert done.code == 2
    assert message in done.err
    assert "Use --method differences" in done.err


@pytest.mark.slow
def test_chaotic_run_has_no_derivative(flexcam):
    few = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=360")
    args = ("--of", "contacts.seat.seating_velocity", "--to", "springs.valve.stiffness")
    done = flexcam("sensitivity", ENGINE, *args, *few, "--json")
    (found,) = done.json["derivatives"]
    assert found["derivative"] is None
    assert not found["smooth"]
    assert "the motion is chaotic" in found["note"]


@pytest.mark.slow
def test_gradient_search_refuses_chaotic_motion(flexcam):
    few = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=360")
    search = ("--vary", "springs.valve.stiffness=40:60kN/m", "--least", "contacts.seat.seating_velocity",
              "--method", "gradient")  # fmt: skip
    refused = flexcam("optimize", ENGINE, *search, *few)
    assert refused.code == 2
    assert "the motion is chaotic" in " ".join(refused.err.split())


def test_derivatives_of_static_force_and_multipliers(flexcam):
    """An installed spring force; multipliers that coincide at the edge of an instability region have no derivative."""
    options = ("--of", "static.springs.valve.force", "--to", "springs.valve.installed_force")
    (derivative,) = flexcam("sensitivity", ENGINE, *options, "--json").json["derivatives"]
    assert derivative["derivative"] == pytest.approx(derivative["value"] / derivative["key_value"], rel=1e-9)
    meets = ("--of", "multiplier.1", "--to", "springs.mean.stiffness", "--set", "springs.mean.pulsation.amplitude=1e-4")
    (derivative,) = flexcam("sensitivity", MATHIEU, *meets, "--json").json["derivatives"]
    assert not derivative["smooth"]
    fast = ("--set", "run.speed=12000rpm", "--set", "run.steps_per_revolution=360")  # contact is lost
    refused = flexcam("sensitivity", FOLLOWER, "--of", "multiplier.1", "--to", "springs.one.stiffness", *fast)
    assert refused.code == 3
    assert "no periodic motion was found" in refused.err
    done = flexcam("sensitivity", MATHIEU, "--of", "multiplier.3", "--to", "springs.mean.stiffness")
    assert "expected multiplier.1 to multiplier.2" in done.err


@pytest.mark.slow
def test_gradient_search_with_multiplier_bound(flexcam):
    """The maximum pulsation subject to a bound on the largest multiplier."""
    args = ("--vary", "springs.mean.pulsation.amplitude=0.05:0.4", "--most", "springs.mean.pulsation.amplitude",
            "--subject", "multiplier.1 <= 1.2", "--method", "gradient", "--evaluations", "8")  # fmt: skip
    found = flexcam("optimize", MATHIEU, *args, "--json").json["best"]["values"]
    assert found["multiplier.1"] == pytest.approx(1.2, rel=1e-4)


@pytest.mark.slow
def test_goal_over_speed_range(flexcam):
    """The goal is the maximum rms acceleration of several speeds, given as a range; workers give the same."""
    quiet = ("--least", "probes.valve.acceleration.rms", "--vary", "springs.valve.damping=1:40N s/m", *QUICK)
    band = ("--at", "run.speed=1000:3000:2000rpm", "--method", "gradient", "--evaluations", "4")
    alone, shared = (
        flexcam("optimize", PUBLISHED, *quiet, *band, *more, "--json").json for more in ((), ("--workers", "2"))
    )
    assert alone == shared
    best = alone["best"]
    values_at_speeds = []
    for rpm in (1000, 3000):
        fixed = [word for override in (*best["overrides"], f"run.speed={rpm}rpm") for word in ("--set", override)]
        options = ("--of", "probes.valve.acceleration.rms", "--to", "springs.valve.damping", *fixed, *QUICK)
        values_at_speeds.append(flexcam("sensitivity", PUBLISHED, *options, "--json").json["derivatives"][0]["value"])
    assert best["values"]["probes.valve.acceleration.rms"] == pytest.approx(max(values_at_speeds), rel=1e-9)


def test_gradient_search_of_constant_goal(flexcam):
    """A constant speed has a derivative of zero; the cause is not a contact."""
    args = ("--most", "run.speed", "--vary", "springs.valve.damping=1:40N s/m", *QUICK)
    found = flexcam("optimize", PUBLISHED, *args, "--method", "gradient", "--evaluations", "2").out
    assert "no varied value changes run.speed. Vary a value" in " ".join(found.split())


def test_table_and_plot_of_derivatives(flexcam, tmp_path):
    args = ("--of", "frequency.1", "--to", "masses.valve.mass", "--plot", tmp_path / "s.svg")
    done = flexcam("sensitivity", PUBLISHED, *args)
    assert done.code == 0
    assert re.search(r"masses.valve.mass .* exact ", done.out)
    assert "Hz per kg" in done.out
    assert "SI" not in done.out
    assert (tmp_path / "s.svg").read_text(encoding="utf-8").count("<path") > 5


@pytest.mark.slow
def test_sobol_indices_of_frequency(flexcam, oscillator, tmp_path):
    """For small equal intervals f is linear: variances as (1/2 df/f)^2, here 4 : 1; 0.06: error at 64 points."""
    args = ("--to", "springs.one.stiffness=39.2:40.8kN/m", "--to", "masses.one.mass=99:101g", "--sobol", "64")
    report = flexcam(
        "sensitivity", oscillator, "--of", "frequency.1", *args, "--plot", tmp_path / "s.svg", "--json"
    ).json
    sobol = report["sobol"]["frequency.1"]
    f = OMEGA / (2.0 * math.pi)
    variance = (0.5 * f) ** 2 * (0.02**2 + 0.01**2) / 3.0
    assert sobol["variance"] == pytest.approx(variance, rel=0.05)
    totals = [row["total"] for row in sobol["indices"]]
    assert totals == pytest.approx([0.8, 0.2], abs=0.06)
    for row in sobol["indices"]:
        assert row["total_low"] <= row["total"] <= row["total_high"]
    args = (*args[:-1], "8")
    assert "first order" in flexcam("sensitivity", oscillator, "--of", "frequency.1", *args).out


def test_tolerance_scatter_of_frequency(flexcam, oscillator, tmp_path):
    """Linear: std(f) = f/2 hypot(0.05/sqrt 3, 0.06/3) within 5 %, the sampling error of a hypercube of 64."""
    table = tmp_path / "parts.csv"
    args = ("--tolerance", "springs.one.stiffness=±5%", "--tolerance", "masses.one.mass=normal:±6g", "--count", "64")
    files = ("--csv", table, "--plot", tmp_path / "s.png")
    done = flexcam("sensitivity", oscillator, "--of", "frequency.1", *args, *files, "--json").json
    scatter, f = done["scatter"]["frequency.1"], OMEGA / (2.0 * math.pi)
    assert scatter["std"] == pytest.approx(0.5 * f * math.hypot(0.05 / math.sqrt(3.0), 0.06 / 3.0), rel=0.05)
    assert scatter["mean"] == pytest.approx(f, rel=2e-3)
    assert scatter["rank_correlation"]["springs.one.stiffness"] > 0.5
    assert scatter["rank_correlation"]["masses.one.mass"] < -0.3
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 64
    for row in rows:  # every set of parts is evaluated with its own values
        expected = math.sqrt(float(row["springs.one.stiffness"]) / float(row["masses.one.mass"])) / (2.0 * math.pi)
        assert float(row["frequency.1"]) == pytest.approx(expected, rel=1e-9)
    args = (*args[:-1], "8")
    assert "Rank correlation" in flexcam("sensitivity", oscillator, "--of", "frequency.1", *args).out


@pytest.mark.slow
def test_minimum_stiffness_with_frequency_bound(flexcam, oscillator, tmp_path):
    """Minimum k with f >= 110 Hz: k = m (2 pi f)^2, at the bound; the written case has this value."""
    best, table = tmp_path / "best.toml", tmp_path / "all.csv"
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "80")  # fmt: skip
    done = flexcam("optimize", oscillator, *args, "-o", best, "--csv", table, "--plot", tmp_path / "p.svg", "--json")
    assert done.code == 0
    assert done.json["files"] == [str(path) for path in (table, tmp_path / "p.svg", best)]
    expected = 0.1 * (2.0 * math.pi * 110.0) ** 2
    assert done.json["best"]["values"]["springs.one.stiffness"] == pytest.approx(expected, rel=2e-4)
    assert done.json["best"]["bounds"][0]["active"]
    assert done.json["best"]["bounds"][0]["slack"] >= -1e-9
    result = modes(read_case(best)).modes
    assert result.frequencies[0] == pytest.approx(110.0, rel=1e-4)
    (override,) = done.json["best"]["overrides"]
    assert modes(read_case(oscillator, [override])).modes.frequencies[0] == result.frequencies[0]
    assert len(table.read_text(encoding="utf-8").splitlines()) == done.json["evaluations"] + 1
    again = flexcam("optimize", oscillator, *args, "--json").json
    assert again["best"] == done.json["best"]
    assert flexcam("optimize", oscillator, *args, "-o", best).code == 2  # it exists


def test_gradient_search_needs_few_runs(flexcam, oscillator, tmp_path):
    """The same minimum with 1/20 of the runs; the goal is a number of the case, the bound a frequency."""
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


def test_bound_of_zero_has_no_relative_margin(flexcam, oscillator):
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--evaluations", "24")
    lines = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 >= 0").out.splitlines()
    (row,) = (line for line in lines if line.startswith("frequency.1"))
    assert row.split()[-3:] == ["met", "none", "found"]
    bare = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 >= 110")
    assert bare.code == 2
    assert "Add the unit, such as Hz" in bare.err


def test_few_evaluations_are_refused_before_first_run(flexcam, oscillator, monkeypatch):
    monkeypatch.setattr("flexcam.cli.study_options.StudyOptions.initial_quantities", lambda *_: pytest.fail("a run"))
    options = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "frequency.1", "--evaluations", "12")
    assert "--evaluations: got 12, expected 24 or more" in flexcam("optimize", oscillator, *options).err


@pytest.mark.slow
def test_warnings_of_best_variant(flexcam, one_mass):
    """The softest spring has the lowest force, and the follower loses contact at the higher speed."""
    options = ("--vary", "springs.held.stiffness=20:42kN/m", "--least", "springs.held.force.largest")
    quick = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=180", "--evaluations", "24")
    report = flexcam("optimize", one_mass(), *options, *quick, "--at", "run.speed=1000,4500rpm", "--json").json
    (warning,) = report["warnings"]
    assert "the best variant at run.speed=4500rpm: the follower of 'k' loses contact" in warning


@pytest.mark.parametrize("method", [pytest.param("evolution", marks=pytest.mark.slow), "gradient"])
def test_goal_over_several_conditions_uses_worst_value(flexcam, oscillator, method):
    """Minimum stiffness with f >= 110 Hz for three masses: the largest mass is critical."""
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "60",
            "--at", "masses.one.mass=80:120:20g")  # fmt: skip
    found = flexcam("optimize", oscillator, *args, "--method", method, "--json").json["best"]["values"]
    assert found["springs.one.stiffness"] == pytest.approx(0.12 * (2.0 * math.pi * 110.0) ** 2, rel=1e-3)
    assert found["frequency.1"] == pytest.approx(110.0, rel=1e-3)
    twice = flexcam("optimize", oscillator, *args, "--subject", "frequency.1 <= 120 Hz", "--method", method)
    assert twice.code == 2
    assert "an upper and a lower goal" in twice.err
    for wrong, expected in (
        ("springs.one.stiffness=30:40:10kN/m", "does not name"), ("masses.one.mass=80g", "several values"),
        ("masses.one.mas=80:120:20g", "Did you mean 'mass'"), ("masses.one.mass=0.08,0.12", "numbers without a unit"),
    ):  # fmt: skip
        refused = flexcam("optimize", oscillator, *args[:-1], wrong, "--method", method)
        assert refused.code == 2
        assert expected in refused.err


@pytest.mark.parametrize(("method", "reason"), [
    ("evolution", "infeasible: no variant meets all constraints; widen"),
    ("gradient", "from this start; widen the intervals, relax"),
    pytest.param("gradient --starts 2", "from any of 2 starts; widen", marks=pytest.mark.slow),
])  # fmt: skip
def test_search_without_feasible_variant_is_reported(flexcam, oscillator, tmp_path, method, reason):
    """A gradient search follows one path: its end does not prove infeasibility."""
    options = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--evaluations", "24")
    bound = ("--subject", "frequency.1 >= 1 kHz", "-o", tmp_path / "best.toml")
    done = flexcam("optimize", oscillator, *options, *bound, "--method", *method.split())
    assert done.code == 3
    assert not (tmp_path / "best.toml").exists()
    assert reason in " ".join(done.err.split())
    assert "violated by" in done.out
    assert "active" not in done.out
    done = flexcam("optimize", oscillator, *options, *bound, "--method", *method.split(), "--json")
    assert (done.code, done.json["status"]) == (3, "infeasible")


def test_variant_without_derivatives_keeps_values(monkeypatch):
    """A search refuses such a start with this reason, and may end at such a variant."""

    def fail_to_converge(*_given):
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, "the forces do not converge"))

    monkeypatch.setattr(gradients, "compute_gradient", fail_to_converge)
    file, mass = CaseFile.open(Path(PUBLISHED)), Variable("masses.valve.mass", 0.05, 0.15, "kg")
    with gradients.gradient_evaluator(file, QUICK[1::2], ["frequency.1"], [mass]) as runs:
        (row,) = runs([()])
    assert row.status.ok
    assert "the forces do not converge" in row.status.text
    assert (set(row.scalars), row.derivatives) == ({"frequency.1"}, {})


@pytest.mark.slow
def test_gradient_search_at_bound_of_physical_values(flexcam):
    """Damping cannot be negative: at zero the derivative is one-sided."""
    args = ("--set", "springs.valve.damping=0", "--vary", "springs.valve.damping=0:4N s/m", "--method", "gradient",
            "--least", "probes.valve.displacement.largest", "--evaluations", "4", *QUICK)  # fmt: skip
    done = flexcam("optimize", PUBLISHED, *args, "--json")
    assert done.code == 0
    assert done.json["evaluations"] > 1


def test_varied_speed_is_printed_in_rpm(flexcam, oscillator):
    options = ("--vary", "run.speed=900:1100rpm", "--most", "run.speed", "--subject", "run.speed <= 1050 rpm")
    shown = flexcam("optimize", oscillator, *options, "--set", "run.steps_per_revolution=90", "--evaluations", "24").out
    assert "rad/s" not in shown
    (best,) = [line.split()[2:] for line in shown.splitlines() if line.startswith("max run.speed")]
    assert float(best[0]) == pytest.approx(1050.0, rel=0.05)
    assert best[1] == "rpm"


@pytest.mark.slow
def test_gradient_search_with_contact(flexcam):
    """Maximum speed with a bound on the nose force: every variant is better or corrects the preceding one."""
    args = ("--vary", "run.crank_speed=4500:6500rpm", "--vary", "springs.valve.installed_force=300:500N",
            "--most", "run.crank_speed", "--subject", "contacts.intake.nose_force.least >= 150 N",
            "--subject", "springs.valve.stress.largest <= 0.86 GPa", "--method", "gradient")  # fmt: skip
    fixed = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=720", "--evaluations", "5")
    found = flexcam("optimize", ENGINE, *args, *fixed, "--json").json
    values = found["best"]["values"]
    assert found["evaluations"] <= 5
    assert values["run.crank_speed"] > 5080.0 * 2.0 * math.pi / 60.0
    assert values["contacts.intake.nose_force.least"] >= 150.0
    assert 0.95 * 0.86e9 <= values["springs.valve.stress.largest"] <= 0.86e9, "near its bound after five evaluations"


def test_table_of_best_variant_has_six_digits(flexcam, oscillator, tmp_path):
    """As in other tables, as an override for the command line; JSON has all digits."""
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness",
            "--subject", "frequency.1 >= 110 Hz", "--evaluations", "24")  # fmt: skip
    (full_override,) = flexcam("optimize", oscillator, *args, "--json").json["best"]["overrides"]
    key, _, value = full_override.partition("=")
    digits = value.removesuffix("kN/m")
    assert len(digits) > 10
    shown = flexcam("optimize", oscillator, *args).out
    row = next(line for line in shown.splitlines() if f"--set {key}" in line)
    (printed_value,) = re.findall(r"[\d.]+(?=kN/m)", row)
    assert printed_value == f"{float(digits):.6g}"


def test_best_case_in_other_folder_finds_mesh(flexcam, tmp_path):
    """The written case refers to the mesh from the other folder and has no nodes of its own."""
    args = ("--vary", "cams.intake.rise=60:90deg", "--least", "cams.intake.deceleration", "--evaluations", "24")
    best = tmp_path / "deep" / "best.toml"
    assert flexcam("optimize", PUBLISHED, *args, "-o", best).code == 0
    assert flexcam("check", best).code == 0


@pytest.mark.slow
def test_minimum_deceleration_with_lift_area_bound(flexcam):
    """The widest cam has the minimum deceleration; numbers in lists can be varied, too."""
    law = 'cams.intake.law={id="bspline",coefficients=[0.0,0.0,0.0,0.1,0.5,0.9,1.0,1.0,1.0]}'
    args = ("--set", law, "--vary", "cams.intake.law.coefficients.3=0.0:0.3", "--least", "cams.intake.deceleration",
            "--subject", "cams.intake.area >= 0.0091", "--evaluations", "40")  # fmt: skip
    found = flexcam("optimize", ENGINE, *args, "--json").json
    (override,) = found["best"]["overrides"]
    assert override.startswith("cams.intake.law.coefficients=[0.0, 0.0, 0.0, ")
    assert found["best"]["values"]["cams.intake.deceleration"] < 0.0188  # that of 0.1
    assert found["best"]["values"]["cams.intake.area"] >= 0.0091


@pytest.mark.parametrize("last", [5, 17, 33])  # in the first generation, in the second, in the trust region
def test_stopped_search_keeps_evaluated_variants(last, flexcam, oscillator, tmp_path, stop_after):
    """A variant can take minutes; a stopped search writes the best variant and the table."""
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


def test_new_study_reads_changed_case(oscillator):
    def frequency():
        with create_evaluator(CaseFile.open(oscillator), (), ["frequency.1"]) as run:
            return next(iter(run([()]))).scalars["frequency.1"]

    before = frequency()
    oscillator.write_text(OSCILLATOR.replace('"0.1 kg"', '"0.4 kg"'), encoding="utf-8")
    assert frequency() == pytest.approx(0.5 * before)


@pytest.mark.slow
def test_study_survives_killed_worker(oscillator):
    """The unfinished variants of the worker are evaluated again."""
    killed_pids = []

    def kill(count):
        if not killed_pids:
            process = next(p for p in multiprocessing.active_children() if p.name.startswith("SpawnProcess"))
            killed_pids.append(process.pid)
            os.kill(process.pid, signal.SIGKILL)

    variants = [(f"springs.one.stiffness={k} kN/m",) for k in range(20, 60)]
    file = CaseFile.open(oscillator)
    with create_evaluator(file, (), ["frequency.1"], workers=2, advance=kill) as run:
        found = [*run(variants), *run(variants[:2])]  # workers remain between calls, or new ones take their place
    with create_evaluator(file, (), ["frequency.1"]) as run:
        expected = list(run(variants))
    assert killed_pids
    assert [row.scalars for row in found] == [row.scalars for row in [*expected, *expected[:2]]]


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
def test_stopped_study_keeps_evaluated_variants(kind, last, flexcam, oscillator, tmp_path, stop_after):
    """Derivatives keep the nominal case, Sobol indices at least two base points, scatter every set."""
    stop_after(last)
    command, *options = STUDIES[kind]
    case = PUBLISHED if kind == "derivatives" else oscillator
    done = flexcam(command, case, *options, "--csv", tmp_path / "all.csv", "--json")
    if kind == "derivatives" and last == 7:  # all five are finished
        assert (done.code, done.json["status"]) == (0, "ok")
        return
    assert done.code == 130
    has_result = last > 0 and (kind, last) != ("shares", 3)
    assert (tmp_path / "all.csv").exists() == has_result
    assert ("nothing is kept" in done.err) != has_result
    if has_result:
        assert done.json["status"] == "interrupted"
        assert f"stopped after {last} of" in done.err
    if has_result and kind == "scatter":
        assert done.json["scatter"]["frequency.1"]["count"] == last


def test_stopped_map_has_missing_cells(flexcam, tmp_path, monkeypatch):
    rows = [Row(Status(), {"limits.buckling": 600.0}, {"limits.buckling": "rpm"})]

    def interrupt_when_empty(*_, **named):
        if not rows:
            raise KeyboardInterrupt
        return rows.pop()

    monkeypatch.setattr("flexcam.studies.quantities.quantity_row", interrupt_when_empty)
    args = ("--over", "springs.valve.stiffness=45,65kN/m", "--and", "springs.valve.installed_force=300,500N")
    done = flexcam("limits", ENGINE, *args, "--limit", "buckling", "--csv", tmp_path / "map.csv", "--json")
    assert (done.code, done.json["status"]) == (130, "interrupted")
    assert done.json["statuses"] == ["done", *["interrupted"] * 3]
    assert done.json["limits_rpm"]["buckling"] == [[600.0, None], [None, None]]
    assert len((tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()) == 5


def test_search_stopped_before_first_variant(flexcam, oscillator, tmp_path, stop_after):
    stop_after(0)
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness")
    done = flexcam("optimize", oscillator, *args, "--csv", tmp_path / "all.csv")
    assert done.code == 130
    assert "nothing is kept" in done.err
    assert not (tmp_path / "all.csv").exists()


@pytest.mark.slow
def test_pareto_front_of_two_goals(flexcam, oscillator, tmp_path):
    """Low stiffness against high frequency: every stiffness is on the front, and both increase along it."""
    pytest.importorskip("pymoo")
    args = ("--vary", "springs.one.stiffness=20:80kN/m", "--least", "springs.one.stiffness", "--most", "frequency.1")
    files = ("--plot", tmp_path / "f.svg", "--csv", tmp_path / "f.csv")
    found = flexcam("optimize", oscillator, *args, "--evaluations", "96", *files, "--json").json["front"]
    k, f = ([variant["values"][name] for variant in found] for name in ("springs.one.stiffness", "frequency.1"))
    assert len(k) > 30
    assert k == sorted(k)
    assert f == sorted(f)


def test_absolute_tolerance_equals_relative_tolerance(flexcam, oscillator):
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
def test_unknown_names_are_refused_before_first_run(flexcam, path, words, monkeypatch):
    def fail_on_run(*_):
        pytest.fail("something was run")

    for what in ("evaluate", "find_limits"):
        monkeypatch.setattr(sys.modules["flexcam.studies.quantities"], what, fail_on_run)
    refused = flexcam(words[0], path, *words[1:])
    assert refused.code == 2
    assert refused.err.startswith(("--of: ", "--least, --most or --subject: "))
    assert "Did you mean" in refused.err


@pytest.mark.slow
def test_scatter_is_independent_of_number_of_workers(flexcam, oscillator):
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
    one_worker, two_workers = (
        flexcam("sensitivity", oscillator, *args, *QUICK, "--workers", n, "--json").json["scatter"] for n in ("1", "2")
    )
    assert one_worker == two_workers


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
    "no unit": ("sensitivity", "--of", "frequency.1", "--tolerance", "masses.valve.mass=±0.001"),
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
    "half a map": ("limits", "--and", "masses.valve.mass=80,90g"),
    "one value": ("limits", "--over", "masses.valve.mass=80,90g", "--and", "springs.valve.stiffness=40kN/m"),
    "the same": ("limits", "--over", "masses.valve.mass=80,90g", "--and", "masses.valve.mass=80,90g"),
    "a map of no contact": (
        "limits", "--over", "masses.valve.mass=80,90g", "--and", "springs.valve.stiffness=40,50kN/m"
    ),
    "a map of nothing": ("limits", "--over", "masses.nosuch.mass=80,90g", "--and", "springs.valve.stiffness=4,5kN/m"),
}  # fmt: skip


@pytest.mark.slow
def test_optimum_is_not_worse_than_nominal_case(flexcam):
    """The case is at the end of the interval with the minimum deviation, which one generation misses."""
    args = ("--vary", "masses.valve.mass=0.1:0.3kg", "--least", "deviation.peak", "--evaluations", "24", "--json")
    found = flexcam("optimize", PUBLISHED, *QUICK, *args).json
    assert found["best"]["overrides"] == ["masses.valve.mass=0.1kg"]


@pytest.mark.parametrize("what", mostly_slow(REFUSED, 2))
def test_studies_refuse_invalid_options(flexcam, what):
    command, *options = REFUSED[what]
    done = flexcam(command, PUBLISHED, *QUICK, *options)
    assert done.code == 2, done.out + done.err
    assert "expected" in done.err or re.search(r"Leave --[a-z-]+ out", done.err)


def test_frequencies_with_closed_contacts_are_those_of_modes(flexcam):
    names = [f"contacts.intake.{place}.frequency.{n}" for place in ("base_circle", "full_lift") for n in (1, 2)]
    words = [word for name in names for word in ("--of", name)]
    rows = flexcam("sensitivity", ENGINE, *words, "--to", "springs.valve.stiffness", "--json").json["derivatives"]
    closed = flexcam("modes", ENGINE, "--json").json["closed"]["intake"]
    expected = [closed[f"{place}_hz"][n] for place in ("base_circle", "full_lift") for n in (0, 1)]
    assert [row["value"] for row in rows] == pytest.approx(expected, rel=1e-9)
    assert max(row["logarithmic"] for row in rows) == pytest.approx(0.5, abs=0.01)  # spring surge: sqrt(k)
    of_seat = flexcam("sensitivity", ENGINE, "--of", names[0].replace("intake", "seat"), "--to", "masses.valve.mass")
    assert of_seat.code == 2


def test_interval_without_sobol_is_refused(flexcam):
    done = flexcam("sensitivity", PUBLISHED, "--of", "frequency.1", "--to", "masses.valve.mass=80:90g")
    assert done.code == 2
    assert "Only --sobol has intervals" in done.err


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_stops_study_with_workers(number, code, tmp_path):
    """Thousands of variants are pending, and no process remains."""
    args = ("--of", "contacts.intake.force.largest", "--tolerance", "springs.valve.stiffness=±5%", "--count", "4000")
    words = [sys.executable, "-m", "flexcam", "sensitivity", str(ENGINE), *args, "--workers", "2"]
    restore_sigint = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=restore_sigint
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
def test_map_of_limits_over_two_values(flexcam, tmp_path):
    """A stiffer spring keeps contact to a higher speed; each cell equals the result of the command for its case."""
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


@pytest.mark.slow
def test_evaluations_receive_number_of_runs(flexcam, monkeypatch):
    """Compilation is worthwhile for ninety runs of 2 880 steps, not for one: a search took fifteen times as long."""
    quantities = sys.modules["flexcam.studies.quantities"]
    run_counts, original = [], quantities.evaluate
    monkeypatch.setattr(quantities, "evaluate", lambda case, runs, **o: run_counts.append(runs) or original(case, **o))
    args = ("--tolerance", "springs.valve.stiffness=±5%", "--of", "deviation.peak", "--count", "9")
    assert flexcam("sensitivity", PUBLISHED, *args, *QUICK).code == 0
    assert run_counts == [9] * 10


def test_limit_searches_receive_number_of_variants(flexcam, monkeypatch):
    run_counts = []
    quantities = sys.modules["flexcam.studies.quantities"]
    monkeypatch.setattr(quantities, "find_limits", lambda *_, runs: run_counts.append(runs) or Limits({}, 0.0, 0.0))
    args = ("--over", "springs.valve.stiffness=45,65kN/m", "--and", "springs.valve.installed_force=300,500N")
    flexcam("limits", ENGINE, *args)
    assert run_counts == [4, 4, 4, 4]


@pytest.mark.parametrize(
    "words",
    [
        ("sensitivity", "--of", "frequency.1", "--tolerance", "springs.one.stiffness=±5%"),
        ("sensitivity", "--of", "frequency.1", "--to", "springs.one.stiffness=20:80kN/m", "--sobol", "8"),
        ("optimize", "--vary", "springs.one.stiffness=20:80kN/m", "--least", "frequency.1"),
        ("optimize", "--vary", "springs.one.stiffness=2:8kN/m", "--least", "frequency.1", "--most", "masses.one.mass"),
    ],
)  # fmt: skip
def test_negative_seed_is_refused(words, flexcam, oscillator):
    """Random number generators raise their own error."""
    done = flexcam(words[0], oscillator, *words[1:], "--seed", "-3")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("--seed: got -3, expected a whole number, at least 0")


def test_seed_of_derivatives_is_refused(flexcam, oscillator):
    args = ("--of", "frequency.1", "--to", "springs.one.stiffness", "--seed", "1")
    done = flexcam("sensitivity", oscillator, *args)
    assert (done.code, done.err.partition(":")[0]) == (2, "--seed")


def test_repeated_tolerance_is_refused(flexcam, oscillator):
    """Only the second one would apply, but the rank correlation would refer to the first."""
    args = ("--tolerance", "springs.one.stiffness=±5%", "--tolerance", "springs.one.stiffness=normal:±1%")
    done = flexcam("sensitivity", oscillator, "--of", "frequency.1", *args)
    assert done.code == 2
    assert done.err.startswith("--tolerance: got 'springs.one.stiffness', expected every key once")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--lowest", "9000rpm", "--highest", "8000rpm"), "--highest: got 8000rpm, expected a speed above the lowest"),
        (("--lowest", "12000rpm"), "--highest: got 10000 rpm, expected a speed above the lowest, 12000 rpm. The"),
        (("--lowest", "0rpm"), "--lowest: got 0rpm, expected a speed above zero"),
        (("--accuracy", "0rpm"), "--accuracy: got 0rpm, expected a speed above zero"),
    ],
)  # fmt: skip
def test_refused_limit_speeds_are_printed_as_given(words, message, flexcam):
    """The message has crank speeds, as in the case, and the option that specifies them."""
    done = flexcam("sensitivity", ENGINE, "--of", "limits.bounce", "--to", "masses.valve.mass", *words)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(message)


def test_study_evaluates_case_as_read(tmp_path):
    """A change of the file during the study does not affect its variants."""
    path = tmp_path / "case.toml"
    text = (ROOT / "cases/checks/mathieu.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    file = CaseFile.open(path)
    before = list(evaluate_frequency(file))
    path.write_text("format = 2", encoding="utf-8")
    assert list(evaluate_frequency(file)) == before


def evaluate_frequency(file):
    with create_evaluator(file, (), ["frequency.1"]) as runs:
        yield from (row.scalars for row in runs([("run.speed=900rpm",)]))


def test_exact_derivative_of_rough_motion_is_marked(flexcam):
    """With 720 steps impacts fall between steps: the exact slope holds for tiny changes alone."""
    of, to = ("--of", "contacts.intake.force.largest"), ("--to", "masses.bucket.mass", "--to", "contacts.lash.gap")
    coarse = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=720", "--json")
    for rough in flexcam("sensitivity", ROOT / "cases/direct-acting/bucket.toml", *of, *to, *coarse).json[
        "derivatives"
    ]:
        assert rough["analytic"]
        assert not rough["smooth"]
        assert "0.5 % more of all numbers changes it by" in rough["note"]
    spring = ("--to", "springs.valve.installed_force", "--set", "run.revolutions=1", "--json")
    (smooth,) = flexcam("sensitivity", ENGINE, *of, *spring).json["derivatives"]
    assert smooth["smooth"], smooth["note"]
