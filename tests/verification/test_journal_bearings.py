"""Oil films of journal bearings against closed forms of the short bearing and a quadrature of the film pressure.

Closed forms: M. I. Friswell, J. E. T. Penny, S. D. Garvey and A. W. Lees, Dynamics of Rotating Machines (2010), sec.
5.5.1, eqs. 5.83 to 5.87, with the bearing of its example.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import flexcam
from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, System, equilibrium, newmark, solve
from flexcam.dynamics.force_laws import ANSWER, LOCAL_ROWS, PENETRATION, RATE, short_bearing
from flexcam.valvetrain import FilmBearing
from flexcam.valvetrain.coupling import opposed_force

SPEED, LOAD = 1500.0 * math.pi / 30.0, 525.0
BEARING = FilmBearing("journal", np.eye(6)[1:3], 0.1, 0.03, 1e-4, 0.1)
CLEARANCE = BEARING.radial_clearance


def film_force(displacement, velocity, bearing=BEARING, speed=SPEED):
    """Return the force that resists the motion of the journal, and its derivatives by displacement and velocity."""
    local, tangent = np.zeros((LOCAL_ROWS, 2)), np.zeros((2, 2, 2))
    local[PENETRATION], local[RATE] = displacement, velocity
    short_bearing(np.array(bearing.law(speed).constants), 0, 0, local, tangent)
    return local[ANSWER].copy(), *tangent


def load_capacity(eccentricity):
    """Return the static load of the bearing, eq. 5.83, N."""
    size = BEARING.viscosity * SPEED * 0.5 * BEARING.diameter * BEARING.length**3 / (4.0 * CLEARANCE**2)
    rest = 1.0 - eccentricity**2
    return size * eccentricity / rest**2 * math.sqrt(math.pi**2 * rest + 16.0 * eccentricity**2)


def steady_position(eccentricity):
    """Return the displacement of a journal under a load along -y that rotates from x to y."""
    attitude = math.atan(math.pi * math.sqrt(1.0 - eccentricity**2) / (4.0 * eccentricity))
    return eccentricity * CLEARANCE * np.array([math.sin(attitude), -math.cos(attitude)])


def published_coefficients(e):
    """Return stiffness and damping at the equilibrium under a load along -y, eqs. 5.84 to 5.87."""
    s, p, e2 = 1.0 - e * e, math.pi**2, e * e
    root, h0 = math.sqrt(s), (p * s + 16.0 * e2) ** -1.5
    a_uv = math.pi * (p * s**2 - 16.0 * e2**2) / (e * root)
    a_vu = -math.pi * (p * s * (1.0 + 2.0 * e2) + 32.0 * e2 * (1.0 + e2)) / (e * root)
    a_vv = 4.0 * (p * (1.0 + 2.0 * e2) + 32.0 * e2 * (1.0 + e2) / s)
    cross = p * (1.0 + 2.0 * e2) - 16.0 * e2
    b_vv = 2.0 * math.pi * (p * s**2 + 48.0 * e2) / (e * root)
    stiffness = np.array([[4.0 * (p * (2.0 - e2) + 16.0 * e2), a_uv], [a_vu, a_vv]])
    damping = np.array([[2.0 * math.pi * root * cross / e, -8.0 * cross], [-8.0 * cross, b_vv]])
    size = h0 * load_capacity(e) / CLEARANCE
    return size * stiffness, size / SPEED * damping


@pytest.mark.parametrize("eccentricity", [0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98])
def test_load_and_attitude_match_ocvirk(eccentricity):
    force, _, _ = film_force(steady_position(eccentricity), np.zeros(2))
    load = load_capacity(eccentricity)
    # the integrals divide by w^7, w^2 = 0.04 at the last eccentricity: rounding
    np.testing.assert_allclose(force, [0.0, -load], rtol=1e-12, atol=1e-12 * load)


@pytest.mark.parametrize("eccentricity", [0.05, 0.2663, 0.5, 0.8, 0.95])
def test_dynamic_coefficients_match_published_values(eccentricity):
    found = film_force(steady_position(eccentricity), np.zeros(2))[1:]
    for one, other in zip(found, published_coefficients(eccentricity), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11 * np.abs(other).max())


def test_textbook_bearing_example():
    """The textbook prints the eccentricity and the coefficients with four digits, MN/m and kN s/m."""
    eccentricity = float(brentq(lambda e: load_capacity(e) - LOAD, 0.01, 0.9))
    assert eccentricity == pytest.approx(0.2663, abs=5e-5)
    _, stiffness, damping = film_force(steady_position(eccentricity), np.zeros(2))
    np.testing.assert_allclose(1e-6 * stiffness, [[12.81, 16.39], [-25.06, 8.815]], rtol=5e-4)
    np.testing.assert_allclose(1e-3 * damping, [[232.9, -81.92], [-81.92, 294.9]], rtol=5e-4)


def test_force_matches_integral_of_pressure():
    """Reynolds' equation without circumferential flow is integrated over the angle of positive pressure."""
    rng, t = np.random.default_rng(3), (np.arange(200_000) + 0.5) * math.tau / 200_000
    for _ in range(20):
        d = CLEARANCE * rng.uniform(0.0, 0.95) * np.array([math.cos(a := rng.uniform(0.0, math.tau)), math.sin(a)])
        v = CLEARANCE * SPEED * rng.normal(size=2)
        thickness = CLEARANCE - d[0] * np.cos(t) - d[1] * np.sin(t)
        wedge = 0.5 * SPEED * (d[0] * np.sin(t) - d[1] * np.cos(t))
        squeeze = -v[0] * np.cos(t) - v[1] * np.sin(t)
        line_load = -12.0 * BEARING.viscosity / thickness**3 * BEARING.length**3 / 12.0 * (wedge + squeeze)
        pressed = np.maximum(line_load, 0.0) * 0.5 * BEARING.diameter * math.tau
        expected = [(pressed * np.cos(t)).mean(), (pressed * np.sin(t)).mean()]
        # both ends of the film are between two points of the quadrature
        np.testing.assert_allclose(film_force(d, v)[0], expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_force_beyond_clearance_is_restoring():
    """The force is continuous at the limit of the theory and increases beyond it, at any direction and velocity."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        along, v = rng.normal(size=2), CLEARANCE * SPEED * rng.normal(size=2)
        along *= CLEARANCE / float(np.hypot(*along))
        below, above = (film_force(e * along, v)[0] for e in (0.99 - 1e-12, 0.99 + 1e-12))
        # a relative slope of some hundred per clearance
        np.testing.assert_allclose(above, below, rtol=1e-9, atol=1e-9 * np.abs(below).max())
        sizes = [float(film_force(e * along, np.zeros(2))[0] @ along) for e in (0.99, 1.5, 10.0, 1000.0)]
        assert np.diff(sizes).min() > 0.0
        assert sizes[-1] < math.inf


def rotor_system(mass, load=LOAD):
    """Return a rigid rotor in the bearing under a load along -y."""
    force = opposed_force("film", np.eye(2), BEARING.law(SPEED))
    weight = Load("weight", np.array([0.0, -load]), lambda motion: np.ones_like(motion.angle), steady=True)
    probe = Probe("journal", ("uy", "uz"), np.eye(2), (None, None))
    matrices = Triplets.from_dense(mass * np.eye(2)), Triplets.zeros(2), Triplets.zeros(2)
    return System(*matrices, ("x", "y"), (weight,), (force,), (probe,))


@pytest.mark.parametrize("load", [1e-3, 1.0, 525.0, 5e4, 1e7])
def test_equilibrium_is_found_from_center(load):
    """The loads range from nearly concentric to an eccentricity above 0.99, beyond Ocvirk's force."""
    found = equilibrium(rotor_system(1.0, load), ConstantSpeed(SPEED)).displacement
    if load < 1e6:
        eccentricity = float(brentq(lambda e: load_capacity(e) - load, 1e-9, 0.999))
        # the equilibrium balances forces within 1e-9 of the load
        np.testing.assert_allclose(found, steady_position(eccentricity), rtol=0, atol=2e-9 * CLEARANCE)
    np.testing.assert_allclose(film_force(found, np.zeros(2))[0], [0.0, -load], rtol=0, atol=2e-9 * load)


def critical_mass(eccentricity):
    """Return the mass at the onset of whirl by the Routh criterion, and the frequency of the whirl."""
    K, C = published_coefficients(eccentricity)
    level = (K[0, 0] * C[1, 1] + K[1, 1] * C[0, 0] - K[0, 1] * C[1, 0] - K[1, 0] * C[0, 1]) / np.trace(C)
    square = np.linalg.det(K - level * np.eye(2)) / np.linalg.det(C)
    return level / square, math.sqrt(square)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_rotor_whirls_above_critical_mass(share):
    """The whirl decays below the closed-form critical mass and grows above it, with the closed-form frequency."""
    eccentricity = float(brentq(lambda e: load_capacity(e) - LOAD, 0.01, 0.9))
    mass, omega = critical_mass(eccentricity)
    assert 0.45 < omega / SPEED < 0.55  # half of the speed
    system, drive = rotor_system(share * mass), ConstantSpeed(SPEED)
    start = equilibrium(system, drive)
    start = replace(start, velocity=np.array([1e-4 * CLEARANCE * omega, 0.0]))
    period = math.tau / omega
    run = solve(Problem(system, drive, period / 200, 200 * 40, start), newmark())
    height = run["journal"].displacement[:, 1] - start.displacement[1]
    early, late = (float(np.abs(height[part]).max()) for part in (slice(2000, 4000), slice(-2000, None)))
    # growth by the roots of the characteristic equation
    K, C = published_coefficients(eccentricity)
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-K / (share * mass), -C / (share * mass)]])
    growth = float(np.linalg.eigvals(matrix).real.max())
    assert math.copysign(1.0, growth) == math.copysign(1.0, share - 1.0)
    crossings = np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))
    assert np.diff(crossings)[5:].mean() == pytest.approx(200.0, rel=0.02)
    assert math.log(late / early) == pytest.approx(growth * 20.0 * period, rel=0.05)


def test_energy_balance_of_growing_whirl():
    """In a growing whirl, work and dissipation are the path integrals of both parts of the film force."""
    mass, omega = critical_mass(0.2663)
    system, drive = rotor_system(1.5 * mass), ConstantSpeed(SPEED)
    start = replace(equilibrium(system, drive), velocity=np.array([0.1 * CLEARANCE * omega, 0.0]))
    run = solve(Problem(system, drive, math.tau / omega / 1000, 6000, start), newmark())
    d, v = run["journal"].displacement, run["journal"].velocity
    still = np.array([film_force(x, np.zeros(2))[0] for x in d])
    total_force = np.array([film_force(*one)[0] for one in zip(d, v, strict=True)])

    def work(force):
        power = (force * v).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]))]) * (run.time[1] - run.time[0])

    energy = {name: run.channels[f"energy.{name}"] for name in ("work", "dissipated", "residual", "kinetic")}
    assert energy["kinetic"][-1] > 10.0 * energy["kinetic"][0]
    weight = -LOAD * (d[:, 1] - d[0, 1])
    # a thousand steps per period: the error of both quadratures is about 1e-5 of the work that changes sign
    size = np.abs(energy["work"]).max()
    np.testing.assert_allclose(energy["work"], weight - work(still), rtol=0, atol=1e-4 * size)
    np.testing.assert_allclose(energy["dissipated"], work(total_force - still), rtol=0, atol=1e-4 * size)
    assert np.diff(energy["dissipated"]).min() >= 0.0
    assert np.abs(energy["residual"]).max() < 1e-6 * size


FILM = 'film = { diameter = "40 mm", length = "20 mm", radial_clearance = "40 um", viscosity = "20 mPa s" }'
SHAFT = """\
format = 1
title = "Shaft in two films"

[nodes]
left = [0, 0, 0]
cam = ["100 mm", 0, 0]
right = ["200 mm", 0, 0]
alone = [0, 1, 0]
apart = [1, 1, 0]

[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"

[sections.shaft]
shape = "circle"
diameter = "40 mm"

[members]
shaft = { nodes = ["left", "cam", "right"], material = "steel", section = "shaft" }
other = { nodes = ["alone", "apart"], material = "steel", section = "shaft" }

[supports]
left = ["ux", "rx"]
alone = ["ux", "uy", "uz", "rx", "ry", "rz"]

[bearings]
left = { at = "left", FILM }
right = { at = "right", FILM }

[loads.push]
at = "cam"
direction = "-uy"
force = "1 kN"

[cams.cam]
at = "cam"
law = "cycloidal"
lift = "1 mm"
rise = "90 deg"
return = "90 deg"

[run]
speed = "3000 rpm"
revolutions = 0.01
start = "equilibrium"

[output]
probes = ["left", "cam"]
"""


def read_shaft_case(tmp_path, *overrides):
    path = tmp_path / "shaft.toml"
    path.write_text(SHAFT.replace("FILM", FILM), encoding="utf-8")
    return flexcam.read_case(path, overrides)


@pytest.mark.parametrize(("overrides", "sense"), [((), 1.0), (("cams.cam.axis=[-1, 0, 0]",), -1.0)])
@pytest.mark.parametrize("speed", [3000.0, 1000.0])
def test_journal_position_of_case_matches_ocvirk(tmp_path, overrides, sense, speed):
    """Each film carries half of the load, at the speed and in the sense of rotation of the cam on the shaft."""
    response = flexcam.run(read_shaft_case(tmp_path, f"run.speed={speed} rpm", *overrides))
    bearing = FilmBearing("left", np.eye(6)[1:3], 0.04, 0.02, 4e-5, 0.02)
    omega = speed * math.pi / 30.0
    size = bearing.viscosity * omega * 0.02 * bearing.length**3 / (4.0 * bearing.radial_clearance**2)

    def load(e):
        return size * e / (1.0 - e * e) ** 2 * math.sqrt(math.pi**2 * (1.0 - e * e) + 16.0 * e * e)

    expected = float(brentq(lambda e: load(e) - 500.0, 0.01, 0.99))
    attitude = math.atan(math.pi * math.sqrt(1.0 - expected**2) / (4.0 * expected))
    for name in ("left", "right"):
        force, eccentricity, film = (
            response.channels[f"bearings.{name}.{one}"] for one in ("force", "eccentricity", "film_thickness")
        )
        # equilibrium within 1e-9 of the forces
        np.testing.assert_allclose(force, 500.0, rtol=1e-7)
        np.testing.assert_allclose(eccentricity, expected, rtol=1e-7)
        np.testing.assert_allclose(film, 4e-5 * (1.0 - expected), rtol=1e-7)
    moved = response["left"].displacement[:, 1:3]
    place = 4e-5 * expected * np.array([-math.cos(attitude), -sense * math.sin(attitude)])
    np.testing.assert_allclose(moved, np.tile(place, (len(moved), 1)), rtol=1e-6)
    # the angle is measured from the first direction, uy, in the sense of rotation
    angle = response.channels["bearings.left.angle"]
    np.testing.assert_allclose(np.cos(angle - math.pi - attitude), 1.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("bearings.left.stiffness=1e8", "either stiffness or film"),
        ('bearings.left={ at = "left" }', "either stiffness or film"),
        ("bearings.left.damping=100", "damping with stiffness"),
        ('supports.left=["ux", "uy", "uz", "rx"]', "which is held across the shaft"),
        (f'bearings.left={{ at = "apart", {FILM} }}', "a node of a member with a cam"),
    ],
)
def test_invalid_bearings_raise_error(tmp_path, override, message):
    with pytest.raises(InputError, match=message):
        flexcam.run(read_shaft_case(tmp_path, override))


def test_thin_film_causes_warning(flexcam, tmp_path):
    """The run warns if a journal leaves the range of the theory."""
    read_shaft_case(tmp_path)
    words = ("--set", "loads.push.force=100 kN", "--set", "run.speed=10 rpm")
    warnings = flexcam("run", tmp_path / "shaft.toml", *words, "-o", tmp_path / "out", "--json").json["warnings"]
    assert sum("beyond 0.99 its oil film" in one for one in warnings) == 2


def test_orbit_plot_requires_oil_film(flexcam, tmp_path):
    read_shaft_case(tmp_path)
    target = tmp_path / "orbits.svg"
    assert flexcam("plot", tmp_path / "shaft.toml", "--what", "orbits", "-o", target).code == 0
    assert target.stat().st_size > 1000
    elastic = [f"bearings.{name}={{ at = '{name}', stiffness = 1e8 }}" for name in ("left", "right")]
    words = [word for one in elastic for word in ("--set", one)]
    refused = flexcam("plot", tmp_path / "shaft.toml", "--what", "orbits", *words, "-o", target, "--overwrite")
    assert refused.code == 2
    assert "bearings.NAME.film" in refused.err
