"""A rigid finger whose pivot is on a spring, a closed lash or an adjuster, against the balance of a lever.

Cam, pivot and valve are a = 40 mm and L = 60 mm apart on a straight finger. For a lift s at the cam, a pivot
displacement p and a valve displacement t = s L/a - p (L/a - 1), the energy of the springs is minimum at p = F (L/a -
1)/k with the valve force F; the cam force is F L/a (R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed.
(2009), ch. 17).
"""

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, Problem, equilibrium, solve

CASE = """
format = 1
[nodes]
cam = [0.06, 0.0, 0.0]
ground = [0.06, -0.06, 0.04]
pivot = [0.06, -0.024, 0.04]
pad = [0.06, -0.024, 0.0]
tip = [0.06, -0.024, -0.02]
[materials.stiff]
E = "2e4 GPa"
nu = 0.29
density = "1 kg/m^3"
[sections]
bar = {{ shape = "circle", diameter = "30 mm" }}
[members]
finger = {{ nodes = ["pivot", "pad", "tip"], material = "stiff", section = "bar" }}
[supports]
cam = ["ux", "uy", "uz", "rx", "ry", "rz"]
ground = ["ux", "uy", "uz", "rx", "ry", "rz"]
pivot = {held}
[masses]
lobe = {{ at = "cam", mass = 0.1 }}
valve = {{ at = "tip", mass = 0.05 }}
[springs]
valve = {{ at = "tip", direction = "-uy", stiffness = 30e3, installed_force = 300 }}
{springs}
[cams.intake]
at = "cam"
axis = [1, 0, 0]
law = "4-5-6-7"
lift = "4 mm"
rise = 1.2
return = 1.2
phase = 0.6
[contacts]
intake = {{ cam = "intake", follower = "pad", direction = "-uy", model = "bilateral", stiffness = 1e9 }}
{contacts}
[run]
speed = "1 rpm"
revolutions = 0.5
steps_per_revolution = 360
[output]
probes = ["pivot", "tip"]
"""
FREE, GUIDED = '["ux", "ry", "rz"]', '["ux", "uz", "ry", "rz"]'
VERTICAL_SPRING = 'up = {{ at = "pivot", direction = "uy", stiffness = {} }}'
LATERAL_SPRING = 'aside = { at = "pivot", direction = "uz", stiffness = 1e6 }'
ARM = 0.06 / 0.04


@pytest.fixture
def finger(tmp_path):
    def make(held, springs="", contacts=""):
        path = tmp_path / "finger.toml"
        path.write_text(CASE.format(held=held, springs=springs, contacts=contacts), encoding="utf-8")
        return read_case(path)

    return make


def lever_equilibrium(s, k):
    """Return the cam force, and the downward displacements of pivot and tip from the installed position."""
    yielding = 30e3 * (ARM - 1.0) ** 2 / k
    pivot = (ARM - 1.0) * 30e3 * ARM * s / (k * (1.0 + yielding))
    tip = ARM * s - (ARM - 1.0) * pivot
    # The pivot displacement under the installed 300 N permanently reduces this force.
    return ARM * (300.0 / (1.0 + yielding) + 30e3 * tip), pivot, tip


@pytest.mark.parametrize("aside", [True, False], ids=["springs both ways", "guided across"])
@pytest.mark.parametrize("k", [1e8, 1e6, 1e5])
def test_pivot_on_springs(finger, k, aside):
    """Rigid and stiff trains agree; a pivot of 100 kN/m reduces the valve force by 7 %."""
    case = finger(FREE if aside else GUIDED, "\n".join([VERTICAL_SPRING.format(k)] + [LATERAL_SPRING] * aside))
    rigid = run(case, rigid=True)
    lift = build_model(case).cams["intake"].event(rigid.angle, 0)
    force, pivot, tip = lever_equilibrium(lift, k)
    found = [rigid.channels["contacts.intake.force"], *(-rigid[f"{n}.uy"].displacement for n in ("pivot", "tip"))]
    np.testing.assert_allclose(found, [force, pivot, tip], rtol=1e-6, atol=1e-12)
    base, nose = flexible_equilibria(case)
    expected = lever_equilibrium(4e-3, k)
    assert base[0] == pytest.approx(lever_equilibrium(0.0, k)[0], rel=1e-3)  # deformation: 3 um under 700 N
    assert nose[0] == pytest.approx(expected[0], rel=1e-3)
    np.testing.assert_allclose(nose[1:] - base[1:], expected[1:], atol=3e-6)


def test_lateral_spring_at_pivot_carries_no_force(finger):
    """The finger rotates about the pivot: a spring perpendicular to the lift has no force."""
    case = finger('["ux", "uy", "ry", "rz"]', LATERAL_SPRING)
    rigid = run(case, rigid=True)
    force, pivot, tip = lever_equilibrium(build_model(case).cams["intake"].event(rigid.angle, 0), np.inf)
    found = [rigid.channels["contacts.intake.force"], *(-rigid[f"{n}.uy"].displacement for n in ("pivot", "tip"))]
    np.testing.assert_allclose(found, [force, pivot, tip], rtol=1e-6, atol=1e-12)
    assert flexible_equilibria(case)[1][0] == pytest.approx(lever_equilibrium(4e-3, np.inf)[0], rel=1e-3)


def flexible_equilibria(case):
    """Return cam force, pivot and tip displacement of the flexible train on base circle and nose."""
    ready, found = prepare(case), []
    for angle in (0.0, 1.8):  # the face slides by s' along the finger, which is zero here
        drive = ConstantSpeed(case.speed, angle)
        still = solve(
            Problem(ready.problem.system, drive, 1e-6, 1, equilibrium(ready.problem.system, drive)), ready.scheme
        )
        moved = [-still[f"{name}.uy"].displacement[0] for name in ("pivot", "tip")]
        found.append([still.channels["contacts.intake.force"][0], *moved])
    return np.array(found)


PIVOT_CONTACTS = {
    "adjuster": 'model = "lash-adjuster", stiffness = 1e8, leak = 1e9, refill = 500, plunger_force = 40',
    "closed play": 'model = "lash", gap = 0, stiffness = 1e8',
}
END_ORDERS = ['from = "ground", to = "pivot", direction = "uy"', 'from = "pivot", to = "ground", direction = "-uy"']


@pytest.mark.parametrize("ends", END_ORDERS, ids=["pushed", "pushing"])
@pytest.mark.parametrize("stand", PIVOT_CONTACTS.values(), ids=PIVOT_CONTACTS)
def test_pivot_on_adjuster(finger, stand, ends):
    """The pivot is fixed in the rigid model, and otherwise on its oil as on a spring, for either order of the ends."""
    case = finger(GUIDED, contacts=f"stand = {{ {ends}, {stand} }}")
    rigid = run(case, rigid=True)
    lift = build_model(case).cams["intake"].event(rigid.angle, 0)
    np.testing.assert_allclose(rigid.channels["contacts.intake.force"], lever_equilibrium(lift, 1e8)[0], rtol=2e-4)
    np.testing.assert_allclose(-rigid["tip.uy"].displacement, lever_equilibrium(lift, np.inf)[2], atol=1e-12)
    assert flexible_equilibria(case)[1][0] == pytest.approx(lever_equilibrium(4e-3, 1e8)[0], rel=1e-3)
