"""A stiff train against the rigid equation F = M s'' w^2 + k s + F0, and loss of contact between follower and cam.

A rigid follower separates where F passes zero and flies with M u'' = -(F0 + k u); a bilateral contact pulls instead. R.
L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 10 (force-closed cams); H. A. Rothbart, Cam Design
Handbook (2004), ch. 12 (jump).
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from flexcam import build_model, prepare, read_case, run
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.run_checks import check_input
from flexcam.analysis.run_metrics import compute_margins
from flexcam.case.input_checks import check_shared_seat_load

SOURCE = "Rigid follower"
MASS, SPRING, INSTALLED = 0.5, 20e3, 300.0
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
[materials.stiff]
E = "200000 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = { shape = "circle", diameter = "40 mm" }
[members]
camshaft = { nodes = ["drive", "cam"], material = "stiff", section = "thick" }
pushrod = { nodes = ["tappet", "top"], material = "stiff", section = "thick" }
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
[masses]
follower = { at = "tappet", mass = "0.5 kg" }
[springs]
valve = { at = "tappet", direction = "uy", stiffness = "20 kN/m", installed_force = "300 N" }
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "10 mm"
rise = "90 deg"
return = "90 deg"
phase = "20 deg"
[contacts]
intake = { cam = "intake", follower = "tappet", model = "unilateral", stiffness = "2 GN/m" }
[run]
speed = "600 rpm"
revolutions = 0.56
steps_per_revolution = 3600
start = "equilibrium"
[output]
probes = ["tappet"]
"""
RODS = math.pi * 0.02**2 * 0.05
"""Mass of the pushrod, kg: 1 kg/m^3."""


@pytest.fixture(scope="module")
def make_train(tmp_path_factory):
    """Return a function that builds case and lift for a speed in rad/s."""
    path = tmp_path_factory.mktemp("rigid") / "train.toml"
    path.write_text(CASE, encoding="utf-8")

    def make(speed, *more):
        case = read_case(path, [f"run.speed={speed * 30.0 / math.pi!r} rpm", *more])
        return case, build_model(case).cams["intake"].event

    return make


BILATERAL = "contacts.intake={ cam = 'intake', follower = 'tappet', model = 'bilateral', stiffness = '2 GN/m' }"
M = MASS + RODS


def rigid_force(event, angle, speed):
    """Return the force of the rigid train."""
    s, bend = (event(np.atleast_1d(angle), order) for order in (0, 2))
    return M * bend * speed**2 + SPRING * s + INSTALLED


ANGLES = np.linspace(0.0, 2.0 * math.pi, 14401)


def jump_speed(event):
    """Return the minimum speed at which the rigid train loses contact."""
    s, bend = event(ANGLES, 0), event(ANGLES, 2)
    down = bend < 0.0
    return math.sqrt(float(np.min((SPRING * s + INSTALLED)[down] / (-M * bend[down]))))


@pytest.mark.parametrize("part", [0.5, 0.98])
def test_contact_force_below_jump_speed(record, make_train, part):
    """Below the jump speed the contact force of the stiff train equals that of the rigid train."""
    event = make_train(1.0)[1]
    speed = part * jump_speed(event)
    response = run(make_train(speed)[0])
    force = response.channels["contacts.intake.force"]
    rigid = rigid_force(event, response.angle, speed)
    record(source=SOURCE, case=f"{part} of the speed of jump", quantity="largest error of the contact force", unit="N",
           reference=0.0, computed=np.abs(force - rigid).max(), tolerance=2e-3 * rigid.max(), absolute=True,
           reason="follower on its contact: omega^2 M/k of s'''' and the ring of the starts of s''', 1e-3")  # fmt: skip
    assert force.min() > 0.0


@pytest.mark.parametrize("part", [0.99, 1.01])
def test_contact_loss_at_jump_speed(make_train, part):
    """Below the jump speed the contact stays closed throughout the lift; above it there is a flight."""
    event = make_train(1.0)[1]
    speed = part * jump_speed(event)
    force = run(make_train(speed, "run.revolutions=0.35")[0]).channels["contacts.intake.force"]
    assert (force.min() > 0.0) == (part < 1.0)


@pytest.mark.parametrize("part", [1.15, 1.5])
def test_separation_and_landing_angles(record, make_train, part):
    """The follower separates where the rigid force passes zero, and lands where the free flight meets the lift."""
    event = make_train(1.0)[1]
    speed = part * jump_speed(event)
    response = run(make_train(speed)[0])
    force, angle = response.channels["contacts.intake.force"], response.angle
    rigid = rigid_force(event, ANGLES, speed)
    first = int(np.argmax(rigid < 0.0))
    parting = brentq(lambda a: float(rigid_force(event, a, speed)[0]), ANGLES[first - 1], ANGLES[first])
    open_ = np.flatnonzero((force == 0.0) & (angle > 0.1))
    record(source=SOURCE, case=f"{part} of the speed of jump", quantity="angle of parting", unit="deg",
           reference=math.degrees(parting), computed=math.degrees(angle[open_[0]]), tolerance=0.25, absolute=True,
           reason="steps of 0.1 deg; M s'' w^2/k of its own depression at the contact")  # fmt: skip
    w = math.sqrt(SPRING / M)
    s, v = (float(event(np.array([parting]), order)[0]) for order in (0, 1))
    middle = -INSTALLED / SPRING

    def above(a):
        t = (a - parting) / speed
        flight = middle + (s - middle) * math.cos(w * t) + v * speed / w * math.sin(w * t)
        return flight - float(event(np.array([a]), 0)[0])

    after = np.linspace(parting + 0.02, parting + 4.0, 2000)
    heights = np.array([above(a) for a in after])
    i = int(np.argmax(heights < 0.0))
    landing = brentq(above, after[i - 1], after[i])
    closed = angle[open_[0] :][force[open_[0] :] > 0.0][0]
    record(source=SOURCE, case=f"{part} of the speed of jump", quantity="angle of landing", unit="deg",
           reference=math.degrees(landing), computed=math.degrees(closed), tolerance=0.4, absolute=True,
           reason="what the parting misses, over the flight")  # fmt: skip
    highest = max(above(a) for a in np.linspace(parting, landing, 400))
    record(source=SOURCE, case=f"{part} of the speed of jump", quantity="largest gap", unit="m", reference=highest,
           computed=response.channels["contacts.intake.gap"][(angle > parting) & (angle < landing)].max(),
           tolerance=0.03,
           reason="goes with the square of what the parting misses")  # fmt: skip


@pytest.mark.parametrize("part", [1.15, 1.5])
def test_bilateral_contact_force(record, make_train, part):
    """The equation holds beyond separation, with the negative force of a closed cam track."""
    event = make_train(1.0)[1]
    speed = part * jump_speed(event)
    response = run(make_train(speed, BILATERAL)[0])
    rigid = rigid_force(event, response.angle, speed)
    force = response.channels["contacts.intake.force"]
    record(source=SOURCE, case=f"bilateral, {part} of the speed of jump", quantity="largest error of the force",
           unit="N", reference=0.0, computed=np.abs(force - rigid).max(), tolerance=5e-3 * np.abs(rigid).max(),
           absolute=True, reason="follower on its contact, as above")  # fmt: skip
    assert force.min() == pytest.approx(rigid.min(), rel=0.02)
    assert force.min() < 0.0


@pytest.mark.parametrize("model", ["unilateral", "bilateral"])
def test_rigid_model_matches_equation(make_train, model):
    """The rigid model has no unknowns: the force is exact to rounding, negative where the cam would have to pull."""
    event = make_train(1.0)[1]
    speed = 1.5 * jump_speed(event)
    case = make_train(speed, *([BILATERAL] if model == "bilateral" else []))[0]
    response = run(case, rigid=True)
    rigid = rigid_force(event, response.angle, speed)
    force = response.channels["contacts.intake.force"]
    np.testing.assert_allclose(force, rigid, atol=1e-9 * rigid.max())
    np.testing.assert_allclose(
        response.channels["contacts.intake.torque"], rigid * event(response.angle, 1), atol=1e-11 * rigid.max()
    )
    np.testing.assert_allclose(response["tappet.uy"].displacement, event(response.angle, 0), atol=1e-15)
    acceleration = event(response.angle, 2) * speed**2
    np.testing.assert_allclose(response["tappet.uy"].acceleration, acceleration, atol=1e-9 * speed**2)


@pytest.mark.parametrize("rigid", [False, True], ids=["stiff", "rigid"])
def test_modal_damping_of_train_on_spring(record, make_train, rigid):
    """As members stiffen, one mode remains, the train on its spring, with the damper 2 zeta sqrt(k m)."""
    speed = 10.0 * math.pi
    case, event = make_train(speed, "run.damping={ modal = 0.2 }")
    response = run(case, rigid=rigid)
    damped = 0.4 * math.sqrt(SPRING * M) * event(response.angle, 1) * speed
    expected = rigid_force(event, response.angle, speed) + damped
    record(source=SOURCE, case=f"modal damping of 20 %, {'rigid' if rigid else 'stiff'} train",
           quantity="largest error of the contact force", unit="N", reference=0.0,
           computed=np.abs(response.channels["contacts.intake.force"] - expected).max(),
           tolerance=1e-3 * damped.max(), absolute=True,
           reason="the follower's own depression at its contact; damping is 3.5 % of the force")  # fmt: skip


ROCKERS = {"ratio": "lumped'", "lever": "lever', stiffness = '1 GN/m'"}


@pytest.mark.parametrize("play", [None, 0.0, 2e-4])
@pytest.mark.parametrize("rocker", ROCKERS.values(), ids=ROCKERS)
def test_modal_damping_on_both_sides_of_lash(make_train, rocker, play):
    """Contacts are in no mode: a valve behind a lash has its own mode, without lash train and valve share one.

    A lever of 30 and 45 mm moves the valve by 1.5 of the lift s and turns by asin(s/30 mm); the mode uses the installed
    position.
    """
    inertia, valve, back, ratio, speed = 0.1, 0.2, 30e3, 1.5, 10.0 * math.pi
    more = [
        f"rockers.rocker={{ from = 'top', to = 'valve', direction = 'uy', arms = [0.03, 0.045], model = '{rocker} }}",
        f"rockers.rocker.inertia={inertia * 0.03**2}",
        f"masses.valve={{ at = 'valve', mass = {valve} }}",
        f"springs.back={{ at = 'valve', stiffness = {back}, installed_force = 100.0, direction = 'uy' }}",
    ]
    if play is not None:
        more.append(f"contacts.lash={{ at = 'rocker', model = 'lash', gap = {play}, stiffness = '1 GN/m' }}")
    if play:  # without a seat the valve spring would close it
        more.append("contacts.seat={ at = 'valve', model = 'seat', stiffness = '1 GN/m' }")
    cases, event = (
        [make_train(speed, *more, f"run.damping={{ modal = {one} }}")[0] for one in (0.0, 0.2)],
        make_train(1.0)[1],
    )
    free, damped = (run(one, rigid=True) for one in cases)
    s, slope = (event(free.angle, order) for order in (0, 1))
    turned = 1.0 / np.sqrt(1.0 - (s / 0.03) ** 2) if "lever" in rocker else np.ones_like(s)
    behind = np.where(ratio * s > (play or 0.0), ratio**2, 0.0)
    moved, total_mass, stiffness, beyond = M + inertia * turned, M + inertia, SPRING, math.sqrt(back * valve) * behind
    if play is None:
        moved, total_mass, beyond = moved + behind * valve, total_mass + ratio**2 * valve, 0.0
        stiffness += ratio**2 * back
    expected = 0.4 * (math.sqrt(stiffness * total_mass) * (moved / total_mass) ** 2 + beyond) * slope * speed
    added = damped.channels["contacts.intake.force"] - free.channels["contacts.intake.force"]
    np.testing.assert_allclose(added, expected, atol=1e-9 * expected.max())


def test_seat_carries_closed_valve_without_lash(make_train):
    """Without lash only stiffness divides the load of cam and seat: at zero lift the rigid model has it on the seat."""
    case, event = make_train(30.0, SEAT_CONTACT)
    response = run(case, rigid=True)
    lift, force = event(response.angle, 0), response.channels["contacts.intake.force"]
    lifted = lift > 1e-10
    np.testing.assert_allclose(force[lifted], rigid_force(event, response.angle, 30.0)[lifted], rtol=1e-9)
    assert not force[lift == 0.0].any()


SEAT_CONTACT = "contacts.seat={ at = 'tappet', direction = 'uy', model = 'seat', stiffness = '60 MN/m' }"


def test_shared_seat_load_causes_warning(make_train):
    made = make_train(30.0, SEAT_CONTACT)[0]
    (warning,) = check_shared_seat_load(build_model(made))
    assert f"share the {INSTALLED:g} N of the springs" in warning
    ready = prepare(make_train(30.0, SEAT_CONTACT, "fidelity.model=rigid")[0])
    assert check_input(ready).count(warning) == 1
    assert warning not in check_input(prepare(made))  # the flexible train resolves it
    assert not check_shared_seat_load(build_model(make_train(30.0)[0]))


GAP, OIL = "lash', gap = {}, stiffness = '1 GN/m'", "lash-adjuster', stiffness = 1e9, leak = 1e6, refill = 500"


@pytest.mark.parametrize(
    ("play", "known"),
    [(GAP.format(0.0), False), (GAP.format(1e-4), True), (f"{OIL}, plunger_force = 20", True)],
    ids=["no gap", "gap", "adjuster"],
)
def test_lash_determines_seat_load(make_train, play, known):
    more = [
        "rockers.rocker={ model = 'lumped', from = 'top', to = 'valve', arms = [0.03, 0.03] }",
        "masses.valve={ at = 'valve', mass = 0.2 }",
        "springs.back={ at = 'valve', stiffness = 30e3, installed_force = 100.0, direction = 'uy' }",
        f"contacts.lash={{ at = 'rocker', model = '{play} }}",
        "contacts.seat={ at = 'valve', model = 'seat', stiffness = '1 GN/m' }",
    ]
    assert bool(check_shared_seat_load(build_model(make_train(30.0, *more)[0]))) != known


def test_limits_include_jump_speed_of_rigid_train(record, make_train):
    """`flexcam limits` finds no loss of contact 2 % below the speed of the rigid train, and one 6 % above."""
    event = make_train(1.0)[1]
    expected = jump_speed(event)
    soft = "contacts.intake={ cam = 'intake', follower = 'tappet', model = 'unilateral', stiffness = '100 MN/m', "
    case = make_train(expected, "run.steps_per_revolution=720", soft + "dissipation = '5 s/m' }")[0]
    found = find_limits(case, Search(0.98 * expected, 1.06 * expected, tolerance=0.01 * expected))
    rpm, rigid_rpm = expected * 30.0 / math.pi, compute_margins(case).rigid_rpm
    record(source=SOURCE, case="limits", quantity="speed of jump of the rigid train", unit="rpm", reference=rpm,
           computed=rigid_rpm, tolerance=1e-5, reason="the least is sought on angles 0.05 deg apart")  # fmt: skip
    loss = found.limits["loss_of_contact"]
    assert 0.98 * rpm < loss.rpm <= 1.06 * rpm
    assert loss.tolerance_rpm <= 0.01 * rpm
    assert loss.words.endswith("(intake, nose)")


@pytest.mark.parametrize(
    ("key", "more"),
    [
        ("loads.push={ at = 'tappet', direction = '-uy', force = 100.0 }", lambda v: 100.0),
        ("run.gravity=[0, '-100 m/s^2', 0]", lambda v: 100.0 * M),
        ("springs.valve.damping=100.0", lambda v: 100.0 * v),
        ("run.damping={ alpha = 200.0, beta = 0.002 }", lambda v: (200.0 * M + 0.002 * SPRING) * v),
    ],
)
def test_rigid_model_includes_all_forces(make_train, key, more):
    """Weight, loads and dampers act on the rigid train as on the flexible one."""
    case, event = make_train(60.0, key)
    flexible, rigid = run(case), run(case, rigid=True)
    expected = rigid_force(event, rigid.angle, 60.0) + more(event(rigid.angle, 1) * 60.0)
    force = flexible.channels["contacts.intake.force"]
    np.testing.assert_allclose(force, expected, atol=5e-3 * expected.max())  # also valid for the flexible train
    np.testing.assert_allclose(rigid.channels["contacts.intake.force"], expected, atol=1e-6 * expected.max())


@pytest.mark.parametrize("rigid", [False, True], ids=["stiff", "rigid"])
@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("kind", ["touching coils", "pulsation"])
def test_coil_clash_and_pulsation_of_spring(make_train, kind, parts, rigid):
    """Beyond 6 mm n coils touch, each with its share of the travel: kc/n. Pulsation acts at any lift."""
    key = {
        "touching coils": "springs.valve.clash_travel=6 mm",
        "pulsation": "springs.valve.pulsation={ order = 3, amplitude = 0.2, phase = 0.5 }",
    }[kind]
    more = [f"springs.valve.elements={parts}", "springs.valve.clash_stiffness=2e6"][: 2 if "clash" in key else 1]
    more += ["springs.valve.mass=1e-6"] if parts > 1 else []
    case, event = make_train(math.pi, key, *more)
    response = run(read_case(case.path, [*case.overrides, "run.steps_per_revolution=360"]), rigid=rigid)
    s, angle = event(response.angle, 0), response.angle
    added = 0.2 * SPRING * np.cos(3.0 * angle + 0.5) * s
    if kind == "touching coils":
        added = 2e6 / parts * np.maximum(s - 6e-3, 0.0)
    expected = rigid_force(event, angle, math.pi) + added
    force = response.channels["contacts.intake.force"]
    # A contact of 2 GN/m deforms by 4 um under 8 kN, on coils of 2 MN/m.
    np.testing.assert_allclose(force, expected, atol=1e-3 if rigid else 3e-3 * expected.max())
    assert np.abs(added).max() > 0.05 * expected.max()


def test_coil_bind_of_rigid_train_causes_warning(make_train):
    """At 12 mm of lift, 2 mm beyond, check and run give the warning of a flexible run."""
    keys = ["cams.intake.lift=12 mm", "springs.valve.elements=4", "springs.valve.mass=0.01", "fidelity.model=rigid"]
    warnings = [
        check_input(prepare(make_train(30.0, *keys, f"springs.valve.clash_travel={mm} mm")[0])) for mm in (10, 13)
    ]
    assert [[one for one in each if "coil bind" in one] for each in warnings] == [
        ["Warning: spring 'valve' reaches coil bind before full lift: full lift needs 2 mm more clash_travel"], [],
    ]  # fmt: skip


def test_jump_speed_includes_loads_but_no_dampers(make_train):
    """A steady push closes the contact; dampers are neither inertia nor spring, at any speed of the case."""
    event = make_train(1.0)[1]
    case = make_train(
        60.0, "loads.push={ at = 'tappet', direction = '-uy', force = 100.0 }", "springs.valve.damping=100.0"
    )
    s, bend = event(ANGLES, 0), event(ANGLES, 2)
    down = bend < 0.0
    expected = math.sqrt(float(np.min((SPRING * s + INSTALLED + 100.0)[down] / (-M * bend[down]))))
    assert compute_margins(case[0]).rigid_rpm == pytest.approx(expected * 30.0 / math.pi, rel=1e-5)
