"""The command campbell: natural frequencies over speed, and orders of the response."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, run
from flexcam.analysis.natural_modes import campbell
from flexcam.analysis.orders import last_revolution_orders
from flexcam.cli.modes import modes_over_speed
from flexcam.dynamics import NOT_POSITIVE, RunFailedError
from flexcam.plotting.spectra import campbell_figure

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "cases/tayeb/model-3-shm.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
ONE_MASS = ROOT / "cases/petrescu/valve-spring.toml"
QUICK = ("--set", "run.steps_per_revolution=360")
RANGE = ("--lowest", "1000rpm", "--highest", "6000rpm", "--count", "3")


def test_published_mode_crosses_first_order(flexcam, tmp_path):
    """The loaded mode at 67.114 Hz crosses order 1 at 4026.9 rpm; simple harmonic motion has no other order."""
    picture = tmp_path / "campbell.svg"
    report = flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture, "--json").json
    (crossing,) = report["crossings"]
    assert crossing["rpm"] == pytest.approx(60.0 * crossing["frequency"], rel=1e-12)
    assert crossing["rpm"] == pytest.approx(4026.86, abs=0.01)
    assert (crossing["harmonic"], crossing["mode"]) == (1, 1)
    assert crossing["amplitude"] == pytest.approx(0.003)
    assert list(report["lift_amplitudes_m"]) == ["1"]
    for mode in report["modes"]:  # no contact of variable stiffness: every line is horizontal
        assert np.ptp(mode["frequencies_hz"]) == pytest.approx(0.0, abs=1e-9)
    assert picture.read_text(encoding="utf-8").count("<path") > 10
    assert flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture).code == 2  # the plot exists


@pytest.mark.slow
def test_campbell_plot_legend_lists_visible_lines(flexcam, tmp_path):
    """One mode of model 3 is within the orders; the other modes, grey or not, are far above the plot."""
    picture = tmp_path / "campbell.svg"
    assert flexcam("campbell", PUBLISHED, *RANGE, *QUICK, "--plot", picture).out.endswith(f"{picture}\n")
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    found = campbell(case, [0.5 * case.speed, 2.0 * case.speed], orders=[1])
    (legend,) = campbell_figure(found, 1.0, "camshaft").legends
    mode, circle = (text.get_text() for text in legend.get_texts())
    assert (mode[:14], circle[:20]) == ("1: mass valve ", "order meets mode; ar")


@pytest.mark.slow
def test_force_at_crossing_equals_force_of_run(flexcam):
    """The amplitude of the order in the force, at a crossing on a speed of the list."""
    args = ("--lowest", "4026.86rpm", "--highest", "5000rpm", "--count", "2")
    report = flexcam("campbell", PUBLISHED, *args, *QUICK, "--json").json
    exact = flexcam("stability", PUBLISHED, "--set", "run.speed=4026.86rpm", *QUICK, "--json").json
    assert report["crossings"][0]["load"] == pytest.approx(exact["resonances"][0]["load_n"], rel=1e-3)


@pytest.mark.slow
def test_campbell_of_engine_with_spring_surge(flexcam):
    """Crank speeds, orders of the camshaft: the spring surge at 455 Hz crosses order 11 at 120 * 455 / 11."""
    args = ("--lowest", "4500rpm", "--highest", "5200rpm", "--count", "2", "--orders", "11,12", "--modes", "5")
    report = flexcam("campbell", ENGINE, *args, *QUICK, "--set", "run.revolutions=1", "--json").json
    assert report["shaft"] == "crank"
    surge = [crossing for crossing in report["crossings"] if "spring valve" in crossing["words"]]
    assert [crossing["harmonic"] for crossing in surge] == [12, 11]
    for crossing in surge:
        assert crossing["rpm"] == pytest.approx(120.0 * crossing["frequency"] / crossing["harmonic"], rel=1e-12)
        assert crossing["frequency"] == pytest.approx(454.9, abs=0.5)


def test_inertia_at_full_lift_relieves_pushrod_and_raises_its_frequency():
    """Its bending frequency squared is linear in the compression, and the inertia forces in the speed squared."""
    engine = ROOT / "cases/pushrod-engine/intake.toml"
    case = read_case(engine, ['cams.intake.law="shm"', "run.steps_per_revolution=720", "run.revolutions=1"])
    speeds = np.array([50.0, 150.0, 250.0])
    squares = campbell(case, speeds.tolist(), orders=[1], modes=1).frequencies[:, 0] ** 2
    first, second = np.diff(squares) / np.diff(speeds**2)
    assert first == pytest.approx(0.1086, abs=1e-3)
    assert second == pytest.approx(first, rel=1e-3)  # the frequencies of an arch are not quite linear


def test_unstable_equilibrium_at_one_speed_keeps_other_speeds(monkeypatch):
    """An unstable equilibrium at full lift has no modes: only that speed has the status of the failure."""
    module = sys.modules["flexcam.analysis.natural_modes"]
    real, calls = module.modes_on_the_lift, []

    def fail_at_second_call(*given, acceleration):
        calls.append(given)
        if len(calls) == 2:
            raise RunFailedError(NOT_POSITIVE)
        return real(*given, acceleration=acceleration)

    monkeypatch.setattr(module, "modes_on_the_lift", fail_at_second_call)
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    found = campbell(case, [200.0, 300.0, 400.0], orders=[1])
    assert [status.ok for status in found.statuses] == [True, False, True]
    assert found.statuses[1] is NOT_POSITIVE
    assert np.isnan(found.frequencies).tolist() == [[False] * 8, [True] * 8, [False] * 8]


def test_failed_start_at_one_speed_keeps_other_speeds(monkeypatch):
    module = sys.modules["flexcam.analysis.orders"]
    real, calls = module.prepare, []

    def prepare_or_fail(case):
        calls.append(case)
        if len(calls) == 1:
            raise RunFailedError(NOT_POSITIVE)
        return real(case)

    monkeypatch.setattr(module, "prepare", prepare_or_fail)
    found = campbell(read_case(PUBLISHED, ["run.steps_per_revolution=360"]), [200.0, 300.0], orders=[1])
    assert [status.ok for status in found.statuses] == [False, True]
    assert np.isnan(found.frequencies).tolist() == [[True] * 8, [False] * 8]
    calls.clear()
    case = read_case(PUBLISHED, ["run.steps_per_revolution=360"])
    table, _, warning = modes_over_speed(case, [200.0, 300.0], [1]).parts
    assert {*table.columns[1].cells} == {"failed"}, "not a dash, the sign of modes that do not exist there"
    assert {*table.columns[2].cells}.isdisjoint({"failed", "-"})
    assert warning.startswith("Warning: no result at 1909.86 camshaft rpm")


def test_failed_speed_is_printed_as_failed_not_dash(monkeypatch, flexcam):
    module = sys.modules["flexcam.analysis.natural_modes"]
    real, calls = module.modes_on_the_lift, []

    def fail_at_first_call(*given, acceleration):
        calls.append(given)
        if len(calls) == 1:
            raise RunFailedError(NOT_POSITIVE)
        return real(*given, acceleration=acceleration)

    monkeypatch.setattr(module, "modes_on_the_lift", fail_at_first_call)
    done = flexcam("campbell", PUBLISHED, *RANGE, *QUICK)
    (first, *_), table = [line.split() for line in done.out.splitlines() if " failed " in line], done.out
    assert first[:2] == ["1", "failed"]
    assert "-: at this speed" not in table


@pytest.mark.parametrize("command", [("campbell",), ("campbell", "--response")])
def test_failure_at_all_speeds_has_exit_code_3(command, flexcam):
    """Explicit Newmark with steps far beyond its stability limit: every run diverges."""
    unstable = ("--set", "run.integrator={method='newmark',beta=0.001}", "--set", "run.revolutions=20", "--count", "2")
    done = flexcam(*command, PUBLISHED, *QUICK, *unstable, "--json")
    assert (done.code, done.json["status"]) == (3, "not-finite")
    assert "none of 2 speeds was completed" in done.err


@pytest.mark.slow
def test_simple_harmonic_lift_has_only_first_order(flexcam, tmp_path):
    """The rigid train follows the lift h/2 (1 - cos): order 1 only, i h/2 omega^2 with the rocker ratio i."""
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


def test_table_of_response_orders(flexcam):
    done = flexcam("campbell", "--response", ONE_MASS, "--count", "2", *QUICK, "--orders", "1:6")
    assert done.code == 0
    assert "contacts.train.force" in done.out
    assert "acceleration of valve.uy" in done.out
    assert "change per revolution" in done.out


@pytest.mark.parametrize(
    "words",
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
def test_campbell_refuses_invalid_options(flexcam, words):
    done = flexcam(words[0], PUBLISHED, *QUICK, *words[1:])
    assert done.code == 2
    assert "expected" in done.err


def test_campbell_does_not_overwrite_csv(flexcam, tmp_path):
    existing = tmp_path / "orders.csv"
    existing.write_text("mine", encoding="utf-8")
    assert flexcam("campbell", "--response", PUBLISHED, *QUICK, "--csv", existing).code == 2
    assert existing.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (("run.steps_per_revolution=20",),
         ("run.steps_per_revolution (--set", "got 20,", "49 or more for 24 orders", "Use more steps, or ask for 9")),
        (("run.step=0.001s",),
         ("run.step (--set", "60 steps per revolution at 1000 camshaft rpm", "0.000493 s or less", "ask for 29")),
        (("run.steps_per_revolution=20", "run.adaptive.tolerance=0.01"),
         ("orders: got 24 of a last revolution of 20 steps", "up to 9", "Use 49 steps per revolution")),
    ],
)  # fmt: skip
def test_too_few_steps_for_orders_are_refused(flexcam, steps, message):
    """The message names the key of the steps, before any run if the key determines their number."""
    orders = ("--orders", "1:60") if "0.001s" in steps[0] else ()
    overrides = [word for step in steps for word in ("--set", step)]
    args = ("--response", "--lowest", "500rpm", "--highest", "1000rpm", "--count", "2")
    done = flexcam("campbell", PUBLISHED, *args, *overrides, *orders)
    assert done.code == 2
    for part in message:
        assert part in done.err
    assert "angle" not in done.err


@pytest.mark.parametrize("steps", [48, 49])
def test_minimum_number_of_steps_for_orders(flexcam, steps):
    args = ("--response", "--lowest", "500rpm", "--count", "2", "--set", f"run.steps_per_revolution={steps}")
    assert flexcam("campbell", PUBLISHED, *args).code == (0 if steps == 49 else 2)


def test_spring_surge_does_not_change_modes_over_speed(flexcam):
    """The coils in contact at full lift are those at rest, at every speed."""
    case = flexcam("new", "finger-follower", "--json").json["files"][0]
    speeds = ("--lowest", "4000rpm", "--highest", "6000rpm", "--count", "2", "--set", "run.revolutions=1")
    surge = flexcam("campbell", case, *speeds, *QUICK, "--json").json["modes"][0]
    assert surge["moves"].startswith("spring valve")
    assert surge["frequencies_hz"] == pytest.approx(2 * [605.8], rel=1e-3)


def test_force_at_crossing_does_not_depend_on_the_other_speeds(flexcam):
    """The force of the undamped train is not linear between the speeds: each crossing has a run of its own."""
    options = ("--lowest", "3500rpm", "--highest", "4500rpm", "--set", "run.steps_per_revolution=360", "--json")
    two, four = (flexcam("campbell", PUBLISHED, *options, "--count", count).json["crossings"] for count in ("2", "4"))
    assert [crossing["load"] for crossing in two] == pytest.approx([crossing["load"] for crossing in four], rel=1e-6)
    assert two


@pytest.mark.slow
def test_shaft_in_open_backlash_has_no_modes(flexcam):
    """At the nose of the cam the shaft is unstable between the flanks, as `stability` says."""
    case = flexcam("new", "gear-drive", "--json").json["files"][0]
    speeds = ("--lowest", "2000rpm", "--highest", "3000rpm", "--count", "2", "--set", "run.revolutions=1")
    done = flexcam("campbell", case, *speeds, "--json")
    assert done.code == 3
    assert done.json["ended"] == ["singular", "singular"]


def test_force_at_crossing_is_that_of_its_order(flexcam):
    settings = ["run.revolutions=1", "run.steps_per_revolution=360"]
    options = ("--lowest", "4900rpm", "--highest", "5100rpm", "--count", "2", "--orders", "9:12")
    overrides = (word for setting in settings for word in ("--set", setting))
    found = flexcam("campbell", ENGINE, *options, *overrides, "--json").json["crossings"]
    assert found
    for crossing in found:
        response = run(read_case(ENGINE, [*settings, f"run.crank_speed={crossing['rpm']!r} rpm"]))
        force, order = response.channels["contacts.intake.force"], crossing["harmonic"]
        expected = last_revolution_orders(response, force, order).amplitudes[order]
        assert crossing["load"] == pytest.approx(expected, rel=1e-6)
