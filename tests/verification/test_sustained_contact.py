"""A mass on a rotating cam for ten thousand revolutions has no drift, no increasing penetration and no chatter.

Simulations with a Coulomb-like or impulsive contact are known to drift or to chatter at rest. Here the mass m on a
spring k with the preload F stays on an elastic cam of stiffness K with the lift (h/2)(1 - cos(w t)), so that the system
is linear and its steady motion is

    y = y0 - a cos(w t),  y0 = (K h/2 - F)/(K + k),  a = (K h/2)/(K + k - m w^2),

with the contact force K (lift - y). A start on this motion must stay on it; only the step changes its amplitude, by 1 +
w^2 dt^2/4 for w^2 in the average acceleration method.
"""

import math

import numpy as np
import pytest

from flexcam import read_case, run

M, K, SPRING, PRELOAD, LIFT, SPEED, STEPS = 0.1, 2e6, 20e3, 200.0, 0.008, 150.0, 120

CASE = f"""
format = 1
nodes = {{ camshaft = [0.0, -0.02, 0.0], follower = [0.0, 0.0, 0.0] }}
supports = {{ follower = ["ux", "uz"] }}
masses.follower = {{ at = "follower", mass = {M} }}
springs.spring = {{ at = "follower", direction = "uy", stiffness = {SPRING}, installed_force = {PRELOAD} }}
cams.cam = {{ at = "camshaft", axis = [0, 0, 1], law = "shm", lift = {LIFT}, rise = "180 deg", return = "180 deg" }}
[contacts.cam]
cam = "cam"
follower = "follower"
direction = "uy"
model = "unilateral"
stiffness = {K}
[run]
speed = {SPEED}
steps_per_revolution = {STEPS}
[output]
probes = ["follower"]
"""


@pytest.mark.slow
def test_ten_thousand_revolutions_in_contact(record, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    dt = 2.0 * math.pi / SPEED / STEPS
    square = (2.0 / dt * math.tan(0.5 * SPEED * dt)) ** 2  # square of the speed in the average acceleration method
    mean, swing = (K * LIFT / 2.0 - PRELOAD) / (K + SPRING), K * LIFT / 2.0 / (K + SPRING - M * square)
    start = f'run.start={{ displacement = {{ "follower.uy" = {mean - swing!r} }} }}'
    response = run(read_case(path, [start, "run.revolutions=10000", "run.integrator.method=newmark"]))
    force, body = response.channels["contacts.cam.force"], response["follower.uy"]
    turn = SPEED * response.time
    expected = mean - swing * np.cos(turn)
    last = slice(-10 * STEPS, None)
    case, source = "mass on a cam, 10 000 revolutions", "Sustained unilateral contact, closed form"
    static = K * (LIFT / 2.0 * (1.0 - np.cos(turn)) - expected)
    assert force.min() > 0.0
    assert response.stats.events == 0
    for quantity, unit, reference, computed, tolerance, reason in (
        ("largest difference of the motion", "m", 0.0, np.abs(body.displacement - expected).max(), 1e-11,
         "the discrete steady motion is exact: rounding of 1.2 million steps"),
        ("drift of the mean of ten revolutions", "m", 0.0,
         body.displacement[last].mean() - body.displacement[: 10 * STEPS].mean(), 1e-13, "rounding"),
        ("largest penetration", "m", static.max() / K, -response.channels["contacts.cam.gap"].min(), 1e-7,
         "that of the steady contact force"),
        ("energy residual over kinetic energy", "1", 0.0,
         np.abs(response.channels["energy.residual"]).max() / response.channels["energy.kinetic"].max(), 1e-6,
         "rounding of the work of 10 000 revolutions"),
    ):  # fmt: skip
        record(source=source, case=case, quantity=quantity, unit=unit, reference=float(reference),
               computed=float(computed), tolerance=tolerance, absolute=bool(reference == 0.0),
               reason=reason)  # fmt: skip
    assert pytest.approx(static, rel=1e-6) == force
