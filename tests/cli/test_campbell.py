"""The command campbell: modes over speed, and orders of the response."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case
from flexcam.analysis.campbell import campbell
from flexcam.cli.modes import modes_over_speed
from flexcam.dynamics import NOT_POSITIVE, RunFailedError
from flexcam.plotting.spectra import campbell_figure

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "cases/tayeb/model-3-shm.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
ONE_MASS = ROOT / "cases/petrescu/valve-spring.toml"
QUICK = ("--set", "run.steps_per_revolution=360")
RANGE = ("--lowest", "1000rpm", "--highest", "6000rpm", "--count", "3")


def test_published_mode_meets_the_first_order(flexcam, tmp_path):
    """The loaded mode at 67.114 Hz meets order 1 at 4026.9 rpm; simple harmonic motion has no other order."""
    picture = tmp_path / "campbell.svg"
    found = flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture, "--json").json
    (met,) = found["crossings"]
    assert met["rpm"] == pytest.approx(60.0 * met["frequency"], rel=1e-12)
    assert met["rpm"] == pytest.approx(4026.86, abs=0.01)
    assert (met["harmonic"], met["mode"]) == (1, 1)
    assert met["amplitude"] == pytest.approx(0.003)
    assert list(found["lift_amplitudes_m"]) == ["1"]
    for mode in found["modes"]:  # no contact whose stiffness could change: every line is level
        assert np.ptp(mode["frequencies_hz"]) == pytest.approx(0.0, abs=1e-9)
    assert picture.read_text(encoding="utf-8").count("<path") > 10
    assert flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture).code == 2  # the picture is there


@pytest.mark.slow
def test_what_was_drawn_is_named_and_its_legend_names_what_is_seen(flexcam, tmp_path):
    """Of model 3 one mode lies within the orders; the others, grey or not, are far above the picture."""
    picture = tmp_path / "campbell.svg"
    assert flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture).out.endswith(f"{picture}\n")
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    found = campbell(case, [0.5 * case.speed, 2.0 * case.speed], orders=[1])
    (legend,) = campbell_figure(found, 1.0, "camshaft").legends
    mode, circle = (text.get_text() for text in legend.get_texts())
    assert (mode[:14], circle[:20]) == ("1: mass valve ", "order meets mode; ar")


def test_force_between_speeds_is_that_of_the_runs(flexcam):
    """The order's amplitude in the force, at a crossing that is made to fall on a speed of the list."""
    args = ("--lowest", "4026.86rpm", "--highest", "5000rpm", "--count", "2")
    found = flexcam("campbell", PUBLISHED, *args, *QUICK, "--json").json
    exact = flexcam("stability", PUBLISHED, "--set", "run.speed=4026.86rpm", *QUICK, "--json").json
    assert found["crossings"][0]["load"] == pytest.approx(exact["resonances"][0]["load_n"], rel=1e-3)


def test_campbell_of_an_engine(flexcam):
    """Crank speeds, orders of the camshaft: the surge of the spring at 455 Hz meets order 11 at 120 * 455 / 11."""
    args = ("--lowest", "4500rpm", "--highest", "5200rpm", "--count", "2", "--orders", "11,12", "--modes", "5")
    done = flexcam("campbell", ENGINE, *args, *QUICK, "--set", "run.revolutions=1", "--json").json
    assert done["shaft"] == "crank"
    surge = [one for one in done["crossings"] if "spring valve" in one["words"]]
    assert [one["harmonic"] for one in surge] == [12, 11]
    for one in surge:
        assert one["rpm"] == pytest.approx(120.0 * one["frequency"] / one["harmonic"], rel=1e-12)
        assert one["frequency"] == pytest.approx(454.9, abs=0.5)


def test_a_speed_at_which_the_train_stands_unstable_leaves_the_others(monkeypatch):
    """No modes are known where the state at full lift is unstable: that speed says so, the others stay."""
    module = sys.modules["flexcam.analysis.campbell"]
    real, calls = module.contact_modes, []

    def reached(*given):
        calls.append(given)
        if len(calls) == 2:
            raise RunFailedError(NOT_POSITIVE)
        return real(*given)

    monkeypatch.setattr(module, "contact_modes", reached)
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    found = campbell(case, [200.0, 300.0, 400.0], orders=[1])
    assert [one.ok for one in found.statuses] == [True, False, True]
    assert found.statuses[1] is NOT_POSITIVE
    assert np.isnan(found.frequencies).tolist() == [[False] * 8, [True] * 8, [False] * 8]


def test_a_speed_at_which_no_run_can_start_leaves_the_others(monkeypatch):
    module = sys.modules["flexcam.analysis.orders"]
    real, calls = module.prepare, []

    def prepared(case):
        calls.append(case)
        if len(calls) == 1:
            raise RunFailedError(NOT_POSITIVE)
        return real(case)

    monkeypatch.setattr(module, "prepare", prepared)
    found = campbell(read_case(PUBLISHED, ["run.steps_per_revolution=360"]), [200.0, 300.0], orders=[1])
    assert [one.ok for one in found.statuses] == [False, True]
    assert np.isnan(found.frequencies).tolist() == [[True] * 8, [False] * 8]
    calls.clear()
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    table, _, warning = modes_over_speed(case, [200.0, 300.0], [1]).parts
    assert {*table.columns[1].cells} == {"failed"}, "not a dash, the sign of modes that do not exist there"
    assert {*table.columns[2].cells}.isdisjoint({"failed", "-"})
    assert warning.startswith("Warning: no result at 1909.86 camshaft rpm")


def test_a_dash_is_a_missing_mode_and_a_failed_speed_says_so(monkeypatch, flexcam):
    module = sys.modules["flexcam.analysis.campbell"]
    real, calls = module.contact_modes, []

    def fails_first(*given):
        calls.append(given)
        if len(calls) == 1:
            raise RunFailedError(NOT_POSITIVE)
        return real(*given)

    monkeypatch.setattr(module, "contact_modes", fails_first)
    done = flexcam("campbell", PUBLISHED, *RANGE, *QUICK)
    (first, *_), table = [line.split() for line in done.out.splitlines() if " failed " in line], done.out
    assert first[:2] == ["1", "failed"]
    assert "-: at this speed" not in table


@pytest.mark.parametrize("command", [("campbell",), ("campbell", "--response")])
def test_speeds_of_which_none_is_known_are_a_failure(command, flexcam):
    """An explicit beta with steps far beyond its bound: every run leaves the range of numbers."""
    bad = ("--set", "run.integrator={method='newmark',beta=0.001}", "--set", "run.revolutions=20", "--count", "2")
    done = flexcam(*command, PUBLISHED, *QUICK, *bad, "--json")
    assert (done.code, done.json["status"]) == (3, "not-finite")
    assert "none of 2 speeds was completed" in done.err


def test_orders_of_a_simple_harmonic_lift(flexcam, tmp_path):
    """The rigid train follows the lift h/2 (1 - cos): order 1 alone, with i h/2 omega^2, i the rocker's ratio."""
    csv, picture = tmp_path / "orders.csv", tmp_path / "orders.svg"
    rigid = ("--set", "fidelity.model=rigid")
    args = (*RANGE, *QUICK, *rigid, "--probe", "valve", "--channel", "contacts.intake.force", "--csv", csv)
    found = flexcam("campbell", "--response", PUBLISHED, *args, "--plot", picture, "--json").json
    assert found["rpm"] == pytest.approx([1000.0, 3500.0, 6000.0])
    for rpm, row in zip(found["rpm"], found["histories"]["valve"]["amplitudes"], strict=True):
        omega = 2.0 * math.pi * rpm / 60.0
        assert row[1] == pytest.approx(1.6 * 0.003 * omega**2, rel=1e-9)
        assert max(row[0], *row[2:]) < 1e-9 * row[1]
    assert max(found["histories"]["valve"]["open_by"]) < 1e-9 * row[1]
    assert len(csv.read_text(encoding="utf-8").splitlines()) == 1 + 2 * 3 * 25
    assert picture.read_text(encoding="utf-8").count("<path") > 5


def test_orders_as_a_table(flexcam):
    done = flexcam("campbell", "--response", ONE_MASS, "--count", "2", *QUICK, "--orders", "1:6")
    assert done.code == 0
    assert "contacts.train.force" in done.out
    assert "acceleration of valve.uy" in done.out
    assert "change per revolution" in done.out


@pytest.mark.parametrize(
    "told",
    [
        ("campbell", "--orders", "0:3"), ("campbell", "--orders", "3:1"), ("campbell", "--orders", "one"),
        ("campbell", "--modes", "0"), ("campbell", "--contact", "nosuch"), ("campbell", "--count", "1"),
        ("campbell", "--highest", "100rpm"), ("campbell", "--plot", "picture.txt"), ("campbell", "--lowest", "0rpm"),
        *(
            ("campbell", "--response", *more)
            for more in (
                ("--channel", "nosuch"), ("--probe", "nosuch"), ("--orders", "0:3"), ("--orders", "1:5000"),
                ("--orders", "2:3"), ("--lowest", "3000"), ("--set", "run.revolutions=0.5"),
            )
        ),
    ],
)  # fmt: skip
def test_refusals(flexcam, told):
    done = flexcam(told[0], PUBLISHED, *QUICK, *told[1:])
    assert done.code == 2
    assert "expected" in done.err


def test_refuses_before_it_runs(flexcam, tmp_path):
    there = tmp_path / "orders.csv"
    there.write_text("mine", encoding="utf-8")
    assert flexcam("campbell", "--response", PUBLISHED, *QUICK, "--csv", there).code == 2
    assert there.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        (("run.steps_per_revolution=20",),
         ("run.steps_per_revolution (--set", "got 20,", "49 or more for 24 orders", "Use more steps, or ask for 9")),
        (("run.step=0.001s",),
         ("run.step (--set", "60 steps per revolution at 1000 camshaft rpm", "0.000493 s or less", "ask for 29")),
        (("run.steps_per_revolution=20", "run.adaptive.tolerance=0.01"),
         ("orders: got 24 of a last revolution of 20 steps", "up to 9", "Use 49 steps per revolution")),
    ],
)  # fmt: skip
def test_too_few_steps_for_the_orders_are_named(flexcam, steps, said):
    """Refused is the key that gives the steps, before any run where it tells their number."""
    orders = ("--orders", "1:60") if "0.001s" in steps[0] else ()
    more = [one for step in steps for one in ("--set", step)]
    args = ("--response", "--lowest", "500rpm", "--highest", "1000rpm", "--count", "2")
    done = flexcam("campbell", PUBLISHED, *args, *more, *orders)
    assert done.code == 2
    for part in said:
        assert part in done.err
    assert "angle" not in done.err


@pytest.mark.parametrize("steps", [48, 49])
def test_as_many_steps_as_the_orders_need(flexcam, steps):
    args = ("--response", "--lowest", "500rpm", "--count", "2", "--set", f"run.steps_per_revolution={steps}")
    assert flexcam("campbell", PUBLISHED, *args).code == (0 if steps == 49 else 2)


def test_waves_in_a_spring_do_not_change_its_modes(flexcam):
    """The coils that touch at full lift are those at rest, at every speed."""
    case = flexcam("new", "finger-follower", "--json").json["files"][0]
    report = flexcam("campbell", case, "--lowest", "4000rpm", "--highest", "6000rpm", "--count", "3", "--json").json
    surge = report["modes"][0]
    assert surge["moves"].startswith("spring valve")
    assert surge["frequencies_hz"] == pytest.approx(3 * [605.8], rel=1e-3)


def test_modes_of_a_shaft_within_its_backlash(flexcam):
    """No coils at rest are known without an equilibrium: those of the run count."""
    case = flexcam("new", "gear-drive", "--json").json["files"][0]
    report = flexcam("campbell", case, "--lowest", "2000rpm", "--highest", "3000rpm", "--count", "2", "--json").json
    assert report["modes"]
    assert report["ended"] == ["done", "done"]
