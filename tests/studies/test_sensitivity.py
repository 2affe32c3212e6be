"""Derivatives by finite differences and from matrices, against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam.case.reader import CaseFile
from flexcam.case.variants import Number
from flexcam.core import Triplets
from flexcam.dynamics import Status
from flexcam.studies.plan import Row
from flexcam.studies.sensitivity import (
    STEP_OFFSETS,
    Sensitivity,
    central_derivative,
    frequency_derivatives,
    sensitivities,
)


def values_around(function, point, step):
    return np.array([function(point + part * step) for part in STEP_OFFSETS])


def matrices_around(make, point, step):
    return make(point), [make(point + part * step) for part in STEP_OFFSETS]


def triplets(M, K):
    return Triplets.from_dense(np.asarray(M, float)), Triplets.from_dense(np.asarray(K, float))


@pytest.mark.parametrize("degree", range(5))
def test_central_derivative_is_exact_for_fourth_degree(degree):
    found = central_derivative(2.0**degree, values_around(lambda x: x**degree, 2.0, 0.2), 0.2)
    assert found.value == pytest.approx(degree * 2.0 ** (degree - 1), rel=1e-12, abs=1e-13)
    assert found.smooth


def test_error_estimate_is_upper_bound():
    """For exp: the estimate is the second-order term that extrapolation removes, which exceeds the remaining error."""
    for step in (0.4, 0.2, 0.1):
        found = central_derivative(math.exp(1.0), values_around(math.exp, 1.0, step), step)
        assert abs(found.value - math.e) < found.error < 0.1 * math.e


@pytest.mark.parametrize(
    "function",
    [lambda x: abs(x - 1.0), lambda x: max(x - 1.0, 0.0), lambda x: float(x > 1.0), lambda x: math.sin(1e5 * x)],
    ids=["kink", "contact opens", "jump", "noise"],
)
def test_non_smooth_function_is_detected(function):
    assert not central_derivative(function(1.0), values_around(function, 1.0, 0.01), 0.01).smooth


def test_constant_is_smooth():
    """Also with rounding noise."""
    rounding = 1.0 + 1e-14 * np.array([1.0, -1.0, 2.0, 0.0])
    assert central_derivative(1.0, np.ones(4), 0.01).smooth
    assert central_derivative(1.0, rounding, 0.01).smooth
    assert central_derivative(0.0, np.zeros(4), 0.01).smooth


def test_logarithmic_sensitivity():
    def logarithmic(slope, parameter, value):
        return Sensitivity("", "", value, Number("", parameter, ""), slope, None, True, "").logarithmic

    assert logarithmic(3.0 * 2.0**2, 2.0, 2.0**3) == 3.0
    assert math.isnan(logarithmic(1.0, 1.0, 0.0))


def test_frequency_derivatives_of_mass_on_spring():
    """With omega = sqrt(k/m): d omega/dk = omega/(2 k), d omega/dm = -omega/(2 m)."""
    k, m = 40e3, 0.1
    omega = math.sqrt(k / m)
    of_k = frequency_derivatives(*matrices_around(lambda p: triplets([[m]], [[p]]), k, 1e-3 * k), 1e-3 * k, 1)
    of_m = frequency_derivatives(*matrices_around(lambda p: triplets([[p]], [[k]]), m, 1e-3 * m), 1e-3 * m, 1)
    assert 2.0 * math.pi * of_k.values[0] == pytest.approx(omega / (2.0 * k), rel=1e-10)
    assert 2.0 * math.pi * of_m.values[0] == pytest.approx(-omega / (2.0 * m), rel=1e-10)
    assert of_k.repeated == (False,)


def test_frequency_derivatives_of_chain():
    """Two masses between three springs, by the middle spring: only the second mode depends on it."""

    def make(p):
        return triplets(np.eye(2), [[1.0 + p, -p], [-p, 1.0 + p]])

    found = frequency_derivatives(*matrices_around(make, 2.0, 1e-3), 1e-3, 2)
    wanted = np.array([0.0, 2.0 / (2.0 * math.sqrt(5.0))]) / (2.0 * math.pi)  # omega^2 = 1, 1 + 2 p
    np.testing.assert_allclose(found.values, wanted, atol=1e-12)


def test_derivatives_of_repeated_frequencies():
    """K = [[1, p], [p, 1]] at p = 0: omega^2 = 1 -+ p, with slopes -+1/2 for any choice of the mode shapes."""

    def make(p):
        return triplets(np.eye(2), [[1.0, p], [p, 1.0]])

    found = frequency_derivatives(make(0.0), [make(part * 1e-3) for part in STEP_OFFSETS], 1e-3, 2)
    np.testing.assert_allclose(2.0 * math.pi * found.values, [-0.5, 0.5], atol=1e-12)
    assert found.repeated == (True, True)


def test_free_motions_are_excluded():
    found = frequency_derivatives(
        *matrices_around(lambda p: triplets(np.eye(2), [[p, -p], [-p, p]]), 3.0, 3e-3), 3e-3, 1,
        free=np.array([[1.0], [1.0]]) / math.sqrt(2.0),
    )  # fmt: skip
    assert 2.0 * math.pi * found.frequencies[0] == pytest.approx(math.sqrt(6.0), rel=1e-12)
    assert 2.0 * math.pi * found.values[0] == pytest.approx(math.sqrt(6.0) / (2.0 * 3.0), rel=1e-10)


@pytest.mark.parametrize(("missing", "place"), [
    (0, "at the nominal value"), (2, "after a finite-difference step of masses.lobe.mass"),
])  # fmt: skip
def test_note_on_limit_outside_search_range(missing, place):
    """The limit is missing at the nominal value (0) or at a neighbour."""
    file = CaseFile.open(Path(__file__).parents[2] / "flexcam/templates/pushrod-engine.toml")
    name, key = "limits.loss_of_contact", "masses.lobe.mass"

    def runs(variants):
        return [Row(Status(), {} if i == missing else {name: 6000.0}, {name: "rpm"}) for i in range(len(variants))]

    (found,) = sensitivities(file, (), [name], [key], runs)
    outside = "the limit lies outside the search range; lower --lowest or raise --highest"
    assert found.note == f"no derivative: {place} {outside}"
