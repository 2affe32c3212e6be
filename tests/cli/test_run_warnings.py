"""Warnings of a run: contact loss, bounce, coil clash and buckling, with location and value."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, check_response, prepare, read_case, read_result, run
from flexcam.analysis.run_checks import check_events, check_transient
from flexcam.analysis.run_metrics import SPRING_MARGIN, RevolutionChange
from flexcam.case.starters import new_case
from flexcam.report.tables import describe_contacts
from flexcam.valvetrain import Metric
from flexcam.valvetrain.resolution import contact_duration

METRICS = (
    Metric("contacts.intake.open_on_the_lift", math.radians(81.6), "rad"),
    Metric("contacts.seat.bounces", 4.0, "1"),
    Metric("contacts.seat.bounce_height", 0.1643e-3, "m"),
    Metric("springs.valve.clearance.least", -0.231e-3, "m"),
    Metric("members.pushrod.buckling_margin", 0.5643, "1"),
    Metric("contacts.intake.pressure.largest", 3.0391e9, "Pa"),
    Metric("springs.valve.stress.largest", 1.6e9, "Pa"),
)
HARMLESS_VALUES = (math.radians(0.4), 4.0, 0.09e-3, 0.0, 1.001, 2.49e9, 1.49e9)
"""Values without a warning: one open step, ringing on the seat, closing coils, a load below the buckling load."""


def test_event_warnings_name_value_and_location():
    assert check_events(METRICS) == [
        (
            "Warning: the follower of 'intake' loses contact with its cam for 81.6 deg of the lift: "
            "do not use the motion after the loss for design"
        ),
        "Warning: the valve bounces 4 times at 'seat', up to 0.164 mm above its seat",
        "Warning: coils of 'valve' touch: 0.231 mm beyond coil bind",
        "Warning: the compression of member 'pushrod' exceeds its buckling load, margin 0.5643",
        "Warning: the contact pressure of 'intake' reaches 3039 MPa: hardened steel may yield under it",
        "Warning: the shear stress in the wire of 'valve' reaches 1600 MPa: no wire of valve springs endures it",
    ]


def test_python_returns_the_warnings_of_the_command(flexcam, tmp_path):
    """Coarse steps, and a hydraulic adjuster after one revolution."""
    path = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
    coarse = ["run.steps_per_revolution=90", "run.revolutions=1"]
    options = [word for one in coarse for word in ("--set", one)]
    printed = flexcam("run", path, *options, "-o", tmp_path, "--json").json["warnings"]
    read = read_case(path, coarse)
    assert check_response(read, run(read)) == printed
    assert sum("the oil of contacts.adjuster may still be in a transient" in warning for warning in printed) == 1


def test_warnings_of_a_rigid_run_need_the_rigid_model():
    case = read_case(Path(__file__).parents[2] / "cases/li/valve-train.toml", ["run.revolutions=1"])
    response = run(case, rigid=True)
    assert check_response(case, response, rigid=True) == []
    with pytest.raises(InputError, match="a response of another model"):
        check_response(case, response)


def test_harmless_values_cause_no_warning():
    assert (
        check_events([replace(metric, value=value) for metric, value in zip(METRICS, HARMLESS_VALUES, strict=True)])
        == []
    )


@pytest.fixture
def engine(tmp_path):
    return new_case("pushrod-engine", tmp_path / "engine.toml")[0]


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "warned"), [(400, True), (800, False)])
def test_coarse_steps_recommend_collocation(engine, flexcam, steps, warned):
    output = flexcam("run", engine, "--set", f"run.steps_per_revolution={steps}").out
    assert ("With 800 steps, for example, flexcam uses collocation" in " ".join(output.split())) is warned
    assert "Newmark" not in flexcam("run", engine, "--set", "run.integrator={method='newmark'}", "--name", "other").out


def test_coarse_run_recommends_one_number_of_steps(one_mass, flexcam):
    """The lift needs more steps than the accelerations, whose frequency coarse steps underestimate."""
    output = " ".join(flexcam("run", one_mass(), "--set", "run.steps_per_revolution=36").out.split())
    assert "time steps per period" in output
    assert "Newmark's method, because 36 steps per revolution are too few" in output
    assert len(set(re.findall(r"use at least (\d+)|With (\d+) steps", output))) == 1


def test_stiff_contact_recommends_collocation(one_mass, flexcam):
    """The stiffness needs 32 times the 720 steps: its frequency is that of 0.1 kg, 500 kHz."""
    output = " ".join(flexcam("run", one_mass(), "--set", "contacts.k.stiffness=1e12").out.split())
    assert "With 23040 steps, for example, flexcam uses collocation" in output


@pytest.mark.slow
@pytest.mark.parametrize(("rpm", "warned"), [(60_000, True), (5000, False)])
def test_valve_that_does_not_close_causes_warning(engine, flexcam, rpm, warned):
    output = flexcam("run", engine, "--set", f"run.crank_speed={rpm}rpm").out
    assert ("the valve does not close at 'seat'" in output) is warned
    assert ("seating velocity  " in output) is not warned


def test_lost_lift_causes_warning(tmp_path, flexcam):
    """A stiffness in kN/m instead of MN/m makes the oil of the adjuster a thousand times too soft."""
    words = "--set", "contacts.adjuster.stiffness=32 kN/m", "--set", "run.crank_speed=1000rpm"
    output = flexcam("run", Path(__file__).parents[2] / "cases/direct-acting/finger.toml", *words, "-o", tmp_path).out
    assert "of lift at 'seat'" in " ".join(output.split())


def test_contact_description_states_contact_loss(engine):
    case = read_case(engine)
    assert describe_contacts(case)[0].endswith("contact can be lost.")
    assert describe_contacts(case, METRICS)[0].endswith("contact can be lost: 'intake' lost contact for 81.6 deg.")


@pytest.mark.slow
def test_warnings_are_saved_in_result_and_report(flexcam, engine, tmp_path):
    fast = ("--set", "run.crank_speed=8000rpm", "--set", "run.steps_per_revolution=720")
    warnings = flexcam("run", engine, "-o", tmp_path, *fast, "--json").json["warnings"]
    for word in ("loses contact with its cam", "bounces", "coils of 'valve' touch", "buckling"):
        assert sum(word in message for message in warnings) == 1
    assert list(read_result(tmp_path / "engine.vtkhdf").warnings) == warnings
    assert flexcam("report", tmp_path / "engine.vtkhdf", "-o", tmp_path / "page.html").code == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "loses contact with its cam for" in page
    assert "lost contact for" in page
    assert "The part with the largest motion, spring valve, is no member" in page
    assert "The part with the largest motion, camshaft" not in page


@pytest.mark.slow
def test_lash_that_stays_open_causes_warning(flexcam, tmp_path):
    """A cap between two lashes causes a warning without a spring; a reversed lash causes one after the run."""
    case = new_case("direct-acting", tmp_path / "case.toml")[0]
    cap = [
        'nodes.cap=["55 mm", "-20.1 mm", "0 mm"]', 'supports.cap=["ux", "uz", "rx", "ry", "rz"]',
        'masses.cap={ at = "cap", mass = "5 g" }', 'contacts.lash.to="cap"', 'contacts.lash.gap="0.1 mm"',
        'contacts.shim={ from = "cap", to = "stem-top", direction = "-uy", model = "lash", gap = "0.1 mm" }',
    ]  # fmt: skip
    set_options = [word for override in cap for word in ("--set", override)]
    (warning,) = flexcam("check", case, *set_options, "--json").json["warnings"]
    assert warning.startswith("Warning: masses.cap: only the lashes lash and shim touch it")
    spring = ("--set", 'springs.cap={ at = "cap", direction = "-uy", stiffness = "1 N/mm" }')
    assert flexcam("check", case, *set_options, *spring, "--json").json["warnings"] == []
    coarse = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1", "--json")
    wrong = flexcam("run", case, *coarse, "--name", "wrong", "--set", 'contacts.lash.direction="uy"').json["warnings"]
    right = flexcam("run", case, *coarse).json["warnings"]
    expected = "Warning: lash 'lash' stays open over the revolution: check its gap and the sign of its direction"
    assert (expected in wrong, expected in right) == (True, False)


@pytest.mark.slow
def test_output_of_desmodromic_pair(flexcam, tmp_path):
    """The gap of 9.03 mm is a running clearance of 0.03 mm above the lift; spring and nose force are not printed."""
    case = new_case("desmodromic", tmp_path / "case.toml")[0]
    card = " ".join(flexcam("cam", case).out.partition("Cam closing")[2].split())
    assert "lift 9 mm lobe" in card
    assert "running clearance 0.03 mm" in card
    assert "valve" not in card
    assert "lash" not in card
    checked = " ".join(flexcam("check", case).out.split())
    assert "gap of 9.03 mm from closer to stem-top with both cams on the base circle" in checked
    output = flexcam("run", case, "--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1").out
    assert "Opposed cams drive the follower in turn" in output
    assert "Springs press" not in output
    assert "nose" not in output


def test_metrics_of_desmodromic_pair(flexcam, tmp_path):
    """The rigid train of a pair gives no valve loft; a follower that leaves one cam is in contact with the other."""
    pair = Path(__file__).parents[1] / "golden/models/desmodromic.toml"
    seat = 'contacts.seat={ at = "lower", direction = "uy", model = "seat", stiffness = "50 MN/m" }'
    report = flexcam("run", pair, "-o", tmp_path, "--set", seat, "--json").json
    assert report["train"]["contacts.seat.seating_velocity"] > 0.0
    assert "contacts.seat.valve_loft" not in report["train"]
    assert not [message for message in report["warnings"] if "loses contact" in message]
    assert SPRING_MARGIN not in {figure["name"] for figure in report["figures_of_merit"]}


@pytest.fixture
def direct(tmp_path):
    return new_case("direct-acting", tmp_path / "direct.toml")[0]


@pytest.mark.slow
def test_large_lash_does_not_hide_contact_loss(flexcam, direct, tmp_path):
    """The valve spring acts on the valve only; the bucket is free while the lash is open."""
    words = ("--set", "contacts.lash.gap=8.4mm", "--set", "run.crank_speed=6500rpm", "--set", "run.revolutions=1")
    train = flexcam("run", direct, "-o", tmp_path, *words, "--json").json["train"]
    assert math.degrees(train["contacts.intake.open_on_the_lift"]) > 50.0


@pytest.mark.parametrize("measured", [False, True])
def test_spring_that_opens_valve_causes_warning(flexcam, direct, measured):
    """The measured lift has noise of 0.1 um on the base circle."""
    text = direct.read_text(encoding="utf-8")
    if measured:
        degrees, noise = np.arange(360.0), np.random.default_rng(1).normal(0.0, 1e-4, 360)
        lift = 8.5 * np.maximum(np.cos(np.radians(degrees - 66.0)), 0.0) ** 2.5 + noise
        np.savetxt(
            direct.with_name("lift.csv"), np.c_[degrees, lift], "%.6f", ",", header="cam_deg,lift_mm", comments=""
        )
        law = text[text.index('law = { id = "fb2"') : text.index("base_radius")]
        text = text.replace(law, 'lift_table = "lift.csv"\nphase = "168 deg"\n')
    at = text.index('direction = "-uy"', text.index("[springs.valve]"))
    direct.write_text(text[:at] + text[at:].replace('"-uy"', '"uy"', 1), encoding="utf-8")
    (warning,) = (
        message for message in flexcam("check", direct, "--json").json["warnings"] if "contacts.seat" in message
    )
    assert "nothing holds the valve on its seat" in warning
    assert "check the direction and installed_force of the spring that closes the valve" in warning
    assert "the temperature" not in warning


@pytest.mark.parametrize("reversed_part", ["springs.valve.direction=uy", "loads.gas.direction=-uy"])
def test_spring_or_gas_that_opens_valve_causes_warning(reversed_part, flexcam, tmp_path):
    """At the start the gas load of the table presses the valve on its seat."""
    case = new_case("exhaust-valve", tmp_path / "case.toml")[0]
    done = flexcam("check", case, "--set", reversed_part, "--json")
    assert any("nothing holds the valve on its seat" in warning for warning in done.json["warnings"])


@pytest.mark.parametrize(("overrides", "cause"), [
    (['materials.steel.expansion="12e-6 1/K"', "members.pushrod.temperature=80K"], "the temperature of the members"),
    (['loads.gas={ at = "valve", direction = "uy", force = "900 N" }'], "the direction of the loads"),
])  # fmt: skip
def test_warning_names_cause_of_open_seat(overrides, cause, flexcam, tmp_path):
    """1.6 * 250 mm * 12e-6/K * 80 K = 0.38 mm, reduced by the lash of 0.2 mm; 900 N against 400 N."""
    (case,) = new_case("pushrod-engine", tmp_path / "engine.toml")
    words = [word for override in overrides for word in ("--set", override)]
    (warning,) = (
        message for message in flexcam("check", case, *words, "--json").json["warnings"] if "contacts.seat" in message
    )
    assert cause in warning


@pytest.mark.parametrize(("override", "warned"), [
    ("run.revolutions=1", True), ("run.revolutions=2", False), ("fidelity.model=rigid", False),
])  # fmt: skip
def test_short_run_warns_of_start_transient(override, warned, flexcam, tmp_path):
    """A rigid train follows the cam angle for any start."""
    new_case("lumped-train", tmp_path / "train.toml")
    quick = ("--set", "run.revolutions=1", "--set", "run.steps_per_revolution=360", "--set", override)
    out = flexcam("run", tmp_path / "train.toml", "-o", tmp_path, *quick).out
    assert ("Fewer than two revolutions" in out) is warned


@pytest.mark.slow
def test_adjuster_transient_causes_warning(flexcam):
    """One revolution from rest causes the warning, a periodic start does not; two revolutions give their difference."""
    case = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
    quick = ("--set", "run.steps_per_revolution=360", "--overwrite", "--json")
    once = flexcam("run", case, *quick, "--set", "run.revolutions=1").json
    assert "revolution_change" not in once
    assert any(
        "may still be in a transient: the run has only one revolution" in message for message in once["warnings"]
    )
    twice = flexcam("run", case, *quick, "--set", "run.revolutions=2").json
    assert 0.0 < twice["revolution_change"]["motion"] < 1e-3
    assert twice["revolution_change"]["contact"] == "intake"
    assert not any("transient" in message for message in twice["warnings"])
    few = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=2")
    assert "Difference between the last two revolutions:" in flexcam("run", case, *few, "--overwrite").out
    pumping = check_transient(prepare(read_case(case)), RevolutionChange(0.02, 0.1, "intake"))
    words = "difference between its last two revolutions: motion 2 % of its range, force of contact intake 10 %"
    assert f"{words} (rms of the difference during the lift, relative to the rms of the force)" in pumping[0]


@pytest.mark.slow
def test_steps_too_long_for_seat_impact_cause_warning(flexcam):
    """The force of a 60 MN/m seat under 90 g has its maximum after 60 us, two of 720 steps at 4142 rpm."""
    case = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"
    quick = ("--set", "run.crank_speed=4142rpm", "--set", "run.steps_per_revolution=720", "--json")
    warnings = flexcam("run", case, *quick).json["warnings"]
    assert any(
        re.search(r"force of contact seat comes from an impact that lasts only \d time steps?", message)
        for message in warnings
    )


def test_contact_duration_of_permanently_closed_contact():
    closed = np.array([False, False, True, True, True, True])
    assert contact_duration(closed, 3) == 3
    assert contact_duration(np.append(closed, False), 3) == 3
    assert contact_duration(np.append(closed[:4], False), 3) == 2
    assert contact_duration(closed[2:], 1) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("friction", "name"), [("0", "mean drive power (model without friction)"), ("0.1", "mean drive power")]
)
def test_drive_power_without_friction_is_labelled(flexcam, engine, friction, name):
    few = ["run.steps_per_revolution=360", "run.revolutions=1", f"contacts.intake.friction={friction}"]
    out = flexcam("run", engine, *(word for override in few for word in ("--set", override))).out
    assert f"\n{name}    " in out


@pytest.mark.slow
def test_figures_of_merit_are_not_repeated_as_metrics(flexcam, engine, tmp_path):
    """They are metrics of the run with the names used in practice; the table of metrics lists the others."""
    options = ("--set", "run.steps_per_revolution=1440", "-o", tmp_path, "--overwrite")
    report = flexcam("run", engine, *options, "--json").json
    merit = {figure["metric"]: figure for figure in report["figures_of_merit"]}
    margin = merit.pop("")
    assert (margin["name"], margin["part"], margin["unit"]) == ("spring margin of the rigid train", "", "1")
    assert {name: figure["value"] for name, figure in merit.items()}.items() <= report["train"].items()
    assert merit["contacts.seat.valve_loft"]["unit"] == "m"
    response = run(read_case(engine, ["run.steps_per_revolution=1440"]))  # the same in Python
    assert response.metrics == report["train"]
    with pytest.raises(InputError, match=r"Did you mean 'contacts\.seat\.bounces'"):
        assert response.metrics["contacts.seat.bounce"]
    with pytest.raises(InputError, match="without its model"):
        assert read_result(report["result"]).response.metrics
    out = flexcam("run", engine, *options).out
    table, others = out.split("Figures of merit")[1].split("Metrics of the last revolution")
    for words in (
        "seating velocity",
        "mean drive power (model without friction)",
        "coil-bind clearance",
        "spring margin of the rigid train",
    ):
        assert f"\n{words}   " in table
    assert max(map(len, table.splitlines())) <= 100
    assert not [name for name in merit if name.replace(".", " ").replace("_", " ") in others]
    assert "contact intake: max force" in others


@pytest.mark.slow
def test_metrics_of_part_of_revolution_are_marked(flexcam, engine):
    """Means over a part of a revolution are no means; a lash may still close."""
    few = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=0.15", "-o", "out", "--overwrite")
    out = flexcam("run", engine, *few).out
    assert "Figures of merit, first 0.15 revolutions" in out
    assert "Metrics of the first 0.15 revolutions" in out
    assert "stays open" not in out
    report = flexcam("run", engine, *few, "--json").json
    assert report["metrics_of"] == "first 0.15 revolutions"
    assert "supports.drive.torque.largest" in report["train"]
    assert not [name for name in report["train"] if name.endswith(".mean")]
    assert flexcam("report", "out/engine.vtkhdf").code == 0
    assert "Metrics of the first 0.15 revolutions" in Path("out/engine.html").read_text(encoding="utf-8")


COIL_SPRING = 'springs.valve={ at = "valve", direction = "uy", installed_force = 400, '
COIL_SPRING += "wire = { diameter = 4.6e-3, shear_modulus = 79e9 }, "
COIL_SPRING += "coils = [{ turns = 6, diameter = 28e-3, pitch = 8e-3 }] }"


@pytest.mark.parametrize(
    ("override", "warning"),
    [
        (
            "springs.valve.clash_travel=9mm",
            "spring 'valve' reaches coil bind before full lift: full lift needs 0.88 mm more clash_travel",
        ),
        (COIL_SPRING, "mm more travel; give its coils more turns or pitch"),
        ("contacts.lash.gap=0.6mm", "the lash of 0.375 mm at the follower exceeds the ramp height of 0.3 mm"),
        ("contacts.lash.gap=0.2m", "the lash of 125 mm at the follower exceeds the lift of 6.3 mm"),
        ('supports.drive=["ux", "uy", "uz"]', "cams.intake: nothing drives the shaft, and contact forces turn it"),
        ("run.crank_speed=4000", "4000 rad/s is unusual"),
        ("run.speed=2500rpm", "run.speed is the speed of the camshaft; the crankshaft turns at 5000 rpm"),
    ],
)
def test_check_warnings(override, warning, flexcam):
    """Full lift: 1.6 * 6.3 mm - 0.2 mm = 9.88 mm; lash at the follower: 0.6 mm / 1.6 = 0.375 mm."""
    new_case("pushrod-engine", Path("engine.toml"))
    done = flexcam("check", "engine.toml", "--set", override)
    assert warning in re.sub(r"\s+", " ", done.out + done.err)
    assert (done.out + done.err).count("did you mean 4000 rpm") == (override == "run.crank_speed=4000")


def test_check_warns_of_shaft_without_supports(engine, flexcam):
    """The rigid model needs no equilibrium of a train that nothing holds, whose search takes seconds."""
    done = flexcam("check", engine, "--set", "supports={}", "--set", "fidelity.model=rigid")
    message = "nothing holds the shaft, and contact forces push it away; add supports: bearings of the"
    assert message in re.sub(r"\s+", " ", done.out + done.err)


@pytest.mark.parametrize(("every", "low"), [(200, True), (1, False)])
def test_coarse_saved_instants_warn_of_missed_peak_stress(flexcam, tayeb, every, low):
    """The run saves steps 0, 200 and 360, none near the nose, where the compression has its maximum."""
    few = ["run.steps_per_revolution=360", "run.revolutions=1", f"output.field_every={every}"]
    done = flexcam("run", tayeb(3), *(word for override in few for word in ("--set", override)))
    output = re.sub(r"\s+", " ", done.out)
    assert ("The peak stress may be missed: at these instants the " in output) == low
    assert "Stresses at 3 saved" in output or not low


def test_check_warns_of_soft_seat_and_offset_follower(engine, flexcam):
    text, before = engine.read_text(encoding="utf-8"), " ".join(flexcam("check", engine).out.split())
    for old, new, warning in (
        ('"60 MN/m"', '"60 kN/m"', "contacts.seat: the closed valve sinks 0.261 mm into its seat"),
        ('stiffness = "hertz"', 'stiffness = "20 kN/m"', "the follower sinks"),
        ('cam = ["120 mm"', 'cam = ["150 mm"', "node tappet is 30 mm from the cam along the shaft"),
    ):
        assert warning not in before
        engine.write_text(text.replace(old, new), encoding="utf-8")
        assert warning in " ".join(flexcam("check", engine).out.split())


def test_stress_warning_names_slowly_decaying_mode(engine, flexcam):
    """Rayleigh damping: the amplitude decays by exp(-beta omega^2 t / 2); a camshaft revolution takes 24 ms."""
    output = " ".join(flexcam("run", engine, "--set", "run.revolutions=2").out.split())
    pattern = r"member pushrod \(bending in x-y, (\S+) Hz\) decays to 37 % of its amplitude in (\S+) rev"
    hertz, turns = map(float, re.search(pattern, output).groups())
    assert hertz == pytest.approx(305.3, abs=0.1)
    assert turns == pytest.approx(2.0 / (1e-7 * (2.0 * math.pi * hertz) ** 2) / 24e-3, rel=5e-3)
    few = ("--set", "run.revolutions=2", "--set", "run.steps_per_revolution=720")
    damped = flexcam("run", engine, *few, "--set", "run.damping.beta=1e-4 s", "--name", "damped")
    assert "decays to 37 %" not in damped.out
    undamped = flexcam("run", engine, *few, "--set", "run.damping.beta=0 s", "--name", "u")
    output = " ".join(undamped.out.split())
    assert "is not damped, so the motion never repeats: add damping, such as run.damping.modal" in output
    assert "Run more revolutions until the values repeat" not in output
