"""Derivatives by differences and from matrices, held against closed forms."""

from __future__ import annotations

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


def beside(function, point, step):
    return np.array([function(point + part * step) for part in STEP_OFFSETS])


def pairs(make, point, step):
    return make(point), [make(point + part * step) for part in STEP_OFFSETS]


def triplets(M, K):
    return Triplets.from_dense(np.asarray(M, float)), Triplets.from_dense(np.asarray(K, float))


@pytest.mark.parametrize("degree", range(5))
def test_exact_for_polynomials_of_the_fourth_degree(degree):
    found = central_derivative(2.0**degree, beside(lambda x: x**degree, 2.0, 0.2), 0.2)
    assert found.value == pytest.approx(degree * 2.0 ** (degree - 1), rel=1e-12, abs=1e-13)
    assert found.smooth


def test_error_bounds_what_is_left():
    """Of exp: the estimate is the second order term that extrapolation took away, larger than what is left."""
    for step in (0.4, 0.2, 0.1):
        found = central_derivative(math.exp(1.0), beside(math.exp, 1.0, step), step)
        assert abs(found.value - math.e) < found.error < 0.1 * math.e


@pytest.mark.parametrize(
    "function",
    [lambda x: abs(x - 1.0), lambda x: max(x - 1.0, 0.0), lambda x: float(x > 1.0), lambda x: math.sin(1e5 * x)],
    ids=["kink", "contact opens", "jump", "noise"],
)
def test_what_is_not_smooth_is_told(function):
    assert not central_derivative(function(1.0), beside(function, 1.0, 0.01), 0.01).smooth


def test_a_constant_is_smooth():
    """Also with the noise of rounding on it."""
    rounding = 1.0 + 1e-14 * np.array([1.0, -1.0, 2.0, 0.0])
    assert central_derivative(1.0, np.ones(4), 0.01) == central_derivative(1.0, np.ones(4), 0.01)
    assert central_derivative(1.0, rounding, 0.01).smooth
    assert central_derivative(0.0, np.zeros(4), 0.01).smooth


def test_logarithmic():
    def logarithmic(slope, parameter, value):
        return Sensitivity("", "", value, Number("", parameter, ""), slope, None, True, "").logarithmic

    assert logarithmic(3.0 * 2.0**2, 2.0, 2.0**3) == 3.0
    assert math.isnan(logarithmic(1.0, 1.0, 0.0))


def test_mass_on_a_spring():
    """Of omega = sqrt(k/m): d omega/dk = omega/(2 k), d omega/dm = -omega/(2 m)."""
    k, m = 40e3, 0.1
    omega = math.sqrt(k / m)
    of_k = frequency_derivatives(*pairs(lambda p: triplets([[m]], [[p]]), k, 1e-3 * k), 1e-3 * k, 1)
    of_m = frequency_derivatives(*pairs(lambda p: triplets([[p]], [[k]]), m, 1e-3 * m), 1e-3 * m, 1)
    assert 2.0 * math.pi * of_k.values[0] == pytest.approx(omega / (2.0 * k), rel=1e-10)
    assert 2.0 * math.pi * of_m.values[0] == pytest.approx(-omega / (2.0 * m), rel=1e-10)
    assert of_k.repeated == (False,)


def test_chain_against_differences_of_frequencies():
    """Two masses between three springs, by the middle spring: only the second mode moves it."""

    def make(p):
        return triplets(np.eye(2), [[1.0 + p, -p], [-p, 1.0 + p]])

    found = frequency_derivatives(*pairs(make, 2.0, 1e-3), 1e-3, 2)
    wanted = np.array([0.0, 2.0 / (2.0 * math.sqrt(5.0))]) / (2.0 * math.pi)  # omega^2 = 1, 1 + 2 p
    np.testing.assert_allclose(found.values, wanted, atol=1e-12)


def test_equal_frequencies_part_along_their_branches():
    """K = [[1, p], [p, 1]] at p = 0: omega^2 = 1 -+ p, with slopes -+1/2 whatever shapes the solver chose."""

    def make(p):
        return triplets(np.eye(2), [[1.0, p], [p, 1.0]])

    found = frequency_derivatives(make(0.0), [make(part * 1e-3) for part in STEP_OFFSETS], 1e-3, 2)
    np.testing.assert_allclose(2.0 * math.pi * found.values, [-0.5, 0.5], atol=1e-12)
    assert found.repeated == (True, True)


def test_free_motions_are_left_out():
    found = frequency_derivatives(
        *pairs(lambda p: triplets(np.eye(2), [[p, -p], [-p, p]]), 3.0, 3e-3), 3e-3, 1,
        free=np.array([[1.0], [1.0]]) / math.sqrt(2.0),
    )  # fmt: skip
    assert 2.0 * math.pi * found.frequencies[0] == pytest.approx(math.sqrt(6.0), rel=1e-12)
    assert 2.0 * math.pi * found.values[0] == pytest.approx(math.sqrt(6.0) / (2.0 * 3.0), rel=1e-10)


@pytest.mark.parametrize(("missing", "place"), [
    (0, "at the nominal value"), (2, "after a finite-difference step of masses.lobe.mass"),
])  # fmt: skip
def test_a_limit_outside_the_range_says_where(missing, place):
    """Without a limit there, of the value itself (0) or of a neighbour."""
    file = CaseFile.open(Path(__file__).parents[2] / "flexcam/templates/pushrod-engine.toml")
    name, key = "limits.loss_of_contact", "masses.lobe.mass"

    def runs(variants):
        return [Row(Status(), {} if i == missing else {name: 6000.0}, {name: "rpm"}) for i in range(len(variants))]

    (found,) = sensitivities(file, (), [name], [key], runs)
    outside = "the limit lies outside the search range; lower --lowest or raise --highest"
    assert found.note == f"no derivative: {place} {outside}"
