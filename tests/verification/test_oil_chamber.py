"""Oil chamber of a hydraulic adjuster: air under pressure, check valve, stops, pivot of a finger.

The two standard tests of adjusters are cases (`cases/checks`): leak-down under a load and pump-up. Compression of oil
with air: M. G. Rabie, Fluid Power Engineering (2009), p. 32, eqs. 2.50, 2.52 and 2.53, integrated from the supply
pressure; flow through an orifice: p. 27, eq. 2.36; through the gap: H. E. Merritt, Hydraulic Control Systems (1967),
sec. 2-3.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from flexcam import InputError, build_model, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, equilibrium
from flexcam.dynamics.oil_laws import oil_chamber
from tests.verification.test_rigid_pivots import CASE as FINGER
from tests.verification.test_rigid_pivots import GUIDED

SOURCE = "Lash and hydraulic adjusters"
DIAMETER, HEIGHT, BULK, GAP, LAND, VISCOSITY = 0.011, 5e-3, 1.5e9, 6e-6, 8e-3, 0.02
AREA = 0.25 * math.pi * DIAMETER**2
LEAK = 12.0 * VISCOSITY * LAND * AREA**2 / (math.pi * DIAMETER * GAP**3)


def tangent_modulus(pressure, supply, air):
    """Return the modulus, ``-dp/(dV/V0)`` with the initial volume, Pa, of oil and of air by p V^1.4 = const."""
    return 1.0 / ((1.0 - air) / BULK + air * (supply / pressure) ** (1.0 / 1.4) / (1.4 * pressure))


def compression(force, supply, air):
    """Return the compression of the chamber under the oil force, m, by quadrature of the modulus."""
    end = supply + force / AREA
    return HEIGHT * quad(lambda p: 1.0 / tangent_modulus(p, supply, air), supply, end, epsabs=1e-16)[0]


def test_leak_down_case(record):
    response = run(read_case("cases/checks/leak-down.toml"))
    time, sunk = response.time, -response["plunger.uy"].displacement
    at_once, velocity = compression(192.6, 3e5, 0.06), 192.6 / LEAK
    record(source=SOURCE, case="leak-down test", quantity="sinking at once, by the air", unit="m", reference=at_once,
           computed=sunk[0], tolerance=1e-6, reason="quadrature and Newton's method")  # fmt: skip
    part = time < 9.0
    record(source=SOURCE, case="leak-down test", quantity="velocity of leak-down", unit="m/s", reference=velocity,
           computed=np.polyfit(time[part], sunk[part], 1)[0], tolerance=1e-5,
           reason="the mass swings by 0.2 um about the steady sinking")  # fmt: skip
    stop = response.channels["contacts.adjuster.stop_force"]
    record(source=SOURCE, case="leak-down test", quantity="time to the bottom", unit="s",
           reference=(1e-3 - at_once) / velocity, computed=time[np.argmax(stop > 0.0)], tolerance=2e-3,
           reason="steps of 5 ms, and a swing of 0.2 um")  # fmt: skip
    pressure = response.channels["contacts.adjuster.pressure"]
    np.testing.assert_allclose(pressure[part], 192.6 / AREA, rtol=5e-4)
    total = response.channels["contacts.adjuster.force"] + stop
    np.testing.assert_allclose(total[-1], 222.6, rtol=1e-3)  # the bottom stop takes over the force of the oil


def test_pump_up_case(record):
    response = run(read_case("cases/checks/pump-up.toml"))
    time, velocity = response.time, response["plunger.uy"].velocity
    at_once = -compression(30.0 - 44.71, 3.6e5, 0.005)
    pull, orifice = 14.71 - 0.02e6 * AREA, 0.62 * math.pi * 3e-3 * 0.25e-3
    flow = brentq(lambda Q: 150.0 * Q / AREA + AREA * 850.0 / 2.0 * (Q / orifice) ** 2 - pull, 0.0, 1.0, xtol=1e-16)
    steady = flow / AREA + 14.71 / LEAK
    record(source=SOURCE, case="pump-up test", quantity="velocity of refill", unit="m/s", reference=steady,
           computed=velocity[np.searchsorted(time, 10e-3)], tolerance=1e-6, reason="steady after 5 ms")  # fmt: skip
    ring = -response.channels["contacts.adjuster.stop_force"]
    record(source=SOURCE, case="pump-up test", quantity="time to the retaining ring", unit="s",
           reference=(1e-3 - at_once) / steady, computed=time[np.argmax(ring > 0.0)], tolerance=0.02,
           reason="the plunger gathers speed within 0.2 ms")  # fmt: skip
    assert ring[-1] == pytest.approx(14.71 + AREA * response.channels["contacts.adjuster.pressure"][-1], rel=1e-3)
    assert -0.02e6 < response.channels["contacts.adjuster.pressure"][-1] < 0.0  # the ball is back on its seat
    residual, work = (np.abs(response.channels[f"energy.{name}"]).max() for name in ("residual", "work"))
    assert residual < 1e-4 * work  # the plunger reaches the ring within a step


def test_equilibrium_has_a_full_chamber():
    """The ring holds the plunger against spring and supply; the oil carries nothing, and nothing accelerates."""
    response = run(read_case("cases/checks/pump-up.toml", ["run.start=equilibrium", "run.revolutions=0.01"]))
    for name, expected in (("force", 44.71), ("stop_force", 30.0 - 44.71), ("pressure", 0.0)):
        np.testing.assert_allclose(response.channels[f"contacts.adjuster.{name}"], expected, rtol=1e-9, atol=1e-4)
    assert np.abs(response["plunger.uy"].acceleration).max() < 1e-5


@pytest.mark.parametrize(("case", "sign"), [("leak-down", 1.0), ("pump-up", -1.0)])
def test_sign_of_leak_down_metric(case, sign):
    """The plunger sinks by leak-down; pumped up, the maximum is negative, as at all instants."""
    overrides = [] if sign > 0.0 else ["run.start=equilibrium", "run.revolutions=0.01"]
    response = run(read_case(f"cases/checks/{case}.toml", overrides))
    found = response.metrics["contacts.adjuster.leak_down.largest"]
    assert sign * found > 1e-5
    assert found == response.channels["contacts.adjuster.leak_down"].max()


CHAMBER = (AREA, HEIGHT, BULK, 0.04, 3e5, LEAK / 50.0, 1.5, 60.0, 171.0, 40.0)
"""Plunger with a wide gap, so that it leaks and refills within one lift."""


def integrate_leak_down(time, motion):
    """Return the leak-down under a prescribed motion, m, by an independent integration."""
    area, _, _, air, supply, leak, cracking, refill, loss, _ = CHAMBER

    def rate(t, z):
        e = motion(t) - z[0]
        force = brentq(lambda f: closed_form_compression(f, supply, air) - e, -0.9999 * area * supply, 1e5, xtol=1e-13)
        pull = -force - cracking
        return [force / leak - (np.roots([loss, refill, -pull]).max() if pull > 0.0 else 0.0)]

    return solve_ivp(rate, (0.0, time[-1]), [0.0], t_eval=time, method="LSODA", rtol=1e-9, atol=1e-13).y[0]


def closed_form_compression(force, supply, air):
    ratio = 1.0 + force / (AREA * supply)
    return HEIGHT * ((1.0 - air) * (ratio - 1.0) * supply / BULK + air * (1.0 - ratio ** (-1.0 / 1.4)))


def test_second_order_convergence_of_plunger_lift(record):
    """The plunger is pressed by 0.15 mm and retracted in 20 ms, with refill; half the step, a quarter of the error."""

    def motion(t):
        return 0.15e-3 * math.sin(math.pi * t / 0.02) ** 2 - 2e-3 * t

    errors = []
    exact = integrate_leak_down(np.linspace(0.0, 0.02, 101), motion)
    for steps in (400, 800, 1600):
        z, h, found = 0.0, 0.02 / steps, [0.0]
        for i in range(steps):
            x0, x1 = motion(i * h), motion((i + 1) * h)
            z = x1 - oil_chamber(x1, x0, z, h, np.array(CHAMBER), 0)[3]
            found.append(z)
        errors.append(np.abs(np.array(found)[:: steps // 100] - exact).max())
    assert exact.max() > 5e-6
    assert exact.min() < -3e-5
    record(source=SOURCE, case="lift and refill of a chamber", unit="1", reference=0.0,
           quantity="error of the leak-down at 12.5 us over its largest value",
           computed=errors[-1] / np.abs(exact).max(), tolerance=1e-4, absolute=True,
           reason="second order within leak and refill")  # fmt: skip
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


STAND = (
    'stand = { from = "ground", to = "pivot", direction = "uy", model = "lash-adjuster", refill = 500, '
    'plunger_force = 40, oil = { viscosity = "20 mPa s", bulk_modulus = "1.5 GPa", plunger_diameter = "11 mm", '
    'clearance = "6 um", land_length = "8 mm", chamber_height = "5 mm", air = "2 %", supply_pressure = "0.3 MPa" } }'
)


def test_adjuster_under_finger_pivot(record, tmp_path):
    """The adjuster carries F (L/a - 1) with the valve force F; the valve moves by -(L/a - 1) times the pivot."""
    path = tmp_path / "finger.toml"
    text = FINGER.format(held=GUIDED, springs="", contacts=STAND).replace("2e4 GPa", "200 GPa")
    path.write_text(text, encoding="utf-8")
    case = read_case(path)
    system, drive = prepare(case).problem.system, ConstantSpeed(case.speed, 1.8)
    still = equilibrium(system, drive)
    pivot, tip, pad = (float(still.displacement[system.names.index(f"{name}.uy")]) for name in ("pivot", "tip", "pad"))
    force = 0.5 * (300.0 - 30e3 * tip)  # force of the valve spring, over the lever ratio 60/40
    record(source=SOURCE, case="adjuster under a pivot", quantity="sinking of the plunger", unit="m",
           reference=compression(force - 40.0, 3e5, 0.02), computed=-pivot, tolerance=1e-6,
           reason="air under 195 N; equilibrium to 1e-9 of the forces")  # fmt: skip
    assert tip - 1.5 * pad == pytest.approx(-0.5 * pivot, abs=4e-6)  # bending of the finger
    assert build_model(case).contacts["stand"].chamber is not None


ROD = """[members]
rod = { nodes = ["body", "plunger"], material = "steel", section = "round" }
[materials]
steel = { E = "200 GPa", nu = 0.3, density = 7800 }
[sections]
round = { shape = "circle", diameter = "9 mm" }
[supports]"""
TRAVEL = "travel = { compression = '1 mm', extension = '1 mm', stiffness = '50 MN/m' }"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('supply_pressure = "0.36 MPa"', 'pressure = "1 MPa"', "supply_pressure together with this key"),
        ('supply_pressure = "0.36 MPa"', 'supply_pressure = "0.36 MPa", pressure = "1 MPa"', "either pressure or"),
        ("[supports]", ROD, "an end at a mass on no member"),
        ('refill = "150 N s/m"', 'refill = "150 N s/m"\nstiffness = "20 MN/m"', "either oil.supply_pressure or stiff"),
    ],
)  # fmt: skip
def test_invalid_chamber_raises_error(tmp_path, old, new, words):
    text = Path("cases/checks/pump-up.toml").read_text(encoding="utf-8")
    inline = "\n[contacts.adjuster.oil]\n"
    assert old in text
    assert inline in text
    path = tmp_path / "pump-up.toml"
    path.write_text(text.replace(old, new.replace(", ", "\n") if "pressure" in old else new), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        build_model(read_case(path))


def test_stops_at_rocker_raise_error():
    override = (
        "contacts.lash={ at = 'rocker', model = 'lash-adjuster', stiffness = 2e7, leak = 4e5, refill = 500, "
        f"plunger_force = 20, {TRAVEL} }}"
    )
    with pytest.raises(InputError, match="from, to and direction"):
        read_case("cases/pushrod-engine/intake.toml", [override])
