"""Lash before and behind a lever of a rigid train, against the kinematics of its arms, balance, and a stiff train.

The part behind a lash is at rest until the part before it closes the gap: on its seat, on its springs, or on the part
before it if springs have closed the lash already. Then both move together. A lever turned by phi from its installed
angles moves its ends by a1 (sin(b1 + phi) - sin b1) and a2 (sin(b2 + phi) - sin b2); by virtual work the cam force
includes the parts behind closed lashes (R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 8 and
17).
"""

import math

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, Problem, equilibrium, solve

CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.05, 0.0]
bottom = [0.02, 0.06, 0.0]
end = [0.02, 0.08, 0.0]
[materials.stiff]
E = "20000 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "40 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
lower = {{ nodes = ["tappet", "top"], material = "stiff", section = "thick" }}
upper = {{ nodes = ["bottom", "end"], material = "stiff", section = "thick" }}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
bottom = ["ux", "uz", "ry", "rx", "rz"]
end = ["ux", "uz", "ry", "rx", "rz"]
[masses]
tappet = {{ at = "tappet", mass = 0.05 }}
rod = {{ at = "end", mass = 0.05 }}
valve = {{ at = "valve", mass = 0.1 }}
[springs]
tappet = {{ at = "tappet", direction = "uy", stiffness = 1e3, installed_force = 10 }}
rod = {{ at = "end", direction = "uy", stiffness = 500, installed_force = {rod} }}
valve = {{ at = "valve", direction = "uy", stiffness = 30e3, installed_force = {valve} }}
[rockers.rocker]
{rocker}
from = "end"
to = "valve"
arms = ["30 mm", "45 mm"]
inertia = 2e-5
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "6 mm"
rise = "90 deg"
return = "90 deg"
phase = "20 deg"
[contacts]
intake = {{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = 5e9 }}
{contacts}
[run]
speed = "1 rpm"
revolutions = 0.6
steps_per_revolution = 720
[output]
probes = ["tappet", "end", "valve"]
"""
ROCKERS = {"ratio": 'model = "lumped"', "lever": 'model = "lever"\nstiffness = 5e8\nangles = [-0.15, 0.1]'}
NEAR_LASH = 'near = {{ from = "top", to = "bottom", direction = "uy", model = "lash", gap = {}, stiffness = 5e8 }}'
FAR_LASH = 'far = {{ at = "rocker", model = "lash", gap = {}, stiffness = 5e8 }}'
ADJUSTER = """near = { from = "top", to = "bottom", direction = "uy", model = "lash-adjuster", stiffness = 5e8, \
leak = 1e9, refill = 50, plunger_force = 20 }"""
PARALLEL_LASH = (
    'beside = { from = "top", to = "bottom", direction = "uy", model = "lash", gap = 1e-4, stiffness = 5e8 }'
)
ROD_SEAT = 'rod = { at = "end", direction = "uy", model = "seat", stiffness = 5e9 }'
SEAT = 'seat = { at = "valve", model = "seat", stiffness = 5e9 }'


@pytest.fixture
def make_train(tmp_path):
    def make(rocker, *contacts, rod=0.0, valve=300.0):
        path = tmp_path / "plays.toml"
        text = CASE.format(rocker=ROCKERS[rocker], contacts="\n".join(contacts), rod=rod, valve=valve)
        path.write_text(text, encoding="utf-8")
        return read_case(path)

    return make


def lever_motion(driven):
    """Return the displacement of the lever tip and its derivative by that of the driven end."""
    (a1, a2), (b1, b2) = (0.03, 0.045), (-0.15, 0.1)
    angle = np.arcsin(math.sin(b1) + driven / a1)
    return a2 * (np.sin(b2 + angle - b1) - math.sin(b2)), a2 * np.cos(b2 + angle - b1) / (a1 * np.cos(angle))


@pytest.mark.parametrize("swapped", [False, True], ids=["near first", "far first"])
@pytest.mark.parametrize(("near", "far"), [(3e-4, 0.0), (0.0, 4e-4), (3e-4, 4e-4)])
def test_lever_between_two_lashes(make_train, near, far, swapped):
    """The driven end is at rest until the lash before it closes, the valve until the lash behind it closes as well."""
    plays = [NEAR_LASH.format(near), FAR_LASH.format(far)]
    case = make_train("lever", *plays[:: -1 if swapped else 1], SEAT, rod=0.0)
    response = run(case, rigid=True)
    s = build_model(case).cams["intake"].event(response.angle, 0)
    driven = np.maximum(s - near, 0.0)
    tip, slope = lever_motion(driven)
    valve = np.maximum(tip - far, 0.0)
    force = 10.0 + 1e3 * s + 500.0 * driven + np.where(valve > 0.0, slope * (300.0 + 30e3 * valve), 0.0)
    found = response.channels["contacts.intake.force"]
    np.testing.assert_allclose(response["end.uy"].displacement, driven, atol=1e-15)
    np.testing.assert_allclose(response["valve"].displacement, valve, atol=1e-15)
    # inertia at 1 rpm: 0.5 kg at the cam times 7.5 h (w/beta)^2 is below 1 mN
    np.testing.assert_allclose(found, force, atol=1e-3)


DEGREES = (5.0, 30.0, 40.0, 45.0, 60.0, 110.0, 170.0, 195.0)


def flexible_equilibria(case):
    """Return forces, torques and displacements of the flexible train in equilibrium at some cam angles."""
    ready, found = prepare(case), []
    for degrees in DEGREES:
        drive = ConstantSpeed(case.speed, math.radians(degrees))
        system = ready.problem.system
        still = solve(Problem(system, drive, 1e-6, 1, equilibrium(system, drive)), ready.scheme)
        channels = [still.channels[f"contacts.intake.{one}"][0] for one in ("force", "torque")]
        found.append([*channels, *(still[one].displacement[0] for one in ("tappet.uy", "end.uy", "valve"))])
    return np.array(found)


ARRANGEMENTS = {
    "play before it, seat": ([NEAR_LASH.format(3e-4), SEAT], 5.0, 300.0),
    "play behind it, seat": ([NEAR_LASH.format(0.0), FAR_LASH.format(4e-4), SEAT], 5.0, 300.0),
    "both, seat": ([FAR_LASH.format(4e-4), NEAR_LASH.format(3e-4), SEAT], 5.0, 300.0),
    "both, springs close them": ([NEAR_LASH.format(3e-4), FAR_LASH.format(4e-4)], 5.0, 300.0),
    "both, springs end before": ([NEAR_LASH.format(3e-4), FAR_LASH.format(4e-4)], 0.05, 6.0),
    "a narrower one beside it": ([NEAR_LASH.format(3e-4), PARALLEL_LASH, FAR_LASH.format(4e-4), SEAT], 5.0, 300.0),
    "both, seat under the rod": ([NEAR_LASH.format(3e-4), FAR_LASH.format(4e-4), ROD_SEAT], 5.0, 300.0),
    "adjuster closes the play behind": ([ADJUSTER, FAR_LASH.format(4e-4), SEAT], 5.0, 300.0),
}
QUICK = ("play before it, seat", "both, seat", "both, springs end before", "both, seat under the rod")


@pytest.mark.parametrize(
    ("name", "rocker"),
    [
        ("play before it, seat", "lever"),
        *((name, "ratio") for name in QUICK),
        *(pytest.param(name, "lever", marks=pytest.mark.slow) for name in ARRANGEMENTS if "play before" not in name),
        *(pytest.param(name, "ratio", marks=pytest.mark.slow) for name in ARRANGEMENTS if name not in QUICK),
    ],
)
def test_stiff_train_matches_rigid_train(make_train, name, rocker):
    """Members of 20 TPa and contacts of 0.5 to 5 GN/m leave differences of their deformation only."""
    contacts, rod, valve = ARRANGEMENTS[name]
    case = make_train(rocker, *contacts, rod=rod, valve=valve)
    rigid = run(read_case(case.path, ["run.steps_per_revolution=360", "run.revolutions=1"]), rigid=True)
    # An adjuster in equilibrium at every angle does not retain what it has pumped: it is compared at rest only.
    at = [int(one) for one in DEGREES][: 1 if "adjuster" in name else None]
    expected = flexible_equilibria(case)[: len(at)]
    probes = (rigid["tappet.uy"], rigid["end.uy"], rigid["valve"])
    found = [rigid.channels["contacts.intake.force"], rigid.channels["contacts.intake.torque"]]
    found = np.array([*found, *(one.displacement for one in probes)])[:, at].T
    # 900 N on the cam contact; on the lash before the lever; on the lash behind it and both arms, times the ratio.
    give = [3e-7, 3e-6, 1e-5]
    # 45 kN/m of springs on the deformation, and that force at s' of 7 mm.
    np.testing.assert_array_less(np.abs(found - expected).max(axis=0), [1.5, 1e-2, *give])


@pytest.mark.parametrize("rocker", ROCKERS)
def test_adjuster_force_on_cam_at_rest(make_train, rocker):
    """A plunger of 20 N lifts the rod until the lash at the valve closes, and acts with 20 N on the cam."""
    case = make_train(rocker, ADJUSTER, FAR_LASH.format(4e-4), SEAT, rod=5.0)
    response = run(case, rigid=True)
    assert response["valve"].displacement[0] == pytest.approx(0.0, abs=1e-15)
    driven = response["end.uy"].displacement[:1]
    reached = 1.5 * driven if rocker == "ratio" else lever_motion(driven)[0]
    assert reached[0] == pytest.approx(4e-4, rel=1e-9)
    lifted = response["tappet.uy"].displacement > 1e-4  # the adjuster is extended, and transmits the lift
    np.testing.assert_allclose(
        (response["end.uy"].displacement - response["tappet.uy"].displacement)[lifted], driven[0], rtol=1e-9
    )
    assert response.channels["contacts.intake.force"][0] == pytest.approx(
        10.0 + 20.0, rel=1e-3
    )  # the ratio of a lever depends on its rotation


@pytest.mark.parametrize("rocker", ["ratio", pytest.param("lever", marks=pytest.mark.slow)])
def test_node_linked_to_valve_moves_with_valve(make_train, rocker):
    """A retainer on the valve is at rest until the lash at the rocker closes; then its spring acts on the cam."""
    text = make_train(rocker, FAR_LASH.format(4e-4), NEAR_LASH.format(0.0), SEAT).path.read_text(encoding="utf-8")
    text = text.replace("end = [0.02, 0.08, 0.0]", "end = [0.02, 0.08, 0.0]\nhead = [0.05, 0.08, 0.0]")
    text = text.replace(
        "[masses]", 'head = ["ux", "uz", "rx", "ry", "rz"]\n[masses]\nhead = { at = "head", mass = 0.01 }'
    )
    text = text.replace(
        "[rockers",
        """link = { at = "head", to = "valve", direction = "uy", stiffness = 1e9, link = true }
outer = { at = "head", direction = "uy", stiffness = 20e3, installed_force = 100 }
[rockers""",
    )
    path = make_train(rocker).path
    path.write_text(text.replace('"valve"]', '"valve", "head"]'), encoding="utf-8")
    case = read_case(path)
    flexible = flexible_equilibria(case)[:, 0]
    rigid = run(read_case(path, ["run.steps_per_revolution=360", "run.revolutions=1"]), rigid=True)
    np.testing.assert_allclose(rigid["head.uy"].displacement, rigid["valve"].displacement, atol=1e-15)
    at = [int(one) for one in DEGREES]
    np.testing.assert_allclose(rigid.channels["contacts.intake.force"][at], flexible, atol=3.0)  # 110 kN/m, as above


def test_two_rockers_with_separate_lash(make_train):
    """Either valve moves after its own lash closes, and the cam force includes the valves with closed lash."""
    second = [
        'rockers.second={ model = "lumped", from = "end", to = "other", arms = [0.03, 0.036] }',
        'masses.other={ at = "other", mass = 0.1 }',
        'springs.other={ at = "other", direction = "uy", stiffness = 20e3, installed_force = 150 }',
        'contacts.play={ at = "second", model = "lash", gap = 6e-4, stiffness = 5e8 }',
        'contacts.other={ at = "other", model = "seat", stiffness = 5e9 }',
    ]
    path = make_train("ratio", NEAR_LASH.format(3e-4), FAR_LASH.format(4e-4), SEAT).path
    case = read_case(path, [*second, "output.probes=['tappet', 'end', 'valve', 'other']"])
    response = run(case, rigid=True)
    s = build_model(case).cams["intake"].event(response.angle, 0)
    rod = np.maximum(s - 3e-4, 0.0)
    force, expected = response.channels["contacts.intake.force"], 10.0 + 1e3 * s + 500.0 * rod
    for name, ratio, gap, installed, k in (("valve", 1.5, 4e-4, 300.0, 30e3), ("other", 1.2, 6e-4, 150.0, 20e3)):
        lift = np.maximum(ratio * rod - gap, 0.0)
        np.testing.assert_allclose(response[name].displacement, lift, atol=1e-15)
        expected += np.where(lift > 0.0, ratio * (installed + k * lift), 0.0)
    np.testing.assert_allclose(force, expected, atol=1e-3)  # inertia, as above
    flexible = flexible_equilibria(case)[:, 0]
    np.testing.assert_allclose(force[[int(2 * one) for one in DEGREES]], flexible, atol=1.5)


@pytest.mark.slow
def test_oblique_lash(make_train):
    """Guides keep both sides upright: an oblique lash moves them as far as an upright one."""
    askew = NEAR_LASH.format(3e-4).replace('"uy"', "[0.6, 0.8, 0.0]")
    force, _, _, _, valve = flexible_equilibria(
        case := make_train("lever", askew, FAR_LASH.format(4e-4), SEAT, rod=5.0)
    ).T
    rigid = run(read_case(case.path, ["run.steps_per_revolution=360", "run.revolutions=1"]), rigid=True)
    at = [int(one) for one in DEGREES]
    # As above; the deformation of the lash is 1/0.64 times as large.
    np.testing.assert_allclose(rigid.channels["contacts.intake.force"][at], force, atol=2.0)
    np.testing.assert_allclose(rigid["valve"].displacement[at], valve, atol=2e-5)


def test_lash_is_independent_of_node_order(make_train):
    """A contact with its nodes exchanged and the opposite direction is the same contact."""
    plays = NEAR_LASH.format(3e-4), FAR_LASH.format(4e-4), SEAT
    swapped = plays[0].replace('"top", to = "bottom"', '"bottom", to = "top"').replace('"uy"', '"-uy"')
    one, other = (run(make_train("lever", near, *plays[1:], rod=5.0), rigid=True) for near in (plays[0], swapped))
    for name in ("end.uy", "valve"):
        np.testing.assert_allclose(other[name].displacement, one[name].displacement, atol=1e-15)
    force = "contacts.intake.force"
    np.testing.assert_allclose(other.channels[force], one.channels[force], rtol=1e-9)


def test_lash_opening_with_lift_moves_no_valve(make_train):
    """The follower separates from the rod, and the valve stays on its seat."""
    opening = NEAR_LASH.format(3e-4).replace('"uy"', '"-uy"')
    response = run(make_train("lever", opening, FAR_LASH.format(4e-4), SEAT, rod=5.0), rigid=True)
    assert np.ptp(response["tappet.uy"].displacement) > 1e-3
    assert np.ptp(response["valve"].displacement) < 1e-15
    assert not response.channels["contacts.near.force"].any()
