"""Spectral radius, period error and damping of the schemes, from amplification matrices and from runs.

N. M. Newmark (1959); H. M. Hilber, T. J. R. Hughes, R. L. Taylor (1977); J. Chung, G. M. Hulbert (1993); T. J. R.
Hughes, The Finite Element Method (1987), ch. 9. The amplification matrix is built here from the balance (1-am) a1 + am
a0 + w^2 ((1-af) d1 + af d0) = 0 and Newmark's two formulas, not taken from the code. Closed forms: average acceleration
T'/T = (x/2)/atan(x/2), x = w dt; linear acceleration stable up to x = 2 sqrt 3; radius at infinity (1+alpha)/(1-alpha)
of HHT and rho_inf of generalized-alpha.
"""

import math

import numpy as np
import pytest

from flexcam.dynamics import ConstantSpeed, Problem, State, generalized_alpha, hht, newmark, solve

SOURCE = "Newmark family, amplification matrix"
TENTH_OF_PERIOD = 2 * math.pi / 10
SCHEMES = {
    "Newmark 1/4, 1/2": newmark(),
    "Newmark 0.3025, 0.6": newmark(beta=0.3025, gamma=0.6),
    "HHT -0.1": hht(alpha=-0.1),
    "generalized-alpha 0.8": generalized_alpha(rho_inf=0.8),
    "linear acceleration": newmark(beta=1 / 6),
}
PARAMETERS = {  # beta, gamma, alpha_m, alpha_f from the formulas of the papers
    "Newmark 1/4, 1/2": (0.25, 0.5, 0.0, 0.0),
    "Newmark 0.3025, 0.6": (0.3025, 0.6, 0.0, 0.0),
    "HHT -0.1": (1.1**2 / 4, 0.6, 0.0, 0.1),
    "generalized-alpha 0.8": ((1 - 1 / 3 + 4 / 9) ** 2 / 4, 0.5 - 1 / 3 + 4 / 9, 1 / 3, 4 / 9),
    "linear acceleration": (1 / 6, 0.5, 0.0, 0.0),
}
# Period error and damping ratio at dt/T = 0.1 as tabulated (four decimals of a percent, five of xi).
PERIODS = {
    "Newmark 0.3025, 0.6": 0.032946,
    "HHT -0.1": 0.039506,
    "generalized-alpha 0.8": 0.033828,
    "linear acceleration": 0.016002,
}
RATIOS = {"Newmark 0.3025, 0.6": 0.02951, "HHT -0.1": 0.00211, "generalized-alpha 0.8": 0.00016}
AT_INFINITY = {
    "Newmark 1/4, 1/2": 1.0,
    "Newmark 0.3025, 0.6": 0.9 / 1.1,
    "HHT -0.1": 0.9 / 1.1,
    "generalized-alpha 0.8": 0.8,
}


def amplification_matrix(name, x):
    """Return the amplification matrix of (d, dt v, dt^2 a), from two 3 x 3 systems."""
    beta, gamma, am, af = PARAMETERS[name]
    new = np.array([[1, 0, -beta], [0, 1, -gamma], [(1 - af) * x**2, 0, 1 - am]])
    old = np.array([[1, 1, 0.5 - beta], [0, 1, 1 - gamma], [-af * x**2, 0, -am]])
    return np.linalg.solve(new, old)


def frequency_and_damping(matrix):
    """Return frequency times step and damping ratio of the oscillating pair: Hughes (1987), eqs. 9.1.29-9.1.30."""
    values = np.linalg.eigvals(matrix)
    pair = values[np.argmax(values.imag)]
    turn, decay = np.angle(pair), -np.log(np.abs(pair))
    return turn, decay / turn


@pytest.mark.parametrize("name", sorted(SCHEMES))
def test_parameters_of_schemes(name):
    s = SCHEMES[name]
    np.testing.assert_allclose((s.beta, s.gamma, s.alpha_m, s.alpha_f), PARAMETERS[name], rtol=1e-14)


@pytest.mark.parametrize("name", sorted(SCHEMES))
@pytest.mark.parametrize("x", [0.01, TENTH_OF_PERIOD, 3.0, 100.0])
def test_amplification_matrix_matches_formulas(name, x):
    np.testing.assert_allclose(SCHEMES[name].amplification(x), amplification_matrix(name, x), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", sorted(AT_INFINITY))
def test_spectral_radius_at_infinity(record, name):
    record(
        source=SOURCE, case=name, quantity="spectral radius at w dt = 1e4", unit="1", reference=AT_INFINITY[name],
        computed=SCHEMES[name].spectral_radius(1e4), tolerance=2.2e-3, absolute=True,
        reason="(w dt)^-2 under a cube root: generalized-alpha has a triple eigenvalue at -rho_inf in the limit",
    )  # fmt: skip


STABLE_SCHEMES = {
    **{f"generalized-alpha {r:g}": (generalized_alpha, {"rho_inf": r}) for r in (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0)},
    **{f"HHT {a:.2f}": (hht, {"alpha": a}) for a in (-1 / 3, -0.3, -0.1, -0.05, 0.0)},
    "Newmark 0.3025, 0.6": (newmark, {"beta": 0.3025, "gamma": 0.6}), "Newmark": (newmark, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(STABLE_SCHEMES))
@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_unconditional_stability(record, name, damping):
    """The range is w dt from 1e-2 to 1e4; a wrong beta of generalized-alpha reaches 11.7 at unchanged order 2."""
    make, given = STABLE_SCHEMES[name]
    scheme = make(**given)
    radii = [scheme.spectral_radius(x, damping) for x in np.geomspace(1e-2, 1e4, 241)]
    record(
        source=SOURCE,
        case=f"{name}, damping ratio {damping:g}",
        unit="1",
        reference=0.0,
        absolute=True,
        quantity="largest spectral radius above 1, w dt 1e-2 to 1e4",
        computed=max(0.0, max(radii) - 1),
        tolerance=1e-7,
        reason="unconditionally stable; double eigenvalues at -1 keep half the digits, sqrt eps",
    )


def test_second_order_for_all_parameters():
    """Rounding of gamma + alpha_m - alpha_f = 1/2 does not reject any parameter."""
    schemes = [generalized_alpha(rho_inf=r) for r in np.linspace(0, 1, 101)] + [
        hht(alpha=-a) for a in np.linspace(0, 1 / 3, 101)
    ]
    assert all(scheme.order == 2 for scheme in schemes)


@pytest.mark.parametrize("name", sorted(PERIODS))
def test_period_error_and_damping_ratio(record, name):
    turn, ratio = frequency_and_damping(SCHEMES[name].amplification(TENTH_OF_PERIOD))
    record(
        source=SOURCE,
        case=f"{name}, dt/T = 0.1",
        quantity="period error",
        unit="1",
        reference=PERIODS[name],
        computed=TENTH_OF_PERIOD / turn - 1,
        tolerance=5.1e-7,
        absolute=True,
        reason="half a unit of the last digit",
    )
    record(
        source=SOURCE,
        case=f"{name}, dt/T = 0.1",
        quantity="damping ratio",
        unit="1",
        reference=RATIOS.get(name, 0.0),
        computed=ratio,
        tolerance=5.1e-6,
        absolute=True,
        reason="half a unit of the last digit",
    )


@pytest.mark.parametrize("x", [0.1, TENTH_OF_PERIOD, 2.0, 10.0])
def test_average_acceleration_period_matches_formula(record, x):
    turn, ratio = frequency_and_damping(newmark().amplification(x))
    record(source=SOURCE, case=f"Newmark 1/4, 1/2, w dt = {x:.4g}", quantity="T'/T", unit="1", computed=x / turn,
           reference=(x / 2) / math.atan(x / 2), tolerance=1e-12, reason="rounding")  # fmt: skip
    assert abs(ratio) < 1e-12


def test_linear_acceleration_stability_limit(record):
    edge = 2 * math.sqrt(3)
    scheme = SCHEMES["linear acceleration"]
    low, high = 1.0, 10.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if scheme.spectral_radius(middle) <= 1 + 1e-12 else (low, middle)
    record(source=SOURCE, case="linear acceleration", quantity="stability limit w dt", unit="1", reference=edge,
           computed=low, tolerance=1e-7, reason="bisection to 1e-9, radius leaves 1 as a square root")  # fmt: skip


def run_free_vibration(system_of, scheme, x, steps):
    """Return the free vibration of the unit oscillator, w = 1, from d = 1, at every step."""
    system = system_of([[1.0]], [[0.0]], [[1.0]])
    start = State(np.ones(1), np.zeros(1))
    return solve(Problem(system, ConstantSpeed(1.0), x, steps, start), scheme)["all"]


@pytest.mark.parametrize("name", sorted(SCHEMES))
def test_run_matches_amplification_matrix(record, system_of, name):
    history = run_free_vibration(system_of, SCHEMES[name], TENTH_OF_PERIOD, 60)
    state = np.array([1.0, 0.0, -(TENTH_OF_PERIOD**2)])
    for _ in range(60):
        state = amplification_matrix(name, TENTH_OF_PERIOD) @ state
    record(
        source=SOURCE,
        case=f"{name}, run of 60 steps, dt/T = 0.1",
        quantity="last displacement",
        unit="1",
        reference=state[0],
        computed=history.displacement[-1],
        tolerance=1e-12,
        absolute=True,
        reason="rounding",
    )
    assert history.acceleration[-1] * TENTH_OF_PERIOD**2 == pytest.approx(state[2], abs=1e-12)


@pytest.mark.parametrize("name", sorted(PERIODS))
def test_period_error_of_run(record, system_of, name):
    """The recurrence d2 - p d1 + q d0 = 0 of the oscillating pair is fitted after decay of the spurious root."""
    d = run_free_vibration(system_of, SCHEMES[name], TENTH_OF_PERIOD, 400).displacement[50:150]
    (p, q), *_ = np.linalg.lstsq(np.column_stack([d[1:-1], -d[:-2]]), d[2:], rcond=None)
    turn = math.acos(p / (2 * math.sqrt(q)))
    record(
        source=SOURCE,
        case=f"{name}, run, dt/T = 0.1",
        quantity="period error",
        unit="1",
        reference=PERIODS[name],
        computed=TENTH_OF_PERIOD / turn - 1,
        tolerance=6e-7,
        absolute=True,
        reason="half a unit of the last digit",
    )


@pytest.mark.parametrize("name", ["generalized-alpha 0.8", "HHT -0.1", "Newmark 1/4, 1/2"])
@pytest.mark.parametrize("x", [10.0, 1e3])
def test_runs_with_large_steps_are_bounded(system_of, name, x):
    d = np.abs(run_free_vibration(system_of, SCHEMES[name], x, 500).displacement)
    assert d[250:].max() <= 1.0 + 1e-9


def test_average_acceleration_conserves_energy(record, system_of):
    history = run_free_vibration(system_of, newmark(), TENTH_OF_PERIOD, 1000)
    energy = 0.5 * (history.velocity**2 + history.displacement**2)
    record(
        source=SOURCE,
        case="Newmark 1/4, 1/2, run of 1000 steps",
        quantity="energy at the end / start",
        unit="1",
        reference=1.0,
        computed=energy[-1] / energy[0],
        tolerance=1e-12,
        reason="xi = 0 exactly; rounding of 1000 steps",
    )
