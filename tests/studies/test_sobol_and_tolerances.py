"""Sobol indices of a function with known indices, and tolerance analysis of parts."""

import math

import numpy as np
import pytest

from flexcam.core.errors import InputError
from flexcam.studies.sensitivity import PartScatter, sample_parts, scalar_distribution, sobol_indices

A, B = 7.0, 0.1


def ishigami(x):
    """Ishigami function over -pi to pi, T. Ishigami and T. Homma (1990)."""
    one, two, three = (2.0 * math.pi * x - math.pi).T
    return (np.sin(one) + A * np.sin(two) ** 2 + B * three**4 * np.sin(one))[:, None]


def test_sobol_indices_of_ishigami_function():
    """Closed form: A. Saltelli et al., Sensitivity Analysis (2000), ch. 2. 0.03: scatter of the estimator at 1024."""
    variances = {
        "1": 0.5 * (1.0 + B * math.pi**4 / 5.0) ** 2, "2": A**2 / 8.0,
        "13": B**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0),
    }  # fmt: skip
    whole = sum(variances.values())
    first = [variances["1"] / whole, variances["2"] / whole, 0.0]
    total = [(variances["1"] + variances["13"]) / whole, variances["2"] / whole, variances["13"] / whole]
    (found,) = sobol_indices(ishigami, 3, 1024)
    np.testing.assert_allclose(found.first, first, atol=0.03)
    np.testing.assert_allclose(found.total, total, atol=0.03)
    assert found.variance == pytest.approx(whole, rel=0.02)
    low, high = found.total_interval
    assert ((low <= total) & (total <= high)).all()
    assert (high - low < 0.2).all()
    assert found.used == found.asked == 1024


def test_seed_repeats_indices_and_failed_points_are_excluded():
    def failing(x):
        values = ishigami(x)
        values[x[:, 0] > 0.97] = np.nan
        return values

    (found,), (again,) = (sobol_indices(failing, 3, 256, seed=3) for _ in range(2))
    np.testing.assert_array_equal(found.first_interval, again.first_interval)
    np.testing.assert_array_equal(found.first, again.first)
    assert found.used == 128
    with pytest.raises(InputError):
        sobol_indices(lambda x: np.full((len(x), 1), np.nan), 3, 16)


def test_single_variable_has_full_index():
    (found,) = sobol_indices(lambda x: 2.0 * x, 1, 256)
    np.testing.assert_allclose([found.first, found.total], 1.0, atol=0.03)
    assert found.first_interval.shape == (2, 1)


def test_constant_has_zero_indices():
    constant, other = sobol_indices(lambda x: np.column_stack([np.ones(len(x)), x[:, 0]]), 2, 64)
    assert constant.variance == 0.0
    assert not constant.total.any()
    np.testing.assert_allclose(other.total, [1.0, 0.0], atol=0.05)  # scatter of the estimator at 64


def test_count_must_be_power_of_two():
    with pytest.raises(InputError):
        sobol_indices(ishigami, 3, 100)


def test_scatter_of_linear_function():
    """For y = 3 a + b variances add; uniform h/sqrt 3, normal h/3. Two percent: error of a hypercube of 500."""
    parts = (PartScatter("a", 10.0, 0.6, "uniform"), PartScatter("b", 5.0, 0.9, "normal"))
    points = sample_parts(parts, 500)
    found = scalar_distribution(points, 3.0 * points[:, 0] + points[:, 1])
    assert found.mean == pytest.approx(35.0, abs=0.01)
    assert found.deviation == pytest.approx(math.hypot(3.0 * 0.6 / math.sqrt(3.0), 0.3), rel=0.02)
    assert points[:, 0].min() >= 9.4
    assert points[:, 0].max() <= 10.6
    assert found.quantiles[0.5] == pytest.approx(35.0, abs=0.05)
    assert found.ranks[0] > 0.9 > 0.4 > found.ranks[1] > 0.1
    np.testing.assert_array_equal(points, sample_parts(parts, 500))


def test_missing_values_are_counted():
    values = np.array([1.0, 2.0, np.nan, 3.0])
    found = scalar_distribution(np.arange(4.0)[:, None], values)
    assert (found.missing, found.mean, found.deviation) == (1, 2.0, 1.0)
    assert math.isnan(scalar_distribution(np.arange(4.0)[:, None], np.full(4, np.nan)).mean)
    assert scalar_distribution(np.arange(4.0)[:, None], np.ones(4)).ranks[0] == 0.0
