"""Coil springs: rate and stress of the wire, surge against a chain of its own, and coils that touch.

J. E. Shigley and C. R. Mischke, Mechanical Engineering Design, 5th ed. (1989), secs. 10-1 to 10-3: k =
G d^4/(8 D^3 n), the largest shear stress K_W 8 F D/(pi d^3) with Wahl's factor.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from flexcam import build_model, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, equilibrium

SOURCE = "Coil springs"
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
[materials.stiff]
E = "500 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "40 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
pushrod = {{ nodes = ["tappet", "top"], material = "stiff", section = "thick" }}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
[masses]
follower = {{ at = "tappet", mass = "0.1 kg" }}
[springs.valve]
at = "top"
direction = "uy"
installed_force = 400.0
{spring}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "10 mm"
rise = "80 deg"
return = "80 deg"
phase = "10 deg"
[contacts]
intake = {{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = "1 GN/m" }}
[run]
speed = "1800 rpm"
revolutions = 0.5
steps_per_revolution = 3600
start = "equilibrium"
[output]
probes = ["top"]
"""
WIRE, COIL, COILS, MODULUS = 0.0042, 0.027, 5.5, 79.3e9
INSTALLED = 400.0
OF_WIRE = 'wire = { diameter = "4.2 mm", coil_diameter = "27 mm", active_coils = 5.5, shear_modulus = "79.3 GPa" }'


@pytest.fixture
def case(tmp_path):
    def make(spring, *more):
        path = tmp_path / "spring.toml"
        path.write_text(CASE.format(spring=spring), encoding="utf-8")
        return read_case(path, list(more))

    return make


RATE = MODULUS * WIRE**4 / (8.0 * COIL**3 * COILS)


def still(made, degrees):
    """Return the channels of a spring at rest at a cam angle: of a run's first instant."""
    response = run(read_case(made.path, [f"cams.intake.phase={-degrees} deg", "run.revolutions=0.001"]))
    return response["top.uy"].displacement[0], {n: float(v[0]) for n, v in response.channels.items()}


def test_rate_of_the_wire(record, case):
    found = build_model(case(OF_WIRE)).springs["valve"].stiffness
    record(source=SOURCE, case="wire 4.2 mm, D = 27 mm, 5.5 coils", quantity="rate", unit="N/m", reference=RATE,
           computed=found, tolerance=1e-12, reason="rounding")  # fmt: skip


@pytest.mark.parametrize("degrees", [0.0, 40.0, 80.0])
def test_stress_at_rest(record, case, degrees):
    lift, channels = still(case(OF_WIRE), degrees)
    C = COIL / WIRE
    wahl = (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C
    force = INSTALLED + RATE * lift
    record(source=SOURCE, case=f"lift of {1e3 * lift:.2f} mm", quantity="shear stress of the wire", unit="Pa",
           reference=wahl * 8.0 * force * COIL / (math.pi * WIRE**3), computed=channels["springs.valve.stress"],
           tolerance=1e-9, reason="rounding")  # fmt: skip
    assert channels["springs.valve.force"] == pytest.approx(force, rel=1e-9)
    assert channels["contacts.intake.force"] == pytest.approx(force, rel=1e-6)


SURGING = OF_WIRE + '\nmass = "80 g"\nelements = PARTS\ndamping = 2.0'


@pytest.mark.parametrize("parts", [4, 8])
def test_surge_against_a_chain(record, case, parts):
    """Parts in a row between ground and a given motion: bars with consistent masses, by scipy's own integration."""
    response = run(case(SURGING.replace("PARTS", str(parts))))
    top = response["top.uy"]
    at = CubicHermiteSpline(response.time, top.velocity, top.acceleration)
    where = at.antiderivative()
    n, m, k, c = parts, 0.08 / parts, RATE * parts, 2.0 * parts
    D = np.diff(np.eye(n + 1), axis=0)  # stretch of every part from the motions of all ends
    S = np.abs(D)
    K, C, M = k * D.T @ D, c * D.T @ D, m / 4.0 * S.T @ S + m / 12.0 * D.T @ D
    inner = slice(1, n)
    Mi = np.linalg.inv(M[inner, inner])

    def rates(t, y):
        u, v = np.zeros(n + 1), np.zeros(n + 1)
        u[inner], v[inner], u[n], v[n] = y[: n - 1], y[n - 1 :], top.displacement[0] + where(t), at(t)
        a = Mi @ (-(K @ u + C @ v)[inner] - M[inner, n] * at(t, 1))
        return np.concatenate([y[n - 1 :], a])

    start = np.concatenate([np.arange(1, n) / n * top.displacement[0], np.zeros(n - 1)])
    chain = solve_ivp(rates, (0.0, response.time[-1]), start, t_eval=response.time, rtol=1e-8, atol=1e-12)
    u = np.vstack([np.zeros(len(response.time)), chain.y[: n - 1], top.displacement])
    uneven = np.abs(u - np.arange(n + 1)[:, None] / n * u[-1]).max(axis=0)
    found = response.channels["springs.valve.surge"]
    record(source=SOURCE, case=f"surge of {parts} parts", quantity="largest error of the surge", unit="m",
           reference=0.0, computed=np.abs(found - uneven).max(), tolerance=0.02 * uneven.max(), absolute=True,
           reason="the average acceleration on 9 us steps delays the highest mode of the chain")  # fmt: skip
    force = INSTALLED + k * (D @ u)
    worst = np.abs(response.channels["springs.valve.force"] - force[-1]).max()
    assert worst < 5e-3 * force.max()
    stress = response.channels["springs.valve.stress"] / (8.0 * COIL / (math.pi * WIRE**3))
    C = COIL / WIRE
    wahl = (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C
    np.testing.assert_allclose(stress, wahl * np.abs(force).max(axis=0), atol=5e-3 * wahl * force.max())


CLASHING = "stiffness = 30e3\nelements = 4\nmass = 0.04\nclash_travel = 8e-3\nclash_stiffness = 2e6"


@pytest.mark.parametrize("degrees", [0.0, 40.0, 80.0])
def test_clearance_and_clash_at_rest(record, case, degrees):
    """Up to the travel the spring has its rate; beyond, four contacts in a row stand beside it."""
    made = case(CLASHING, f"cams.intake.phase={-degrees} deg")
    problem = prepare(made).problem
    state = equilibrium(problem.system, ConstantSpeed(1.0))
    names = problem.system.names
    lift, cam = (float(state.displacement[names.index(name)]) for name in ("top.uy", "tappet.uy"))
    response = run(read_case(made.path, [f"cams.intake.phase={-degrees} deg", "run.revolutions=0.001"]))
    channels = {n: float(v[0]) for n, v in response.channels.items()}
    beyond = max(lift - 8e-3, 0.0)
    clash = beyond * 2e6 / 4.0
    force = INSTALLED + 30e3 * lift + clash
    assert (beyond > 0.0) == (degrees == 80.0)
    assert cam == pytest.approx(lift, abs=1e-6)
    record(source=SOURCE, case=f"four parts at {1e3 * lift:.2f} mm", quantity="force that the cam gives", unit="N",
           reference=force, computed=channels["contacts.intake.force"], tolerance=1e-6, reason="rounding")  # fmt: skip
    record(source=SOURCE, case=f"four parts at {1e3 * lift:.2f} mm", quantity="clearance", unit="m",
           reference=8e-3 - lift, computed=channels["springs.valve.clearance"], tolerance=1e-12, absolute=True,
           reason="rounding")  # fmt: skip
    # Each of the four contacts in a row bears the force; the channel is their sum.
    assert channels["springs.valve.clash"] == pytest.approx(4.0 * clash, rel=1e-6, abs=1e-9)


def test_clearance_of_a_surging_spring(case):
    """Counted by the most compressed part: coils touch there first, before the whole spring is solid."""
    response = run(case(CLASHING.replace("8e-3", "12e-3"), "run.speed=3000 rpm"))
    parts = np.column_stack([response["springs.valve"].displacement, response["top.uy"].displacement])
    stretch = np.diff(parts, axis=1, prepend=0.0)
    clearance = response.channels["springs.valve.clearance"]
    np.testing.assert_allclose(clearance, 12e-3 - 4.0 * stretch.max(axis=1), atol=1e-12)
    touching = response.channels["springs.valve.clash"] > 0.0
    np.testing.assert_array_equal(touching, clearance < 0.0)
    assert clearance.min() < 12e-3 - response["top.uy"].displacement.max()
